"""Trainings of a coalition by Adam: what gradients through the game and evolution strategies have in common."""

import io
from typing import Any, ClassVar

import numpy as np

from roletrust_agents.training.coalition_training import CoalitionTraining, Floats
from roletrust_agents.training.settings import CoalitionSettingsT


class AdamTraining(CoalitionTraining[CoalitionSettingsT]):
    """Training that moves all weights by Adam (Kingma and Ba, 2015) from the best start.

    It validates its start, too. For the arguments see `CoalitionTraining`.
    """

    _counts: ClassVar[tuple[str, ...]] = ("steps",)
    """Attributes that a checkpoint holds besides weights and the state of Adam."""

    def _begin(self) -> None:
        import torch

        self._vector: Any = torch.tensor(self._starts[0], dtype=torch.float32, requires_grad=True)
        self._adam: Any = torch.optim.Adam([self._vector])
        if self.best is None:
            self.validate()

    @property
    def weights(self) -> Floats:
        """See `CoalitionTraining.weights`."""
        weights: Floats = self._vector.detach().numpy().astype(np.float64)
        return weights

    def _follow(self, learning_rate: float) -> None:
        """Take a step of Adam against the gradient that the weights have."""
        self._adam.param_groups[0]["lr"] = learning_rate
        self._adam.step()

    def state(self) -> bytes:
        """Return the weights and the state of Adam. See `CoalitionTraining.state`."""
        import torch

        file = io.BytesIO()
        counts = {name: getattr(self, name) for name in self._counts}
        torch.save({**counts, "weights": self._vector.detach(), "adam": self._adam.state_dict()}, file)
        return file.getvalue()

    def restore(self, state: bytes) -> None:
        """See `CoalitionTraining.restore`. Only tensors and numbers are read, and no code runs."""
        import torch

        saved = torch.load(io.BytesIO(state), weights_only=True)
        for name in self._counts:
            setattr(self, name, saved[name])
        with torch.no_grad():
            self._vector.copy_(saved["weights"])
        self._adam.load_state_dict(saved["adam"])
