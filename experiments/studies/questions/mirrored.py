"""The share of liars at which honest and dishonest worlds look alike.

In world A the first camp of raters is honest, and the second reports the complement of what it
perceives. In world B every quality is the complement of that in A; the first camp is honest there,
too, and the second lies. Then the first camp says in B what the second says in A, and the other way
round: the ratings are the same but for the places of the raters. A model that treats raters alike
and sees nothing but ratings gives every provider the same trust in both.
"""

from typing import Any, NamedTuple

import numpy as np

from roletrust_env.metrics import skill
from roletrust_env.metrics.confidence import Estimate, Floats, estimate
from roletrust_env.trust import Ratings, Traits, make_trust_model, trust_models
from roletrust_env.trust.model import start_model
from roletrust_experiments.plots.charts import Panel, Series
from studies.questions.answers import Effort, Finding, amount, exact

QUESTION = "From which share of liars on can no model tell an honest world from a dishonest one?"
RATERS, PROVIDERS, ROUNDS, RESERVE = 20, 8, 20, 3
_HALF = RATERS // 2
_LIARS = _HALF, 2, 4, 6, 8, 9, 12
_CENTRAL = "leave-one-out", "wary-role-trust", "iterative-filtering", "median", "role-trust"
_PERSONAL = "own-experience", "travos", "fire", "qor"
_NOISE, _RATED = 0.05, 0.5
_TIE = 1e-9  # trust that differs by less is the same but for rounding


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


def answer(effort: Effort) -> Finding:
    """Play every model where half of the raters lie, and some with other shares, without and with
    more identities.
    """
    rng = np.random.default_rng(effort.seed)
    rounds, liars = effort.rounds(ROUNDS), sorted(effort.values_to_try(_LIARS))
    several = {many: worlds(RATERS - many, many, rounds, effort.games, rng) for many in liars}
    spare = {
        k: worlds(RATERS - k, k * (1 + RESERVE), rounds, effort.games, rng) for k in (1, 2, 3, 4, 6)
    }
    published: dict[str, Estimate] = {}
    own: dict[str, Estimate] = {}
    for name in tuple(trust_models()):
        published[name], own[name] = played(name, several[_HALF])
    panels = []
    more = f"{RESERVE} more identities a liar"
    for title, models, part, pairs in (
        ("by published trust", _CENTRAL, 0, several),
        ("each judge by its own trust", _PERSONAL, 1, several),
        (f"by published trust, {more}", _CENTRAL, 0, spare),
        (f"each judge by its own trust, {more}", _PERSONAL, 1, spare),
    ):
        values_of_model = {
            name: [played(name, pair)[part].interval for pair in pairs.values()] for name in models
        }
        shares = [many / RATERS for many in pairs]
        series = [Series(name, shares, values) for name, values in values_of_model.items()]
        limit = 1 / (2 + RESERVE) if pairs is spare else 0.5
        known = (
            []
            if part
            else [
                Series(
                    "bound",
                    [0.0, limit, limit, shares[-1]],
                    [*map(exact, (1, 1, 0, 0))],
                    known=True,
                )
            ]
        )
        panels.append(
            Panel(
                title, "share of the raters that lie", "skill over both worlds", [*series, *known]
            )
        )
    return Finding(QUESTION, sentence(published, own), panels, effort.games)


def sentence(published: dict[str, Estimate], own: dict[str, Estimate]) -> str:
    """Return the answer from the skill of each model where half of the raters lie, by published and
    by own trust.
    """
    zero = [name for name, trust_gap in published.items() if abs(trust_gap.mean) <= _TIE]
    others = [
        f"{name} ({amount(trust_gap)})" for name, trust_gap in published.items() if name not in zero
    ]
    best = max(own, key=lambda name: own[name].mean)
    rest = f"; others: {', '.join(others)}" if others else ""
    return (
        f"From a half on: there {len(zero)} of {len(published)} models have a skill of 0 over both "
        "worlds by published "
        f"trust, up to rounding{rest}. Own experience escapes the bound: a judge that goes by its "
        "own trust has "
        f"{amount(own[best])} with {best}. If a liar has {RESERVE} identities more, the bound is "
        "at "
        f"{1 / (2 + RESERVE):.0%}."
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
