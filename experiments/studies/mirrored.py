"""The share of liars from which on no model can tell an honest world from a dishonest one.

In world A the first camp of raters is honest, and the second reports the complement of what it
perceives. In world B every quality is the complement of that in A; the first camp is honest there,
too, and the second lies. Then the first camp says in B what the second says in A, and the other way
round: the ratings are the same but for the places of the raters. A model that treats raters alike
and sees nothing but ratings gives every provider the same trust in both. A minute on one core.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.metrics import skill
from roletrust_env.metrics.confidence import Estimate, Floats, Interval, estimate
from roletrust_env.trust import Ratings, Traits, make_trust_model, trust_models
from roletrust_env.trust.model import start_model
from roletrust_experiments.plots.charts import Panel, Series, panels_figure
from studies.study import Recipe, Study, plus_minus

QUESTION = "From which share of liars on can no model tell an honest world from a dishonest one?"
RATERS, PROVIDERS, RESERVE = 20, 8, 3
_HALF = RATERS // 2
_LIARS = 2, 4, 6, 8, 9, _HALF, 12
_CENTRAL = "leave-one-out", "wary-role-trust", "iterative-filtering", "median", "role-trust"
_PERSONAL = "own-experience", "travos", "fire", "qor"
_NOISE, _RATED = 0.05, 0.5
_MORE = f", {RESERVE} more identities a liar"
_TIE = 1e-9  # trust that differs by less is the same but for rounding


class Options(NamedTuple):
    """Size of the study.

    Attributes:
        games: Number of games of each world.
        rounds: Number of rounds of a game.
    """

    games: int = 48
    rounds: int = 20


FILES = ("mirrored.png", "mirrored.md")
RECIPES = {"mirrored": Recipe(Options(), {name: f"findings/{name}" for name in FILES})}


class World(NamedTuple):
    """World of S raters and P providers in T rounds, for E games.

    Attributes:
        ratings: Ratings, shape (T, S, P, E), in [0, 1].
        mask: Flag, boolean, who rated whom, shape (T, S, P, E).
        quality: Qualities of the providers, shape (P, E).
        honest: Number of honest raters, which come first.
    """

    ratings: Floats
    mask: Any
    quality: Floats
    honest: int


def main(study: Study[Options]) -> None:
    """Play every model where half of the raters lie, and some with other shares, without and with
    more identities.
    """
    games, rounds = study.options
    rng = np.random.default_rng(study.seed)
    several = {many: worlds(RATERS - many, many, rounds, games, rng) for many in _LIARS}
    spare = {k: worlds(RATERS - k, k * (1 + RESERVE), rounds, games, rng) for k in (1, 2, 3, 4, 6)}
    at_half = {name: played(name, several[_HALF]) for name in trust_models()}
    panels = []
    for pairs, more, bound in ((several, "", 0.5), (spare, _MORE, 1 / (2 + RESERVE))):
        shares = [many / RATERS for many in pairs]
        steps = [Interval(y, y, y) for y in (1.0, 1.0, 0.0, 0.0)]
        known = [Series("bound", [0.0, bound, bound, shares[-1]], steps, known=True)]
        for title, models, part in (
            ("by published trust", _CENTRAL, 0),
            ("each judge by its own trust", _PERSONAL, 1),
        ):
            series = [
                Series(name, shares, [played(name, pair)[part].interval for pair in pairs.values()])
                for name in models
            ]
            along, what = "share of the raters that lie", "skill over both worlds"
            panels.append(Panel(title + more, along, what, series if part else series + known))
    note = f"{games} games for each value; 95% intervals"
    study.figure("mirrored.png", panels_figure(QUESTION, panels, note))
    study.page("mirrored.md", sentence(at_half), f"{games} games; made by `{study.command}`.")


def sentence(at_half: Mapping[str, tuple[Estimate, Estimate]]) -> str:
    """Return the answer from the skill of each model where half of the raters lie, by published and
    by own trust.
    """
    others = [
        f"{name} ({plus_minus(published)})"
        for name, (published, _) in at_half.items()
        if abs(published.mean) > _TIE
    ]
    rest = f"; others: {', '.join(others)}" if others else ""
    best, (_, own) = max(at_half.items(), key=lambda skills: skills[1][1].mean)
    return (
        f"From a half on: there {len(at_half) - len(others)} of {len(at_half)} models have a skill "
        f"of 0 over both worlds by published trust, up to rounding{rest}. Own experience escapes "
        f"the bound: a judge that uses its own trust has {plus_minus(own)} with {best}. If a liar "
        f"has {RESERVE} more identities, the bound is at {1 / (2 + RESERVE):.0%}."
    )


def worlds(
    honest: int, liars: int, rounds: int, games: int, rng: np.random.Generator
) -> tuple[World, World]:
    """Return the worlds A and B, with the same luck. Qualities are uniform in [0, 1].

    Liars who outnumber the honest do not rate, as many as there are too many. If they are fewer,
    the camps differ in size, and the worlds can be told apart.

    Args:
        honest: Number of honest raters, at least 1.
        liars: Number of liars, or of their identities.
        rounds: Number of rounds.
        games: Number of games.
        rng: Source of randomness.
    """
    raters, both = honest + liars, min(honest, liars)
    quality = rng.random((PROVIDERS, games))
    seen = np.clip(quality + rng.normal(0, _NOISE, (rounds, raters, PROVIDERS, games)), 0, 1)
    mask = rng.random(seen.shape) < _RATED
    mask[:, 2 * honest :] = False
    truthful = (np.arange(raters) < honest)[:, None, None]
    swapped = np.r_[honest : honest + both, both:honest, :both, honest + both : raters]
    here, world_b = (
        seen,
        seen[:, swapped],
    )  # a rater of B perceives the complement of what is `there`
    return (
        World(np.where(truthful, here, 1 - here), mask, quality, honest),
        World(np.where(truthful, 1 - world_b, world_b), mask[:, swapped], 1 - quality, honest),
    )


def trust_in(name: str, world: World) -> tuple[Floats, Floats]:
    """Return the trust in the providers after all rounds of a world.

    Returns:
        The published trust, shape (P, E); that of the honest raters, each its own where the model
        has it, (H, P, E).
    """
    model = make_trust_model(name)
    state = start_model(
        model, np.zeros(world.ratings.shape[1:]), np.zeros(world.ratings.shape[1:3], bool)
    )
    for ratings, mask in zip(world.ratings, world.mask, strict=True):
        state = model.update(state, Ratings(ratings, mask))
    published = np.asarray(model.provider_trust(state))
    if Traits.of(model).family != "personal":
        return published, published[None]
    own: Any = model.judge_trust(state)  # type: ignore[attr-defined]
    return published, np.asarray(own)[: world.honest]


def played(name: str, pair: tuple[World, World]) -> tuple[Estimate, Estimate]:
    """Return the skill of a model over both worlds, by published trust and by the own trust of
    honest raters.
    """
    trusted = [trust_in(name, world) for world in pair]
    return tuple(estimate(over_both([part[k] for part in trusted], pair)) for k in range(2))  # type: ignore[return-value]


def over_both(trust: list[Floats], pair: tuple[World, World]) -> Floats:
    """Return the skill of consumers who go to the most trusted provider, over both worlds, for each
    game, shape (E,).

    Args:
        trust: Trust in the providers in either world, (P, E), or (H, P, E) for H consumers. Ties
            are broken uniformly.
        pair: The worlds.
    """
    won, possible = np.zeros((2, pair[0].quality.shape[1]))
    for seen, world in zip(trust, pair, strict=True):
        top = seen >= seen.max(axis=-2, keepdims=True) - _TIE
        got = (top * world.quality).sum(axis=-2) / top.sum(axis=-2)
        blind = world.quality.mean(axis=0)
        won += (np.atleast_2d(got).mean(axis=0) - blind) / 2
        possible += (world.quality.max(axis=0) - blind) / 2
    return skill(1 - possible + won, 1 - possible)
