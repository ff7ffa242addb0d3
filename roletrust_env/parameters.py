"""Constructors that refuse parameters they do not have, and suggest the name that was meant."""

import dataclasses
import functools
import inspect
from collections.abc import Callable, Iterable
from typing import Any, TypeVar, dataclass_transform, overload

import pydantic
import pydantic.dataclasses

from roletrust_env.errors import suggest

Class = TypeVar("Class", bound=type)


class UnknownParameterError(TypeError):
    """A constructor was called with a parameter that it does not have."""


def unknown_parameter(owner: str, name: str, known: Iterable[str]) -> str:
    """Return the error message for a parameter that does not exist.

    Args:
        owner: Function or class that was called, in words.
        name: Unknown parameter.
        known: Parameters that exist.

    Example:
        >>> unknown_parameter("RoleTrust", "lamb", ["lam", "initial"])
        "RoleTrust has no parameter 'lamb'; did you mean 'lam'? It takes lam, initial"
        >>> unknown_parameter("Median", "cut", [])
        "Median has no parameter 'cut'. It takes none"
    """
    return f"{owner} has no parameter {name!r}{suggest(name, known, 'It takes')}"


def refuse_unknown(cls: Class) -> Class:
    """Make the constructor of a class refuse parameters that do not exist, and suggest those that do.

    This class decorator suits every class whose signature names all parameters, such as a standard dataclass. It goes
    above the decorator that makes the constructor. The error is an `UnknownParameterError`, which is a `TypeError`.

    Example:
        >>> @refuse_unknown
        ... @dataclasses.dataclass
        ... class Box:
        ...     size: float = 0.0
        >>> Box(sise=1.0)
        Traceback (most recent call last):
            ...
        roletrust_env.parameters.UnknownParameterError: Box has no parameter 'sise'; did you mean 'size'? It takes size
    """
    known = list(inspect.signature(cls).parameters)
    construct = cls.__init__  # type: ignore[misc]  # the constructor of instances

    @functools.wraps(construct)
    def __init__(self: Any, *args: Any, **kwargs: Any) -> None:  # noqa: N807
        for name in kwargs:
            if name not in known:
                raise UnknownParameterError(unknown_parameter(type(self).__name__, name, known))
        construct(self, *args, **kwargs)

    cls.__init__ = __init__  # type: ignore[misc]
    return cls


@overload
def checked_dataclass(cls: Class, /) -> Class: ...


@overload
def checked_dataclass(*, config: pydantic.ConfigDict) -> Callable[[Class], Class]: ...


@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field, pydantic.Field))
def checked_dataclass(cls: Any = None, /, *, config: pydantic.ConfigDict | None = None) -> Any:
    """Make a frozen dataclass of pydantic whose constructor refuses values and parameters that do not belong.

    A value that its type does not allow raises a `pydantic.ValidationError`, and a parameter that does not exist an
    `UnknownParameterError`, see `refuse_unknown`.

    Args:
        cls: Class with annotated fields.
        config: Further configuration of pydantic, added to that of the base classes.
    """

    def decorate(cls: Any) -> Any:
        joined = {**getattr(cls, "__pydantic_config__", {}), **(config or {}), "extra": "forbid"}
        return refuse_unknown(pydantic.dataclasses.dataclass(frozen=True, config=joined)(cls))  # type: ignore[call-overload]

    return decorate if cls is None else decorate(cls)
