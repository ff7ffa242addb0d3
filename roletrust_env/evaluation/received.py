"""What consumers received in an attacked game in which they choose providers, as scores of a world.

See `roletrust_env.game.consumer.receive`: choices have consequences, and the yardsticks depend on
nothing that a trust model or an attacker does.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Annotated, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.game.consumer import Bought, receive
from roletrust_env.game.rollout import Players, Round, rollout
from roletrust_env.metrics.score import ratio
from roletrust_env.shapes import Shape
from roletrust_env.world.scenario import Choice

Floats = npt.NDArray[np.float64]


class Served(NamedTuple):
    """The services of a round to the honest consumers of K attacks in G games.

    Attributes:
        got: Mean quality that each game's consumers got, shape (K, G).
        best: The same, had they chosen the best honest provider.
        blind: The same, had they chosen blindly.
        services: Number of services over the games, shape (K,).
        from_attacker: Number of these that compromised providers gave; None without such providers.
        earned: Sum of 1 - quality over these; None without such providers.
        squares: Sum of (trust at the choice - quality)^2 over all services, shape (K,).
        silent: `got`, `best` and `blind` of consumers that send no reports; None without any.
    """

    got: Floats
    best: Floats
    blind: Floats
    services: Floats
    from_attacker: Floats | None
    earned: Floats | None
    squares: Floats
    silent: Bought | None


def _gain(part: Bought | Served | None) -> Floats | None:
    return None if part is None else np.asarray((part.got - part.blind).sum(axis=-1))


def _possible(part: Bought | Served | None) -> Floats | None:
    return None if part is None else np.asarray((part.best - part.blind).sum(axis=-1))


class Score(NamedTuple):
    """A score of a world: a ratio of two sums over rounds. Results, leaderboards and pages read it
    from `SCORES`.

    Attributes:
        name: Name in results and tables.
        low: Least value.
        high: Greatest value.
        better: Better direction for consumers.
        formula: Definition in plain text.
        part: Numerator of a round, shape (K,); None where the score is undefined.
        whole: Denominator of a round.
    """

    name: str
    low: float
    high: float
    better: Literal["higher", "lower"]
    formula: str
    part: Callable[[Served], Floats | None]
    whole: Callable[[Served], Floats | float | None]


SCORES = {
    score.name: score
    for score in (
        Score(
            *("skill", -1000.0, 1000.0, "higher"),
            "sum of (received - blind) / sum of (best - blind), over honest consumers, rounds and "
            "games; 1 is always the best honest provider, 0 is chance",
            *(_gain, _possible),
        ),
        Score(
            *("regret", -1.0, 1.0, "lower"),
            "mean of best - received over rounds and games",
            lambda served: (served.best - served.got).mean(axis=-1),
            lambda served: 1.0,
        ),
        Score(
            *("attacker_share", 0.0, 1.0, "lower"),
            "services from compromised providers / all services",
            lambda served: served.from_attacker,
            lambda served: served.services,
        ),
        Score(
            *("attacker_earnings", 0.0, 1.0, "lower"),
            "sum of 1 - quality over services from compromised providers / all services",
            lambda served: served.earned,
            lambda served: served.services,
        ),
        Score(
            *("brier", 0.0, 1.0, "lower"),
            "mean of (trust at the choice - quality received)^2 over services",
            lambda served: served.squares,
            lambda served: served.services,
        ),
        Score(
            *("silent_skill", -1000.0, 1000.0, "higher"),
            "skill of the consumers that send no reports",
            lambda served: _gain(served.silent),
            lambda served: _possible(served.silent),
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
    common = honest, access.providers
    sums = {name: np.zeros((2, batch[0])) for name in SCORES}
    by_round = []
    for before, actions, state, _, weight in world_rounds(players, seed, batch):
        offered = game.offered(before, actions, state)
        able = before.properties.ability
        ability = np.ones(state.quality.shape) if able is None else able

        mine, sides = state.awaiting[consumers], (0, 1, 3)
        each = offered[consumers] if offered.ndim == mine.ndim else offered[None]
        quality = np.where(mine, each, 0.0)
        trust = np.where(mine, game.known_trust(state)[consumers], 0.0)
        served = Served(
            *receive(state.awaiting, offered, ability, consumers, *common),
            services=mine.sum(axis=sides),
            from_attacker=mine[:, bad].sum(axis=sides) if bad else None,
            earned=(mine * (1 - quality))[:, bad].sum(axis=sides) if bad else None,
            squares=((trust - quality) ** 2).sum(axis=sides),
            silent=receive(state.awaiting, offered, ability, quiet, *common) if quiet else None,
        )
        by_round.append((served.best - served.got).mean(axis=-1))
        for name, score in SCORES.items():
            for total, value in zip(
                sums[name], (score.part(served), score.whole(served)), strict=True
            ):
                total += np.nan if value is None else weight * value
    return WorldScores({name: ratio(*total) for name, total in sums.items()}, np.stack(by_round))
