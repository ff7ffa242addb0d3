"""The rungs at the top of the ladder, which play no games: the exact optimum, and what is known of a rater's."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from roletrust_agents.planning.bracket import Bracket, bracket_rater
from roletrust_agents.planning.exact import Optimum, optimal_provider
from roletrust_env.evaluation.attacked_games import TaskArguments, exact_task
from roletrust_env.evaluation.attackers import OpenLoop
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.trust import RoleTrust
from roletrust_env.world.scenario import Scenario


@dataclass(frozen=True)
class Exact:
    """The optimum of one provider under `exploit` by dynamic programming, see `planning.exact`."""

    name: str = "exact"

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        task = exact_task(arguments)
        _check_model(task)
        agents = task.compromised
        if task.objective != "exploit" or len(agents) > 1 or agents[0] not in task.game.roster.provider_names:
            raise UnsuitableError("an exact optimum is known for one provider under exploit")
        if task.stealth.weight:
            raise UnsuitableError("the optimum of a provider is known without a price of stealth only")
        try:
            best = _provider(task.game.scenario)
        except ValueError as error:
            raise UnsuitableError(str(error)) from None
        words = f"quality by dynamic programming; grid error {best.error:.1e}"
        return SearchResult(OpenLoop(best.actions[:, None]), 0, words, bound=best.score)


@dataclass(frozen=True)
class BestKnown:
    """The best that is known of raters under `damage`, and for one rater a bound, see `planning.bracket`."""

    name: str = "best known"

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        task = exact_task(arguments)
        _check_model(task)
        agents, price = task.compromised, task.stealth
        if task.objective != "damage" or any(agent in task.game.roster.provider_names for agent in agents):
            raise UnsuitableError("the best is known of raters under damage")
        try:
            best = _raters(task.game.scenario, len(agents), price.weight, price.tolerance)
        except ValueError as error:
            raise UnsuitableError(str(error)) from None
        proof = "" if best.bound is None else f"; no attack scores more than {best.bound:.5f}, which is proven"
        actions = np.tile(best.lies, (1, len(agents)))
        return SearchResult(OpenLoop(actions), 0, f"two lies in each round, planned{proof}", bound=best.bound)


def _check_model(task: AttackTask) -> None:
    game = task.game
    model = RoleTrust(lam=game.scenario.lam, initial=game.scenario.initial_trust)
    if type(game.model) is not RoleTrust or game.model != model:
        raise UnsuitableError("the trust model is not role-trust with the scenario's own lam and initial trust")
    if task.joint_policy.attackers:
        raise UnsuitableError("there are other attackers")


# Luck has no part in them: the runs of a ladder share one result.


@lru_cache(maxsize=1)
def _provider(scenario: Scenario) -> Optimum:
    return optimal_provider(scenario)


@lru_cache(maxsize=1)
def _raters(scenario: Scenario, compromised: int, weight: float, tolerance: float) -> Bracket:
    return bracket_rater(scenario, compromised=compromised, weight=weight, tolerance=tolerance)
