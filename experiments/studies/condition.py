"""The condition of a suite in which attackers or defences are compared, and their score in fresh
games.
"""

import math
from typing import Any, NamedTuple, Self

from roletrust_env import Scenario
from roletrust_env.benchmarking.cells import cell_kinds, task_arguments
from roletrust_env.benchmarking.suite import Cell, Suite
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_env.errors import suggest
from roletrust_env.evaluation.attackers import Attacker
from roletrust_env.evaluation.measurement import TaskArguments, exact_task, score
from roletrust_env.evaluation.scripts import AttackKind
from roletrust_env.metrics.score import mean_or_nan
from studies import SUITES

_FRESH = 1_000_000  # added to the seed of a search: no search has seen the games that measure it


def suite_of(name: str) -> Suite:
    """Return a suite of trust models: one that only studies play, or else one of the project, or
    from a TOML file.
    """
    own = SUITES / f"{name}.toml"
    suite = load_suite(own if own.exists() else name)
    if not isinstance(suite, Suite):
        raise ValueError(
            f"the suite {suite.name} is one for {suite.kind}; choose one for trust models"
        )
    return suite


def scenario_of(suite: str, name: str) -> Scenario:
    """Return a scenario of a suite by its name."""
    stages = suite_of(suite).scenarios
    if name not in stages:
        raise ValueError(f"suite {suite} has no scenario {name!r}{suggest(name, stages)}")
    return stages[name].scenario()


class Condition(NamedTuple):
    """Condition of a robustness suite.

    Attributes:
        suite: The suite.
        scenario: Name of the scenario in the suite.
        track: Name of the track in the suite.
        share: Share of compromised agents in each role of the track, between 0 and 1.
    """

    suite: Suite
    scenario: str
    track: str
    share: float

    @classmethod
    def of(cls, suite: str, scenario: str, track: str, share: float) -> Self:
        """Return a condition from the options of a study.

        Raises:
            ValueError: A name is unknown, nobody is compromised on the track, or all are.
        """
        chosen_suite = suite_of(suite)
        tracks = [
            name for name, track_of_suite in chosen_suite.tracks.items() if track_of_suite.roles
        ]
        for what, name, known in (
            ("scenario", scenario, list(chosen_suite.scenarios)),
            ("track", track, tracks),
        ):
            if name not in known:
                raise ValueError(
                    f"suite {chosen_suite.name} has no {what} {name!r} with "
                    f"attackers{suggest(name, known)}"
                )
        if not 0 < share < 1:
            raise ValueError(
                f"the share of compromised agents is {share:g}; it must lie between 0 and 1"
            )
        return cls(chosen_suite, scenario, track, share)

    def __str__(self) -> str:
        """Return the condition in a few words."""
        return f"{self.suite.name}: {self.scenario}, {self.track} {self.share:.0%}"

    def arguments(self, model: str, method: str = "scripted") -> TaskArguments:
        """Return the arguments of the attack task against a trust model.

        Args:
            model: Spec of the trust model.
            method: Name of the search method, which may need its own objective.
        """
        return task_arguments(self.suite, self._cell(model, method))

    def kinds(self, model: str) -> dict[str, AttackKind]:
        """Return the kinds of scripted attacks that the compromised agents can play, by name."""
        return cell_kinds(self.suite, self._cell(model), exact_task(self.arguments(model)))

    def utility(self, model: str, attacker: Attacker, seed: int, games: int) -> float | None:
        """Return the mean utility of a consumer in fresh games; None if it is undefined in all of
        them.

        Args:
            model: Spec of the trust model.
            attacker: The attacker.
            seed: Seed of the search, so that attackers with the same seed meet the same fresh
                games.
            games: Number of games.
        """
        scored = score(exact_task(self.arguments(model)), attacker, _FRESH + seed, (1, games))
        mean = float(mean_or_nan(scored.scores["utility"][0], axis=0))
        return None if math.isnan(mean) else mean

    def describe(self) -> dict[str, Any]:
        """Return the condition as plain data."""
        return {"condition": str(self), "suite": self.suite.model_dump(mode="json")}

    def _cell(self, model: str, method: str = "scripted") -> Cell:
        return Cell(model, self.scenario, self.track, self.share, method, 0)
