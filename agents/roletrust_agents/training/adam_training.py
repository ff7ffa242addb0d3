"""Trainings of a coalition by Adam: the optimiser, the loop, and an evolution strategy."""

import io
from typing import Any, ClassVar

import numpy as np

from roletrust_agents.training.coalition_training import CoalitionTraining, Floats
from roletrust_agents.training.settings import CoalitionSettingsT, StrategySettings
from roletrust_env.arrays import mean_places


class Adam:
    """Weights that Adam moves (Kingma and Ba, 2015).

    Args:
        start: Weights at the beginning, shape (n,).

    Attributes:
        vector: The weights as a tensor of torch with a gradient, shape (n,).
        optimiser: The optimiser of torch.
    """

    def __init__(self, start: Floats) -> None:
        import torch

        self.vector: Any = torch.tensor(start, dtype=torch.float32, requires_grad=True)
        self.optimiser: Any = torch.optim.Adam([self.vector])

    @property
    def weights(self) -> Floats:
        """The weights in NumPy, shape (n,)."""
        weights: Floats = self.vector.detach().numpy().astype(np.float64)
        return weights

    def climb(self, slope: Floats, learning_rate: float) -> None:
        """Take a step up a slope, shape (n,)."""
        import torch

        self.vector.grad = torch.tensor(-slope, dtype=torch.float32)
        self.descend(learning_rate)

    def descend(self, learning_rate: float) -> None:
        """Take a step against the gradient that the weights have."""
        self.optimiser.param_groups[0]["lr"] = learning_rate
        self.optimiser.step()

    def state(self) -> dict[str, Any]:
        """Return what `restore` needs."""
        return {"weights": self.vector.detach(), "adam": self.optimiser.state_dict()}

    def restore(self, saved: dict[str, Any]) -> None:
        """Continue from the output of `state`."""
        import torch

        with torch.no_grad():
            self.vector.copy_(saved["weights"])
        self.optimiser.load_state_dict(saved["adam"])


class AdamTraining(CoalitionTraining[CoalitionSettingsT]):
    """Training that moves all weights by Adam from the best start.

    It validates its start, too. For the arguments see `CoalitionTraining`.
    """

    _counts: ClassVar[tuple[str, ...]] = ("steps",)
    """Attributes that a checkpoint holds besides weights and the state of Adam."""

    def _begin(self) -> None:
        self._adam = Adam(self._starts[0])
        if self.best is None:
            self.validate()

    @property
    def weights(self) -> Floats:
        """See `CoalitionTraining.weights`."""
        return self._adam.weights

    def state(self) -> bytes:
        """Return the weights and the state of Adam. See `CoalitionTraining.state`."""
        import torch

        file = io.BytesIO()
        torch.save(
            {**{name: getattr(self, name) for name in self._counts}, **self._adam.state()}, file
        )
        return file.getvalue()

    def restore(self, state: bytes) -> None:
        """See `CoalitionTraining.restore`. Only tensors and numbers are read, and no code runs."""
        import torch

        saved = torch.load(io.BytesIO(state), weights_only=True)
        for name in self._counts:
            setattr(self, name, saved[name])
        self._adam.restore(saved)


_LAST_RATE = 0.1
"""Learning rate at the end, as a share of the initial one."""


class EvolutionStrategy(AdamTraining[StrategySettings]):
    """An evolution strategy in progress, after Salimans, Ho, Chen, Sidor and Sutskever (2017).

    A step plays n / 2 pairs of candidates w + s e_k and w - s e_k with e_k ~ N(0, I), all in the
    same games. With the ranks of the n scores, scaled to [-1/2, 1/2] and called r, the slope at the
    weights w is

        g = 1 / (n s) sum_k (r(w + s e_k) - r(w - s e_k)) e_k,

    and Adam follows it. It needs no slope of the game, so trust may jump. With few rounds it
    improves a network further than CMA-ES does (`Evolution`), which has to learn a variance for
    each weight, too.

    For the arguments see `CoalitionTraining`. The learning rate falls linearly to a tenth.
    """

    def step(self) -> None:
        """Play the candidates of a step, and follow the slope. See `CoalitionTraining.step`."""
        settings = self.settings
        noise = np.random.default_rng((self.seed, self.steps)).standard_normal(
            (settings.pairs, self.architecture.size)
        )
        moves = settings.spread * np.concatenate([noise, -noise])
        networks, tasks = self.networks(self.weights + moves), [self.tasks[k] for k in self.turn]
        rate = falling_rate(settings.learning_rate, self.done)
        self.rounds += self.step_games * len(tasks) * self.length
        played = [self.play(task, networks, settings.games, self.steps) for task in tasks]
        self._adam.climb(slope_of(np.mean(played, axis=(0, 2)), noise, settings.spread), rate)
        self.steps += 1


def falling_rate(first: float, done: float) -> float:
    """Return the learning rate when a share of the training is done: it falls linearly to a tenth
    of the first.
    """
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
