"""Search methods that compute an attack without games: the exact optimum, and the best known attack
of raters.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from roletrust_agents.planning.bracket import Bracket, bracket_rater
from roletrust_agents.planning.exact import optimal_provider
from roletrust_agents.planning.grid import Optimum
from roletrust_env.evaluation.attackers import OpenLoop
from roletrust_env.evaluation.measurement import TaskArguments, exact_task
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.parameters import refuse_unknown_parameters
from roletrust_env.trust import RoleTrust
from roletrust_env.world.scenario import Scenario


@refuse_unknown_parameters
@dataclass(frozen=True)
class Exact:
    """Optimum of one provider under `exploit` by dynamic programming, see `planning.exact`.

    Attributes:
        name: Name in tables.
    """

    name: str = "exact"
    knowledge: ClassVar = "white_box"
    objectives: ClassVar = ("exploit",)

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        task = exact_task(arguments)
        _check_model(task)
        agents = task.compromised
        if (
            task.objective != "exploit"
            or len(agents) > 1
            or agents[0] not in task.game.roster.provider_names
        ):
            raise UnsuitableError("an exact optimum is known for one provider under exploit")
        if task.stealth.weight:
            raise UnsuitableError(
                "the optimum of a provider is known only without a price of stealth"
            )
        try:
            best = _provider(task.game.scenario)
        except ValueError as error:
            raise UnsuitableError(str(error)) from None
        words = f"quality by dynamic programming; grid error {best.error:.1e}"
        return SearchResult(OpenLoop(best.actions[:, None]), 0, words, bound=best.score)


@refuse_unknown_parameters
@dataclass(frozen=True)
class BestKnown:
    """Best known attack of raters under `damage`, and for one rater a bound, see
    `planning.bracket`.

    Attributes:
        name: Name in tables.
    """

    name: str = "best known"
    knowledge: ClassVar = "white_box"
    objectives: ClassVar = ("damage",)

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        task = exact_task(arguments)
        _check_model(task)
        agents, price = task.compromised, task.stealth
        if task.objective != "damage" or any(
            agent in task.game.roster.provider_names for agent in agents
        ):
            raise UnsuitableError("the best attack is known for raters under damage")
        try:
            best = _raters(task.game.scenario, len(agents), price.weight, price.tolerance)
        except ValueError as error:
            raise UnsuitableError(str(error)) from None
        proof = (
            ""
            if best.bound is None
            else f"; no attack scores more than {best.bound:.5f}, which is proven"
        )
        actions = np.tile(best.lies, (1, len(agents)))
        return SearchResult(
            OpenLoop(actions), 0, f"two lies in each round, planned{proof}", bound=best.bound
        )


def _check_model(task: AttackTask) -> None:
    game = task.game
    model = RoleTrust(lam=game.scenario.lam, initial=game.scenario.initial_trust)
    if type(game.model) is not RoleTrust or game.model != model:
        raise UnsuitableError(
            "the trust model is not role-trust with the scenario's own lam and initial trust"
        )
    if task.joint_policy.attackers:
        raise UnsuitableError("there are other attackers")


# The optima do not depend on the seed, so all runs share one result.


@lru_cache(maxsize=1)
def _provider(scenario: Scenario) -> Optimum:
    return optimal_provider(scenario)


@lru_cache(maxsize=1)
def _raters(scenario: Scenario, compromised: int, weight: float, tolerance: float) -> Bracket:
    return bracket_rater(scenario, compromised=compromised, weight=weight, tolerance=tolerance)
