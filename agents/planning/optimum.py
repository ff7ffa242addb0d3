"""The rung at the top of the ladder: the exact optimum, where one is known."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from agents.ladder.players import OpenLoop
from agents.ladder.rungs import Arguments, Attempt, Tell, UnsuitableError, exact_task
from agents.planning.exact import Optimum, optimal_provider, optimal_rater
from roletrust_env.game.attack import AttackTask
from roletrust_env.trust import RoleTrust

if TYPE_CHECKING:
    pass


@dataclass(frozen=True)
class Exact:
    """The optimum by dynamic programming, which plays no games: `agents.planning.exact` says for which tasks.

    That of raters is the best *one lie about all providers*; lies that differ between providers can do a little more.
    """

    name: str = "exact"

    def attack(self, arguments: Arguments, budget: int, seed: int, tell: Tell) -> Attempt:
        """See `Rung.attack`."""
        task = exact_task(arguments)
        _check_model(task)
        try:
            provider = _is_provider(task)
            best = _provider(task) if provider else _rater(task)
        except ValueError as error:
            raise UnsuitableError(str(error)) from None
        what = "quality by dynamic programming" if provider else "one lie for all providers, by dynamic programming"
        actions = np.repeat(best.actions[:, None], task.action_size, axis=1)
        return Attempt(OpenLoop(actions), 0, f"{what}; grid error {best.error:.1e}")


def _check_model(task: AttackTask) -> None:
    game = task.game
    model = RoleTrust(lam=game.scenario.lam, initial=game.scenario.initial_trust)
    if type(game.model) is not RoleTrust or game.model != model:
        raise UnsuitableError("the trust model is not role-trust with the scenario's own lam and initial trust")
    if task.cast.attackers:
        raise UnsuitableError("there are other attackers")


def _is_provider(task: AttackTask) -> bool:
    """Whether the exact optimum asked for is that of a provider, and not that of raters."""
    roster, agents = task.game.roster, task.compromised
    if task.objective == "exploit" and len(agents) == 1 and agents[0] in roster.provider_names:
        if task.stealth.weight:
            raise UnsuitableError("the optimum of a provider is known without a price of stealth only")
        return True
    if task.objective == "damage" and all(agent not in roster.provider_names for agent in agents):
        return False
    raise UnsuitableError("an optimum is known for one provider under exploit, and for raters under damage")


def _provider(task: AttackTask) -> Optimum:
    return optimal_provider(task.game.scenario)


def _rater(task: AttackTask) -> Optimum:
    price = task.stealth
    return optimal_rater(
        task.game.scenario, compromised=len(task.compromised), weight=price.weight, tolerance=price.tolerance
    )
