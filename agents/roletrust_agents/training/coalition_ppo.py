"""PPO for a coalition as one mind, as a search method with a budget of rounds."""

import warnings
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.deep_set import UNITS, DeepSet
from roletrust_agents.training.coalition_methods import best_universal, choice_rounds, universal_coalitions
from roletrust_agents.training.settings import Start
from roletrust_env.evaluation.attacked_games import SEARCHED, TaskArguments, mean_rewards
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError
from roletrust_env.game.coalition_task import CoalitionTask
from roletrust_env.game.make_task import make_task
from roletrust_env.parameters import refuse_unknown

_CRITIC_UNITS = 24
_BATCHES = 4  # of a rollout
_GAMES, _FEWEST_GAMES, _UPDATES = 32, 4, 60
"""Number of games of a rollout, the fewest, and the number of updates that is worth fewer games."""
_COMPARED, _VALIDATION, _MOST_VALIDATION_GAMES = 5, 8, 200
"""Number of networks that are compared, share of the budget for it (1 of 8), and most games for each."""
_LEAST = 40
"""Number of whole games that a budget must have."""


@refuse_unknown
@dataclass(frozen=True)
class CoalitionPpo:
    """PPO (Schulman et al., 2017) on the network of a coalition, with noise that is held over an episode.

    The coalition observes and decides as in a task with `observation="coalition"`, and the network is a `DeepSet`. Each
    game keeps its noise over the whole episode, see `roletrust_agents.training.coalition_policy`. The result is the
    best of some networks of the training, in the same games for all, and plays without noise. The universal coalition
    at the start is one of them, because a training can end below its start. After a random start, only networks of the
    second half are compared.

    The network does not learn when to call identities in reserve: a universal coalition does so as before, and a random
    network calls none.

    Attributes:
        start: `"universal"` begins with the best of the universal coalitions, `"random"` with a random network.
        learning_rate: Initial learning rate, which falls linearly to a tenth of it; None is 0.003 for a universal
            coalition and 0.01 for a random network.
        gamma: Discount factor.
        gae_lambda: Factor of generalised advantage estimation.
        n_epochs: Number of passes over a rollout.
        clip_range: Clip range of the ratio of probabilities.
        spread: Initial standard deviation of the actions, which lie in [-1, 1]; None is 0.2 for a universal coalition
            and 0.5 for a random network.
        name: Name in tables.
    """

    start: Start = "universal"
    learning_rate: float | None = None
    gamma: float = 0.95
    gae_lambda: float = 0.95
    n_epochs: int = 5
    clip_range: float = 0.3
    spread: float | None = None
    name: str = "coalition PPO"

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        from stable_baselines3 import PPO
        from stable_baselines3.common.utils import LinearSchedule

        from roletrust_agents.training.coalition_policy import (
            CoalitionPolicy,
            begin_with,
            deep_set_of,
            policy_arguments,
        )
        from roletrust_agents.training.experience import AfterUpdates, WholeGames

        task = _task(arguments, self.name)
        rounds = task.game.scenario.max_cycles
        universal = self.start == "universal"
        usual_rate, usual_spread = (0.003, 0.2) if universal else (0.01, 0.5)  # a good start is easily lost
        rate = usual_rate if self.learning_rate is None else self.learning_rate
        spread = usual_spread if self.spread is None else self.spread
        least = _LEAST * rounds + universal * choice_rounds(task)
        if budget.left < least:
            raise UnsuitableError(
                f"the budget of {budget.rounds} rounds is too small for {self.name}; give {least} or more"
            )
        first = universal_coalitions()[best_universal(task, budget, seed)] if universal else None
        plan = _Plan.of(budget.left // rounds, universal)
        rollout = plan.games * rounds
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the last batch may be smaller than the others
            model = PPO(
                CoalitionPolicy,
                WholeGames(task, plan.games, seed=seed),
                learning_rate=LinearSchedule(rate, 0.1 * rate, 1.0),
                n_steps=rounds,
                batch_size=rollout // _BATCHES,
                n_epochs=self.n_epochs,
                gamma=self.gamma,
                gae_lambda=self.gae_lambda,
                clip_range=self.clip_range,
                policy_kwargs=policy_arguments(task.coalition, UNITS, _CRITIC_UNITS, float(np.log(spread))),
                seed=seed,
                device="cpu",
            )
        policy: Any = model.policy
        if first is not None:
            begin_with(policy, first)
        scores: list[float] = []
        best: list[DeepSet] = []

        def compare(updates: int) -> None:
            if updates not in plan.compared:
                return
            network = deep_set_of(policy, first)
            reward = mean_rewards(task, CoalitionAttacker(network), (seed, 0), (1, plan.validation), SEARCHED)[0]
            budget.spend(plan.validation * rounds)
            scores.append(float(reward.mean()))
            if scores[-1] == max(scores):
                best[:] = [network]

        def updated(updates: int) -> None:
            budget.spend(rollout)
            compare(updates)

        compare(0)
        model.learn(plan.updates * rollout, callback=AfterUpdates(rollout, updated))
        return SearchResult(CoalitionAttacker(best[0]), budget.spent, f"{self.name} in {budget.spent} rounds")


class _Plan(NamedTuple):
    """How a budget is spent.

    Attributes:
        games: Number of games of a rollout.
        updates: Number of rollouts.
        compared: Numbers of updates after which a network is compared with the best one; 0 is the start.
        validation: Number of games of a comparison.
    """

    games: int
    updates: int
    compared: frozenset[int]
    validation: int

    @classmethod
    def of(cls, whole: int, universal: bool) -> Self:
        """Return the plan for a number of games, with a universal coalition as the start or a random network."""
        validation = min(_MOST_VALIDATION_GAMES, whole // (_VALIDATION * _COMPARED))
        left = whole - validation * _COMPARED
        games = min(_GAMES, max(_FEWEST_GAMES, left // _UPDATES))
        updates = left // games
        begin = 0.0 if universal else 0.5
        compared = frozenset(round(updates * (begin + (1 - begin) * k / (_COMPARED - 1))) for k in range(_COMPARED))
        return cls(games, updates, compared, validation)


def _task(arguments: TaskArguments, name: str) -> CoalitionTask:
    """Return the task of the coalition as one mind."""
    knowledge = arguments.get("knowledge", "black_box")
    if knowledge != "black_box":
        raise UnsuitableError(f"{name} is for black_box knowledge, and the task has {knowledge}")
    task = make_task(**{**arguments, "observation": "coalition"}, like=np.zeros((), np.float32))
    assert isinstance(task, CoalitionTask)
    return task
