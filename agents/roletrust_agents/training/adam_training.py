"""Trainings of a coalition by Adam: what gradients through the game and evolution strategies have in common."""

import io
from typing import ClassVar

from roletrust_agents.training.adam import Adam
from roletrust_agents.training.coalition_training import CoalitionTraining, Floats
from roletrust_agents.training.settings import CoalitionSettingsT


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
        torch.save({**{name: getattr(self, name) for name in self._counts}, **self._adam.state()}, file)
        return file.getvalue()

    def restore(self, state: bytes) -> None:
        """See `CoalitionTraining.restore`. Only tensors and numbers are read, and no code runs."""
        import torch

        saved = torch.load(io.BytesIO(state), weights_only=True)
        for name in self._counts:
            setattr(self, name, saved[name])
        self._adam.restore(saved)
