"""What the core needs to know of the array library that its inputs come from."""

from types import ModuleType
from typing import Any, TypeAlias

import numpy as np
from array_api_compat import array_namespace

Array: TypeAlias = Any
"""A NumPy array or a torch tensor. Axis 0 is the rater, axis 1 the provider, every further axis is batch."""


_NUMPY = (np.ndarray, np.generic)


def namespace(array: Array) -> ModuleType:
    """Return the array namespace of `array`, which the same lines of code run on.

    Args:
        array: a NumPy array or scalar, or an array of any library that array-api-compat knows (torch, ...).

    Returns:
        `numpy` itself (NumPy 2 follows the standard, and a wrapper would double the time of a small game), or the
        namespace that array-api-compat gives.
    """
    return np if isinstance(array, _NUMPY) else array_namespace(array)
