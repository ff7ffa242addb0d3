"""Evolution strategy for the network of a coalition: the slope of the score, estimated from pairs of candidates."""

import numpy as np

from roletrust_agents.training.adam_training import AdamTraining
from roletrust_agents.training.coalition_training import Floats
from roletrust_agents.training.settings import StrategySettings
from roletrust_env.arrays import mean_places

_LAST_RATE = 0.1
"""Learning rate at the end, as a share of the initial one."""


class EvolutionStrategy(AdamTraining[StrategySettings]):
    """An evolution strategy in progress, after Salimans, Ho, Chen, Sidor and Sutskever (2017).

    A step plays n / 2 pairs of candidates w + s e_k and w - s e_k with e_k ~ N(0, I), all in the same games. With the
    ranks of the n scores, scaled to [-1/2, 1/2] and called r, the slope at the weights w is

        g = 1 / (n s) sum_k (r(w + s e_k) - r(w - s e_k)) e_k,

    and Adam follows it. It needs no slope of the game, so trust may jump. With few rounds it improves a network further
    than CMA-ES does (`Evolution`), which has to learn a variance for each weight, too.

    For the arguments see `CoalitionTraining`. The learning rate falls linearly to a tenth.
    """

    def step(self) -> None:
        """Play the candidates of a step, and follow the slope. See `CoalitionTraining.step`."""
        settings = self.settings
        noise = np.random.default_rng((self.seed, self.steps)).standard_normal((settings.pairs, self.architecture.size))
        moves = settings.spread * np.concatenate([noise, -noise])
        networks, tasks = self.networks(self.weights + moves), [self.tasks[k] for k in self.turn]
        rate = falling_rate(settings.learning_rate, self.done)
        self.rounds += self.step_games * len(tasks) * self.length
        played = [self.play(task, networks, settings.games, self.steps) for task in tasks]
        self._adam.climb(slope_of(np.mean(played, axis=(0, 2)), noise, settings.spread), rate)
        self.steps += 1


def falling_rate(first: float, done: float) -> float:
    """Return the learning rate when a share of the training is done: it falls linearly to a tenth of the first."""
    return first * (1 - (1 - _LAST_RATE) * done)


def slope_of(scores: Floats, noise: Floats, spread: float) -> Floats:
    """Return the slope at the weights, shape (m,).

    Args:
        scores: Scores of the candidates, the positive moves before the negative ones, shape (2 K,).
        noise: Directions of the pairs, shape (K, m).
        spread: Length of the moves in each direction.
    """
    ranks = 0.5 - mean_places(scores) / (len(scores) - 1)  # equal scores have no slope
    up, down = np.split(ranks, 2)
    slope: Floats = (up - down) @ noise / (len(scores) * spread)
    return slope
