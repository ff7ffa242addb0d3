"""Games of a question: measured as in the benchmark, with the same random numbers in all compared games."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple, TypeVar

from rich.progress import Progress

from roletrust_env import Policy, Scenario, metrics
from roletrust_env.benchmarking.pool import LocalPool
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.measurement import Floats, GameRecord, exact_task, watch
from roletrust_env.game.consumer import Bought
from roletrust_env.storage.provenance import describe_policies
from roletrust_env.world.group import Role
from roletrust_env.world.roster import Roster
from studies import SUITES

T = TypeVar("T")

SETTLED = 10
"""Rounds after which the initial trust counts for 2 ** -10 at most, where lam is 0.5."""

PATIENCE_S = 3600.0
"""Time limit of a cell of a suite in seconds; an idle machine needs minutes."""

_QUICK_ROUNDS, _QUICK_VALUES = 14, 2


class Effort(NamedTuple):
    """Effort for a question.

    Attributes:
        games: Number of games of each mean.
        seed: Random seed.
        quick: True for short games and the first values only, to check that everything works.
        progress: Progress display.
    """

    games: int
    seed: int
    quick: bool
    progress: Progress

    def some(self, values: Iterable[T]) -> tuple[T, ...]:
        """Return the values to try."""
        return tuple(values)[:_QUICK_VALUES] if self.quick else tuple(values)

    def rounds(self, many: int) -> int:
        """Return the length of a game in rounds."""
        return min(many, _QUICK_ROUNDS) if self.quick else many


def scripts() -> tuple[str, ...]:
    """Return the attacks of questions about the worst script: those of the suite `attackers`.

    They are frozen, so that published answers stay comparable.
    """
    suite = load_suite(SUITES / "attackers.toml")
    assert isinstance(suite, Suite)
    return tuple(suite.attacks)


def play(effort: Effort, scenario: Scenario, attackers: Mapping[str, Policy] | None = None) -> GameRecord:
    """Play a scenario under the paper's model, with the same random numbers for all attacks.

    Returns:
        Trust of shape (T, N, G), and purchases of shape (T - 1, G).
    """
    arguments = {
        "scenario": scenario,
        "trust_model": "role-trust",
        "compromised": tuple(
            attackers or Roster.of(scenario).owner_names[:1]
        ),  # who is named and has no policy is honest
        "objective": "mislead",
    }
    seen = watch(exact_task(arguments), Scripted(attackers or {}), effort.seed, (1, effort.games))
    rounds = (Bought(*(part[:, 0] for part in bought)) for bought in (seen.bought, seen.published))
    return GameRecord(seen.trust[:, :, 0], *rounds)


def play_suite(effort: Effort, suite: Suite, label: str) -> list[StoredCell]:
    """Play all cells of a suite, on all cores.

    Returns:
        The cells in their order, including failed ones.
    """
    every = suite.cells()
    played = effort.progress.track(LocalPool().play(suite, every), total=len(every), description=label)
    done = dict(played)
    return [StoredCell(cell, done[cell]) for cell in every]


def lost(seen: GameRecord, twin: GameRecord, agents: Iterable[int]) -> Floats:
    """Return the trust that agents lost against other games with the same random numbers, once it has settled, (G,)."""
    return metrics.damage(seen.trust[SETTLED:], twin.trust[SETTLED:], list(agents)).value


def last(scenario: Scenario, role: Role, many: int) -> tuple[str, ...]:
    """Return the names of the last agents of a role, such as `SR`."""
    roster = Roster.of(scenario)
    return tuple(name for name in roster.owner_names if roster.role(name) == role)[-many:]


def honest(scenario: Scenario, attackers: Mapping[str, Policy]) -> list[int]:
    """Return the indices of all agents that do not attack."""
    return [place for place, name in enumerate(Roster.of(scenario).names) if name not in attackers]


def as_settings(scenario: Scenario, **attacks: Mapping[str, Policy]) -> dict[str, Any]:
    """Return a scenario and its attackers as plain data."""
    return {
        "trust_model": "role-trust",
        "scenario": scenario.model_dump(mode="json"),
        "attackers": {name: describe_policies(attackers) for name, attackers in attacks.items()},
    }
