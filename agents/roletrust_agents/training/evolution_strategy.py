"""Evolution strategy of the network of a coalition: a slope from pairs of candidates, and Adam."""

import io
from typing import Any

import numpy as np

from roletrust_agents.training.coalition_training import CoalitionTraining, Floats
from roletrust_agents.training.settings import StrategySettings
from roletrust_env.arrays import mean_places

_LAST_RATE = 0.1
"""Learning rate at the end, as a share of the initial one."""


class EvolutionStrategy(CoalitionTraining[StrategySettings]):
    """An evolution strategy in progress, after Salimans, Ho, Chen, Sidor and Sutskever (2017).

    A step plays n / 2 pairs of candidates w + s e_k and w - s e_k with e_k ~ N(0, I), all in the
    same games. With the ranks of the n scores, scaled to [-1/2, 1/2] and called r, the slope at the
    weights w is

        g = 1 / (n s) sum_k (r(w + s e_k) - r(w - s e_k)) e_k,

    and Adam (Kingma and Ba, 2015) follows it, from the best start. It needs no slope of the game,
    so trust may jump. With few rounds it improves a network further than CMA-ES does (`Evolution`),
    which has to learn a variance for each weight, too.

    It validates its start, too. For the arguments see `CoalitionTraining`. The learning rate falls
    linearly to a tenth.
    """

    def _begin(self) -> None:
        import torch

        self._vector = torch.tensor(self._starts[0], dtype=torch.float32, requires_grad=True)
        self._adam: Any = torch.optim.Adam([self._vector])
        if self.best is None:
            self.validate()

    @property
    def weights(self) -> Floats:
        """See `CoalitionTraining.weights`."""
        weights: Floats = self._vector.detach().numpy().astype(np.float64)
        return weights

    def step(self) -> None:
        """Play the candidates of a step, and follow the slope. See `CoalitionTraining.step`."""
        import torch

        settings = self.settings
        noise = np.random.default_rng((self.seed, self.steps)).standard_normal(
            (settings.pairs, self.architecture.size)
        )
        moves = settings.spread * np.concatenate([noise, -noise])
        networks, tasks = self.networks(self.weights + moves), [self.tasks[k] for k in self.turn]
        rate = settings.learning_rate * (1 - (1 - _LAST_RATE) * self.done)
        self.rounds += self.step_games * len(tasks) * self.length
        played = [self.play(task, networks, settings.games, self.steps) for task in tasks]
        slope = slope_of(np.mean(played, axis=(0, 2)), noise, settings.spread)
        self._vector.grad = torch.tensor(-slope, dtype=torch.float32)
        self._adam.param_groups[0]["lr"] = rate
        self._adam.step()
        self.steps += 1

    def state(self) -> bytes:
        """Return the number of steps, the weights and the state of Adam. See
        `CoalitionTraining.state`.
        """
        import torch

        file = io.BytesIO()
        adam = self._adam.state_dict()
        torch.save({"steps": self.steps, "weights": self._vector.detach(), "adam": adam}, file)
        return file.getvalue()

    def restore(self, state: bytes) -> None:
        """See `CoalitionTraining.restore`. Only tensors and numbers are read, and no code runs."""
        import torch

        saved = torch.load(io.BytesIO(state), weights_only=True)
        self.steps = saved["steps"]
        with torch.no_grad():
            self._vector.copy_(saved["weights"])
        self._adam.load_state_dict(saved["adam"])


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
