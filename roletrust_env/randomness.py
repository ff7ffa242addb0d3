"""Random numbers, drawn outside the pure core and handed to it."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from roletrust_env.arrays import Array


class Random:
    """A source of random arrays, for NumPy or for torch.

    Args:
        generator: a `numpy.random.Generator` or a `torch.Generator`, whose device decides where arrays are made.
        dtype: the dtype of the numbers, of the generator's library; None is its default.

    Raises:
        ValueError: the generator is neither of the two. `Game.random(seed)` makes one that fits a game.
    """

    def __init__(self, generator: Any, dtype: Any = None) -> None:
        self._numpy = isinstance(generator, np.random.Generator)
        if not self._numpy and not hasattr(generator, "device"):
            raise ValueError(f"generator is {generator!r}; it must be a numpy.random.Generator or a torch.Generator")
        self.generator = generator
        self.dtype: Any = np.float64 if self._numpy and dtype is None else dtype

    def uniform(self, shape: Sequence[int]) -> Array:
        """Numbers from U[0, 1)."""
        if self._numpy:
            return self.generator.random(tuple(shape), dtype=self.dtype)
        import torch

        return torch.rand(tuple(shape), generator=self.generator, dtype=self.dtype, device=self.generator.device)

    def normal(self, shape: Sequence[int]) -> Array:
        """Numbers from N(0, 1)."""
        if self._numpy:
            return self.generator.standard_normal(tuple(shape), dtype=self.dtype)
        import torch

        return torch.randn(tuple(shape), generator=self.generator, dtype=self.dtype, device=self.generator.device)
