"""Parameters of attacks and trust models: checks, ranges, and values to search."""

import dataclasses
import functools
import inspect
import operator
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import inf
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    TypeVar,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
    overload,
)

import numpy as np
import pydantic
import pydantic.dataclasses
from pydantic import AfterValidator, ValidationError, ValidatorFunctionWrapHandler, WrapValidator
from pydantic_core import PydanticCustomError

from roletrust_env.errors import short, suggest


@dataclass(frozen=True)
class _Allowed(AfterValidator):
    """Validator with a description of the values that it allows."""

    allowed: str


def _within(allowed: str, holds: Callable[[float], bool]) -> _Allowed:
    """Return a validator whose error message gives the allowed range. It also refuses NaN."""

    def check(value: float) -> float:
        if not holds(value):
            raise PydanticCustomError("range", "it must lie in {allowed}", {"allowed": allowed})
        return value

    return _Allowed(check, allowed)


@dataclass(frozen=True)
class SearchRange:
    """Annotation of a number: the range, both ends included, in which searches look for its best
    value.

    Raises:
        ValueError: The range is empty, or an end is not finite.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        if not -inf < self.low <= self.high < inf:
            raise ValueError(
                f"{self} is not a range; low must not be above high, and both must be finite"
            )


class NotSearched:
    """Annotation of a parameter: searches leave it at its default, whatever its range."""


class Victims:
    """Annotation of a tuple of provider indices: searches choose how many honest providers it
    holds.
    """


class Identities:
    """Annotation of a number of identities in reserve: searches try from 1 to the number that the
    attacker has.
    """


class Accomplices:
    """Annotation of a tuple of provider indices: searches and the command line fill in the
    attacker's own providers.
    """


class GameLength:
    """Annotation of a number of rounds: searches and the command line fill in the length of the
    game.
    """


def _number_or_range(allowed: str, holds: Callable[[float], bool]) -> WrapValidator:
    """Return a validator of a number, or of a range from which a number is drawn."""

    def check(value: Any, read: ValidatorFunctionWrapHandler) -> Any:
        try:
            parsed = read(value)
        except ValidationError:
            parsed = None
        low, high = parsed if isinstance(parsed, tuple) else (parsed, parsed)
        if parsed is None or not (holds(low) and holds(high) and low <= high):
            message = "it must be a number in {allowed}, or a range (low, high) of two such numbers"
            raise PydanticCustomError("number_or_range", message, {"allowed": allowed})
        return parsed

    return WrapValidator(check)


Share = Annotated[float, _within("[0, 1]", lambda x: 0 <= x <= 1), SearchRange(0, 1)]
"""Number in [0, 1], such as a trust, a quality, a rating or a probability."""

Lam = Annotated[float, _within("[0.5, 1)", lambda x: 0.5 <= x < 1)]
"""Weight of the newest round in every trust."""

Inside = Annotated[float, _within("[0.001, 0.999]", lambda x: 0.001 <= x <= 0.999)]
"""Share strictly between 0 and 1, far enough from both that rounding does not matter."""

Ridge = Annotated[float, _within("[0.001, 1e6]", lambda x: 0.001 <= x <= 1e6)]
"""Strength with which a regression is drawn to its prior. With a smaller one, rounding would
decide."""

Factor = Annotated[float, _within("(0, 1]", lambda x: 0 < x <= 1)]
"""Factor of a geometric decay."""

Weighting = Annotated[float, _within("[0, 1000]", lambda x: 0 <= x <= 1000)]
"""Weight, or number of ratings that a weight compares with. With a larger one, rounding would
decide."""

LessThanHalf = Annotated[float, _within("[0, 0.5)", lambda x: 0 <= x < 0.5)]
"""Share that is cut off at both ends."""

Tail = Annotated[float, _within("[1e-6, 0.5)", lambda x: 1e-6 <= x < 0.5)]
"""Probability that is cut off at either end of a distribution."""

Power = Annotated[float, _within("[0, 8]", lambda x: 0 <= x <= 8)]
"""Exponent of a share, for example of trust in a weight. With 0 all weights are equal."""

Exponent = Annotated[float, _within("[1, 8]", lambda x: 1 <= x <= 8)]
"""Exponent of the growth of a number of rounds."""

Amount = Annotated[float, _within("[0, 1e6]", lambda x: 0 <= x <= 1e6)]
"""Number without a natural bound. With a larger one, float32 would overflow."""

PositiveAmount = Annotated[float, _within("[1e-6, 1e6]", lambda x: 1e-6 <= x <= 1e6)]
"""Number above 0 without a natural bound. With a smaller one, float32 would divide by 0."""

ZeroOrAmount = Annotated[float, _within("{0} or [1e-6, 1e6]", lambda x: x == 0 or 1e-6 <= x <= 1e6)]
"""`PositiveAmount`, or 0 for the limit."""

Size = Annotated[int, pydantic.Field(ge=1, le=1000)]
"""Number of rows of a memory, or of steps of a computation. A larger one would not end, or not
fit."""

ShareOrRange = Annotated[
    float | tuple[float, float], _number_or_range("[0, 1]", lambda x: 0 <= x <= 1)
]
"""Share, or a range from which it is drawn."""

BiasOrRange = Annotated[
    float | tuple[float, float], _number_or_range("[-1, 1]", lambda x: -1 <= x <= 1)
]
"""Number added to a quality, or a range from which it is drawn."""

ScaleOrRange = Annotated[
    float | tuple[float, float], _number_or_range("[0, 1e6]", lambda x: 0 <= x <= 1e6)
]
"""Factor of a quality, or a range from which it is drawn."""


def whole_number(name: str, value: Any, least: int = 0) -> int:
    """Return a whole number, which may be one of NumPy, as one of Python.

    Args:
        name: What the number is, for the error message.
        value: Value to check.
        least: Least value that is allowed.

    Raises:
        ValueError: The value is not whole, is a truth value, or is less than `least`.
    """
    try:
        number = least - 1 if isinstance(value, bool) else operator.index(value)
    except (TypeError, ValueError):  # no number, or a tensor of many
        number = least - 1
    if number < least:
        raise ValueError(
            f"{name} is {short(repr(value))}; it must be a whole number, {least} or more"
        )
    return number


def check_instance(name: str, value: Any, kind: Any, allowed: str) -> None:
    """Refuse an object of another class.

    Args:
        name: What the object is, for the error message.
        value: Object to check.
        kind: Class that it must have, or a union of classes.
        allowed: What is allowed, in words.

    Raises:
        ValueError: The object is not an instance of `kind`.

    Example:
        >>> check_instance("task", 3, str, "a text")
        Traceback (most recent call last):
        ValueError: task must be a text, got 3
    """
    if not isinstance(value, kind):
        raise ValueError(f"{name} must be {allowed}, got {short(repr(value))}")


_TRUTH = pydantic.TypeAdapter(bool)


def truth_value(name: str, value: Any) -> bool:
    """Return what a user gave as True or False, by the rule of the parameters of models, suites and
    requests.

    Args:
        name: What the value is, for the error message.
        value: Truth value, one of NumPy, 0 or 1, or a word such as "yes" or "off".

    Raises:
        ValueError: The value is none of these.

    Example:
        >>> truth_value("repeats", "no")
        False
    """
    try:
        return _TRUTH.validate_python(value)
    except ValueError:
        raise ValueError(f"{name} is {short(repr(value))}; it must be true or false") from None


def plain(value: Any) -> Any:
    """Return a value as strict types take it: numbers of NumPy as those of Python, lists and ranges
    as tuples.

    Strict types of pydantic take no text for a number, no truth value and no 2.0 for an integer.

    Example:
        >>> plain([1, [2, "3"], range(2)])
        (1, (2, '3'), (0, 1))
    """
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, dict):
        return {name: plain(item) for name, item in value.items()}
    return tuple(map(plain, value)) if type(value) in (list, tuple, range) else value


def allowed(hint: Any) -> str:
    """Return the values that a type allows, in words.

    Example:
        >>> from pydantic import PositiveInt
        >>> [allowed(hint) for hint in (Lam, PositiveInt, Literal["power", "linear"], PositiveInt | None, float)]
        ['0.5 to below 1', 'whole number from 1', 'power or linear', 'whole number from 1, or None', 'number']
    """  # noqa: E501
    kind, *marks = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    if descriptions := [mark.allowed for mark in marks if isinstance(mark, _Allowed)]:
        return _in_words(descriptions[-1])
    if get_origin(kind) is Literal:
        return " or ".join(map(str, get_args(kind)))
    if get_origin(kind) in (Union, UnionType):
        return ", or ".join(map(allowed, get_args(kind)))
    if get_origin(kind) in (tuple, list):
        return f"several: {allowed(get_args(kind)[0])}"
    if kind in (int, float):
        bounds, number = (
            _in_words(_interval(marks, kind is int)),
            "whole number" if kind is int else "number",
        )
        return f"{number} {bounds}".rstrip() if kind is int else bounds or number
    return {bool: "True or False", str: "text", NoneType: "None"}.get(
        kind, getattr(kind, "__name__", str(kind))
    )


def _in_words(interval: str) -> str:
    """Return an interval such as `[0, inf)` in words, and any other text as it is."""
    match = re.fullmatch(r"([\[(])(.+), (.+)([\])])", interval)
    if match is None:
        return interval
    opening, low, high, closing = match.groups()
    ends = (
        [f"{'above ' if opening == '(' else '' if high != 'inf' else 'from '}{low}"]
        if low != "-inf"
        else []
    )
    ends += [f"{'below ' if closing == ')' else ''}{high}"] if high != "inf" else []
    return " to ".join(ends)


def _interval(marks: list[Any], whole: bool) -> str:
    """Return the interval between bounds such as pydantic's `Gt`, closed where possible; empty
    without bounds.
    """
    ends: dict[str, Any] = {}
    for bound in (part for mark in marks for part in (mark, *getattr(mark, "metadata", ()))):
        ends |= {
            name: getattr(bound, name) for name in ("gt", "ge", "lt", "le") if hasattr(bound, name)
        }
    if whole:
        ends |= {"ge": ends.pop("gt") + 1} if "gt" in ends else {}
        ends |= {"le": ends["lt"] - 1} if "lt" in ends else {}
    low = f"[{ends['ge']}" if "ge" in ends else f"({ends.get('gt', '-inf')}"
    high = f"{ends['le']}]" if "le" in ends else f"{ends.get('lt', 'inf')})"
    return f"{low}, {high}" if ends else ""


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


def refuse_unknown_parameters(cls: Class) -> Class:
    """Make the constructor of a class refuse parameters that do not exist, and suggest those that
    do.

    This class decorator suits every class whose signature names all parameters, such as a standard
    dataclass. It goes above the decorator that makes the constructor. The error is an
    `UnknownParameterError`, which is a `TypeError`.

    Example:
        >>> @refuse_unknown_parameters
        ... @dataclasses.dataclass
        ... class Box:
        ...     size: float = 0.0
        >>> Box(sise=1.0)
        Traceback (most recent call last):
            ...
        roletrust_env.parameters.UnknownParameterError: Box has no parameter 'sise'; did you mean 'size'? It takes size
    """  # noqa: E501
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
    """Make a frozen dataclass of pydantic whose constructor refuses values and parameters that do
    not belong.

    A value that its type does not allow raises a `pydantic.ValidationError`, and a parameter that
    does not exist an `UnknownParameterError`, see `refuse_unknown_parameters`.

    Args:
        cls: Class with annotated fields.
        config: Further configuration of pydantic, added to that of the base classes.
    """

    def decorate(cls: Any) -> Any:
        joined = {**getattr(cls, "__pydantic_config__", {}), **(config or {}), "extra": "forbid"}
        made = pydantic.dataclasses.dataclass(frozen=True, config=joined)(cls)  # type: ignore[call-overload]
        return refuse_unknown_parameters(made)

    return decorate if cls is None else decorate(cls)
