"""Learners of Stable-Baselines3 as search methods with a budget of rounds."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from roletrust_agents.learned.coalition_attacker import NetworkAttacker
from roletrust_agents.training.settings import Algo
from roletrust_env.evaluation.measurement import TaskArguments, check_games_memory
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError
from roletrust_env.game.make_task import make_task

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

_GAMES = 32
"""Maximum number of games in a batch: a small budget is better spent on many updates with few
games."""


@dataclass(frozen=True)
class LearnerSearch:
    """A learner that observes as a black-box attacker, and plays its final network without
    exploration.

    Attributes:
        algo: Algorithm of the learner.
        name: Name in tables.
    """

    algo: Algo
    name: str = "PPO"

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        from roletrust_agents.training.experience import StaggeredGames
        from roletrust_agents.training.learners import make_model, network_of, normalising_rounds
        from roletrust_agents.training.settings import learner_settings

        task = make_task(**arguments, like=np.zeros((), np.float32))
        settings = learner_settings("", self.algo, {})
        settings = settings.model_copy(update={"games": min(settings.games, _GAMES)})
        check_games_memory(task, settings.games)
        budget.spend(normalising_rounds(task))
        model: BaseAlgorithm = make_model(
            self.algo, settings, StaggeredGames(task, settings.games), seed
        )
        options: Any = settings
        rollout = settings.games * getattr(options, "n_steps", 1)
        steps = budget.left // rollout * rollout
        if steps < 1:
            raise UnsuitableError(
                f"the budget of {budget.rounds} rounds is too small for {self.name}"
            )
        model.learn(steps)
        budget.spend(steps)
        return SearchResult(
            NetworkAttacker(network_of(model), "black_box"),
            budget.spent,
            f"{self.name} in {steps} rounds",
        )


def ppo() -> LearnerSearch:
    """Train by proximal policy optimization (PPO) of Stable-Baselines3."""
    return LearnerSearch("ppo", "PPO")


def recurrent_ppo() -> LearnerSearch:
    """Train by PPO with a memory, of sb3-contrib."""
    return LearnerSearch("recurrent-ppo", "recurrent PPO")


def sac() -> LearnerSearch:
    """Train by soft actor-critic (SAC) of Stable-Baselines3."""
    return LearnerSearch("sac", "SAC")
