"""What the core needs to know of the array library that its inputs come from."""

from types import ModuleType
from typing import Any, TypeAlias

import numpy as np
from array_api_compat import array_namespace

Array: TypeAlias = Any
"""A NumPy array or a torch tensor. Axis 0 is the rater, axis 1 the provider, every further axis is batch."""


_NUMPY = (np.ndarray, np.generic)
_NAMESPACES: dict[type, ModuleType] = {}
"""By type of array, as far as they were asked for: a compiler can see through a look-up, but not through a cache."""


def namespace(array: Array) -> ModuleType:
    """Return the array namespace of `array`, which the same lines of code run on.

    Args:
        array: a NumPy array or scalar, or an array of any library that array-api-compat knows (torch, ...).

    Returns:
        `numpy` itself (NumPy 2 follows the standard, and a wrapper would double the time of a small game), or the
        namespace that array-api-compat gives.
    """
    if isinstance(array, _NUMPY):
        return np
    kind = type(array)
    if kind not in _NAMESPACES:
        _NAMESPACES[kind] = array_namespace(array)
    return _NAMESPACES[kind]
