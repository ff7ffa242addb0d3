"""A learner of Stable-Baselines3 as a rung of the ladder: it learns now, for the budget that all have."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from agents.ladder.known import Mind
from agents.ladder.rungs import Arguments, Attempt, Counter, Tell, UnsuitableError
from experiments.training.settings import Algo
from roletrust_env.game.attack import make_task

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

_GAMES = 32
"""That are played as one batch: a small budget leaves time for many updates of few games, and not for few of many."""


@dataclass(frozen=True)
class Learner:
    """Learns from what its agents see in life, and plays what it has learned at the end, without exploring.

    Attributes:
        algo: how it learns.
        name: in tables.
    """

    algo: Algo
    name: str = "PPO"

    def attack(self, arguments: Arguments, budget: int, seed: int, tell: Tell) -> Attempt:
        """See `Rung.attack`."""
        from experiments.training.experience import StaggeredGames
        from experiments.training.learners import make_model, network_of, normalising_rounds
        from experiments.training.settings import make_settings

        task = make_task(**arguments, like=np.zeros((), np.float32))
        settings = make_settings("", self.algo, {"games": _GAMES})
        used = Counter(tell)
        used.count(normalising_rounds(task))
        model: BaseAlgorithm = make_model(self.algo, settings, StaggeredGames(task, settings.games), seed)
        kept: Any = settings
        rollout = settings.games * getattr(kept, "n_steps", 1)
        steps = (budget - used.rounds) // rollout * rollout
        if steps < 1:
            raise UnsuitableError(f"the budget of {budget} rounds is too small for {self.name}")
        model.learn(steps)
        used.count(steps)
        return Attempt(Mind(network_of(model), "black_box"), used.rounds, f"{self.name} in {steps} rounds")
