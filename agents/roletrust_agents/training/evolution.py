"""Evolution of the network of a coalition: diagonal CMA-ES on whole games, many candidates in one batch.

All candidates of a generation meet the same random numbers, so their scores compare.
"""

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from roletrust_agents.training.coalition_training import CoalitionTraining, Floats
from roletrust_agents.training.settings import EvolutionSettings
from roletrust_env.game.attack_task import AttackTask


class Evolution(CoalitionTraining):
    """An evolution in progress: separable CMA-ES (Ros and Hansen, 2008) as the package `cma` has it.

    Its state follows from the seed and the scores so far, so a run continues from these.

    Args:
        tasks: See `CoalitionTraining`, as for the other arguments.
        settings: Settings.
        seed: Random seed.
        budget: Number of rounds.
        known: Weights of known networks.

    Attributes:
        scores: Scores of each generation so far, shape (population,) each.
    """

    def __init__(
        self,
        tasks: Sequence[AttackTask],
        settings: EvolutionSettings,
        seed: int,
        budget: int,
        known: Sequence[Floats] = (),
    ) -> None:
        super().__init__(tasks, settings, seed, budget, known)
        self.settings = settings
        self.scores: list[Floats] = []
        self._strategy = _strategy(self._first, settings, (seed, 0))

    @property
    def weights(self) -> Floats:
        """The mean of the generation. See `CoalitionTraining.weights`."""
        mean: Floats = np.asarray(self._strategy.mean)
        return mean

    def step(self) -> None:
        """Play a generation. See `CoalitionTraining.step`."""
        settings, points = self.settings, self._strategy.ask()
        networks, tasks = self.networks(np.asarray(points)), [self.tasks[k] for k in self.turn]
        played = [self.play(task, networks, settings.games, self.steps) for task in tasks]
        self.rounds += settings.step_games * len(tasks) * self.length
        self._learn(points, np.mean(played, axis=(0, 2)))

    def state(self) -> bytes:
        """Return the scores. See `CoalitionTraining.state`."""
        return np.stack(self.scores).tobytes()

    def restore(self, state: bytes) -> None:
        """Repeat all generations by their scores. See `CoalitionTraining.restore`."""
        for scores in np.frombuffer(state).reshape(-1, self.settings.population):
            self._learn(self._strategy.ask(), scores)

    def _learn(self, points: list[Floats], scores: Floats) -> None:
        self.scores.append(scores)
        self._strategy.tell(points, (-scores).tolist())
        self.steps += 1
        if self._strategy.stop():  # it has converged: begin again from there, as wide as at first
            self._strategy = _strategy(np.array(self._strategy.mean), self.settings, (self.seed, self.steps))


def _strategy(start: Floats, settings: EvolutionSettings, seed: tuple[int, int]) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns about missing plots
        import cma  # type: ignore[import-untyped]
    random = np.random.default_rng(seed)  # not the global one, which others draw from, too
    options = {
        "CMA_diagonal": True,
        "popsize": settings.population,
        "randn": lambda rows, size: random.standard_normal((rows, size)),
        "seed": np.nan,
        "verbose": -9,
    }
    return cma.CMAEvolutionStrategy(start, settings.spread, options)
