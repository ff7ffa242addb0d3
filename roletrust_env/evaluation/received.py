"""What consumers received in an attacked game in which they choose providers, as scores of a world.

See `roletrust_env.game.consumer.receive`: choices have consequences, and the yardsticks depend on
nothing that a trust model or an attacker does.
"""

from collections.abc import Iterator, Sequence
from typing import Annotated, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.game.consumer import receive
from roletrust_env.game.rollout import Players, Round, rollout
from roletrust_env.metrics.score import ratio
from roletrust_env.shapes import Shape
from roletrust_env.world.scenario import Choice

Floats = npt.NDArray[np.float64]


class Score(NamedTuple):
    """A score of a world. Results, leaderboards and pages read it from `SCORES`.

    Attributes:
        name: Name in results and tables.
        low: Least value.
        high: Greatest value.
        better: Better direction for consumers.
        formula: Definition in plain text.
    """

    name: str
    low: float
    high: float
    better: Literal["higher", "lower"]
    formula: str


SCORES = {
    score.name: score
    for score in (
        Score(
            *("skill", -1000.0, 1000.0, "higher"),
            "sum of (received - blind) / sum of (best - blind), over honest consumers, rounds and "
            "games; 1 is always the best honest provider, 0 is chance",
        ),
        Score(*("regret", -1.0, 1.0, "lower"), "mean of best - received over rounds and games"),
        Score(
            *("attacker_share", 0.0, 1.0, "lower"),
            "services from compromised providers / all services",
        ),
        Score(
            *("attacker_earnings", 0.0, 1.0, "lower"),
            "sum of 1 - quality over services from compromised providers / all services",
        ),
        Score(
            *("brier", 0.0, 1.0, "lower"),
            "mean of (trust at the choice - quality received)^2 over services",
        ),
        Score(
            *("silent_skill", -1000.0, 1000.0, "higher"),
            "skill of the consumers that send no reports",
        ),
    )
}
"""The scores of a world by name, all without a unit. The skill is that of Murphy (1988); the third
and the fourth are of attackers, NaN without them, and the last one is NaN where all consumers
report. A skill is above 1 where compromised providers serve better than the best honest one."""

RANGES = {score.name: (score.low, score.high) for score in SCORES.values()}


class WorldScores(NamedTuple):
    """The scores of K attacks in the games of a world.

    Attributes:
        scores: Scores by name, shape (K,) each; NaN where undefined, see `SCORES`.
        regret_by_round: Mean regret in each round over the games, shape (T, K).
    """

    scores: dict[str, Annotated[Floats, Shape("K")]]
    regret_by_round: Annotated[Floats, Shape("T K")]


def world_rounds(
    players: Players, seed: tuple[int, ...], batch: tuple[int, int]
) -> Iterator[Round]:
    """Yield the rounds that `measure_world` plays. Arguments as there."""
    noise, chance = np.random.SeedSequence(seed).generate_state(2)
    sources = players.game.random(int(noise)), players.game.random(int(chance))
    return rollout(players, *sources, batch[1:], rows=batch[0])


def measure_world(
    players: Players,
    identities: Sequence[str],
    seed: tuple[int, ...],
    batch: tuple[int, int],
    silent: Sequence[str] = (),
) -> WorldScores:
    """Play attacks side by side in the games of a world, and return the scores.

    Args:
        players: Behaviour of all agents of a game in double precision, whose raters choose
            providers, see `Choice`.
        identities: Names of the compromised agents and of their identities in reserve.
        seed: Random seed of the games. All attacks meet the same noise, so that they compare.
        batch: Shape (K, G): K attacks in G games each.
        silent: Names of honest raters that send no reports, see `silent_skill`.

    Raises:
        ValueError: An agent or a trust model fails, or an action is NaN or outside [0, 1].
    """
    game, access = players.game, players.game.scenario.access
    assert isinstance(access, Choice)
    raters, providers = game.roster.rater_names, game.roster.provider_names
    consumers = [i for i, name in enumerate(raters) if name not in identities]
    honest = [j for j, name in enumerate(providers) if name not in identities]
    bad = [j for j, name in enumerate(providers) if name in identities]
    quiet = [i for i, name in enumerate(raters) if name in silent]
    gained, possible = np.zeros((2, batch[0])), np.zeros((2, batch[0]))
    services, from_bad, earned, squares = np.zeros((4, batch[0]))
    by_round = []
    for before, actions, state, _, weight in world_rounds(players, seed, batch):
        offered = game.offered(before, actions, state)
        able = before.properties.ability
        ability = np.ones(state.quality.shape) if able is None else able
        for k, group in enumerate((consumers, quiet)):
            if group:
                part = receive(state.awaiting, offered, ability, group, honest, access.providers)
                gained[k] += weight * (part.got - part.blind).sum(axis=-1)
                possible[k] += weight * (part.best - part.blind).sum(axis=-1)
                if k == 0:
                    by_round.append((part.best - part.got).mean(axis=-1))
        mine = state.awaiting[consumers]
        each = offered[consumers] if offered.ndim == mine.ndim else offered[None]
        quality, sums = np.where(mine, each, 0.0), (0, 1, 3)
        services += weight * mine.sum(axis=sums)
        from_bad += weight * mine[:, bad].sum(axis=sums)
        earned += weight * (mine * (1 - quality))[:, bad].sum(axis=sums)
        trust = np.where(mine, game.known_trust(state)[consumers], 0.0)
        squares += weight * ((trust - quality) ** 2).sum(axis=sums)
    regret, weights = np.stack(by_round), game.scenario.round_weights
    nothing = np.full(batch[0], np.nan)
    scores = {
        "skill": ratio(gained[0], possible[0]),
        "regret": weights @ regret / weights.sum(),
        "attacker_share": ratio(from_bad, services) if bad else nothing,
        "attacker_earnings": ratio(earned, services) if bad else nothing,
        "brier": ratio(squares, services),
        "silent_skill": ratio(gained[1], possible[1]) if quiet else nothing,
    }
    return WorldScores(scores, regret)
