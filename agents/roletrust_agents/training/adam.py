"""Adam on a vector of weights: one copy for gradients through a game and for slopes that are estimated."""

from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


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
