"""How the games of a question are played: with the benchmark's measuring, and the same luck in all that is compared."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple, TypeVar

from rich.progress import Progress

from roletrust_env import Policy, Scenario, metrics
from roletrust_env.benchmark.cells import cells
from roletrust_env.benchmark.pool import LocalPool
from roletrust_env.benchmark.store import StoredCell
from roletrust_env.benchmark.suite import Suite
from roletrust_env.evaluation.attacked_games import exact_task
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.measurement import Floats, Watched, watch
from roletrust_env.game.consumer import Bought
from roletrust_env.storage.provenance import describe_policies
from roletrust_env.world.roster import Roster

T = TypeVar("T")

SETTLED = 10
"""Rounds after which the initial trust counts for 2 ** -10 at most, where lam is 0.5."""

PATIENCE_S = 3600.0
"""Seconds after which a cell of a suite is given up; they are minutes on a machine that has nothing else to do."""

_QUICK_ROUNDS, _QUICK_VALUES = 14, 2


class Asked(NamedTuple):
    """How thoroughly questions are answered.

    Attributes:
        games: of which means are taken.
        seed: of all luck.
        quick: whether games are short and only the first values are tried, to see that all works.
        progress: where to show how far it is.
    """

    games: int
    seed: int
    quick: bool
    progress: Progress

    def some(self, values: Iterable[T]) -> tuple[T, ...]:
        """The values that are tried."""
        return tuple(values)[:_QUICK_VALUES] if self.quick else tuple(values)

    def rounds(self, many: int) -> int:
        """The length of a game."""
        return min(many, _QUICK_ROUNDS) if self.quick else many


def play(asked: Asked, scenario: Scenario, attackers: Mapping[str, Policy] | None = None) -> Watched:
    """Play one scenario under the paper's model, with the same luck whoever attacks.

    Returns:
        Trust of shape (T, N, G), and what was bought, (T - 1, G).
    """
    arguments = {
        "scenario": scenario,
        "trust_model": "role-trust",
        "compromised": tuple(
            attackers or Roster.of(scenario).first_names[:1]
        ),  # who is named and has no policy is honest
        "objective": "mislead",
    }
    seen = watch(exact_task(arguments), Scripted(attackers or {}), asked.seed, (1, asked.games))
    return Watched(seen.trust[:, :, 0], Bought(*(part[:, 0] for part in seen.bought)))


def play_suite(asked: Asked, suite: Suite, label: str) -> list[StoredCell]:
    """Play all cells of a suite, on all cores.

    Returns:
        The cells in their order, those that failed too.
    """
    every = cells(suite)
    played = asked.progress.track(LocalPool().play(suite, every), total=len(every), description=label)
    done = dict(played)
    return [StoredCell(cell, done[cell]) for cell in every]


def lost(seen: Watched, twin: Watched, agents: Iterable[int]) -> Floats:
    """What some agents lost of their trust against other games with the same luck, once it has settled, (G,)."""
    return metrics.damage(seen.trust[SETTLED:], twin.trust[SETTLED:], list(agents)).value


def last(scenario: Scenario, role: str, many: int) -> tuple[str, ...]:
    """The names of the last agents of a role, such as `sr`."""
    return tuple(name for name in Roster.of(scenario).first_names if name.startswith(f"{role}_"))[-many:]


def honest(scenario: Scenario, attackers: Mapping[str, Policy]) -> list[int]:
    """The places of all agents that do not attack."""
    return [place for place, name in enumerate(Roster.of(scenario).names) if name not in attackers]


def as_settings(scenario: Scenario, **attacks: Mapping[str, Policy]) -> dict[str, Any]:
    """What was played, as plain data: a scenario, and who attacks in it."""
    return {
        "trust_model": "role-trust",
        "scenario": scenario.model_dump(mode="json"),
        "attackers": {name: describe_policies(attackers) for name, attackers in attacks.items()},
    }
