"""Objects that do not change once they are made, so that nothing derived from them goes stale."""

from typing import Any

import numpy as np


class _Freezing(type):
    """Metaclass that freezes an object when its constructor has returned."""

    def __call__(cls, *args: Any, **kwargs: Any) -> Any:
        made = super().__call__(*args, **kwargs)
        made.__setstate__(made.__dict__)
        return made


class Frozen(metaclass=_Freezing):
    """Base of a class whose public attributes refuse assignment, and whose arrays are read-only.

    Private attributes may be set, for example by a cache.

    Example:
        >>> class Rules(Frozen):
        ...     def __init__(self, weight: float) -> None:
        ...         self.weight = weight
        >>> rules = Rules(0.5)
        >>> rules.weight = 0.7
        Traceback (most recent call last):
            ...
        AttributeError: weight of Rules cannot be set; make a new object
    """

    _frozen = False

    def __setattr__(self, name: str, value: Any) -> None:
        """Set an attribute.

        Raises:
            AttributeError: The object is made, and the attribute is public.
        """
        if self._frozen and not name.startswith("_"):
            raise AttributeError(
                f"{name} of {type(self).__name__} cannot be set; make a new object"
            )
        object.__setattr__(self, name, value)

    def __delattr__(self, name: str) -> None:
        """Refuse to delete an attribute, see `__setattr__`."""
        if self._frozen:
            raise AttributeError(f"{name} of {type(self).__name__} cannot be deleted")
        object.__delattr__(self, name)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take the attributes of a new object, a copy or a pickle, and freeze it."""
        self.__dict__.update(state, _frozen=True)
        for value in self.__dict__.values():
            for array in value if isinstance(value, tuple) else (value,):
                if isinstance(array, np.ndarray):
                    array.flags.writeable = False
