"""Random numbers, drawn outside the pure core and handed to it."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from roletrust_env.arrays import Array


class Random:
    """A source of random arrays, for NumPy or for torch.

    Args:
        generator: a `numpy.random.Generator` or a `torch.Generator`, whose device decides where arrays are made.
        dtype: the dtype of the numbers, of the generator's library.
    """

    def __init__(self, generator: Any, dtype: Any = np.float64) -> None:
        self.generator = generator
        self.dtype = dtype
        self._numpy = isinstance(generator, np.random.Generator)

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
