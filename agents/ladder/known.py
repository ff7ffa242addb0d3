"""Rungs that search nothing: honest play at the foot of the ladder, saved attackers, the exact optimum at its top."""

import copy
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from agents.ladder.players import OpenLoop, Scripted
from agents.ladder.rungs import Arguments, Attempt, Tell, UnsuitableError, exact_task
from agents.planning.exact import Optimum, optimal_provider, optimal_rater
from roletrust_env.arrays import Array
from roletrust_env.envs.tasks import task_spaces
from roletrust_env.game.attack import AttackTask, Knowledge, TaskState
from roletrust_env.randomness import Random
from roletrust_env.trust import RoleTrust

if TYPE_CHECKING:
    from agents.learned.network import Network


@dataclass(frozen=True)
class HonestPlay:
    """The compromised agents do nothing wrong."""

    name: str = "honest play"

    def attack(self, arguments: Arguments, budget: int, seed: int, tell: Tell) -> Attempt:
        """See `Rung.attack`."""
        return Attempt(Scripted({}), 0, "serves its best, reports what it perceives")


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


@dataclass(frozen=True, eq=False)
class Mind:
    """A network that decides for all compromised agents, seeing what its knowledge lets it see."""

    network: "Network"
    knowledge: Knowledge

    def begin(self, task: AttackTask, random: Random, batch: tuple[int, int]) -> Any:
        """See `Attacker.begin`."""
        return _knowing(task, self.knowledge), self.network.begin(np.zeros(batch))

    def act(self, task: AttackTask, state: TaskState, memory: Any, random: Random) -> tuple[Array, Any]:
        """See `Attacker.act`."""
        task, remembered = memory
        action, remembered = self.network(task.observe(state), remembered)
        return action, (task, remembered)


@dataclass(frozen=True)
class Learned:
    """A saved attacker, as `roletrust train` leaves it. Its rounds and seconds are those of its training.

    Attributes:
        path: of its folder, or of one of its two files.
        name: in tables.
    """

    path: Path
    name: str = "learned"

    def attack(self, arguments: Arguments, budget: int, seed: int, tell: Tell) -> Attempt:
        """See `Rung.attack`."""
        from agents.learned.saved import load_attacker

        saved = load_attacker(self.path)
        card, task = saved.card, exact_task(arguments)
        mind = Mind(saved.network, card.task.knowledge)
        seen, needed = _observation_size(_knowing(task, mind.knowledge)), card.architecture.inputs
        if (seen, task.action_size) != (needed, card.architecture.outputs):
            raise UnsuitableError(
                f"{self.path} learned with {needed} observations and {card.architecture.outputs} actions; "
                f"this task has {seen} and {task.action_size}"
            )
        words = f"{card.training.algorithm} on {card.task.id}, {card.task.knowledge}"
        return Attempt(mind, card.training.steps, words, card.training.seconds)


def _knowing(task: AttackTask, knowledge: Knowledge) -> AttackTask:
    """The same task, seen with another knowledge."""
    other = copy.copy(task)
    other.knowledge = knowledge
    return other


def _observation_size(task: AttackTask) -> int:
    return int(task_spaces(task)[0].shape[0])
