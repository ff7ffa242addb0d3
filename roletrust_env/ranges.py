"""Ranges of the values that scenarios, trust models and policies allow, and ranges that searches for attacks cover."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import AfterValidator, ValidationError, ValidatorFunctionWrapHandler, WrapValidator
from pydantic_core import PydanticCustomError


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
    """Annotation of a number: the range, both ends included, in which searches look for its best value.

    Raises:
        ValueError: The range is empty, or an end is not finite.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        if not -inf < self.low <= self.high < inf:
            raise ValueError(f"{self} is not a range; low must not be above high, and both must be finite")


class GridValues:
    """Annotation of a parameter: the few values that a grid search tries; by default both ends and the middle."""

    def __init__(self, *values: Any) -> None:
        self.values = values


class NotSearched:
    """Annotation of a parameter: searches leave it at its default, whatever its range."""


class Victims:
    """Annotation of a tuple of provider indices: searches choose how many honest providers it holds."""


class Identities:
    """Annotation of a number of identities in reserve: searches try from 1 to the number that the attacker has."""


class Accomplices:
    """Annotation of a tuple of provider indices: searches and the command line fill in the attacker's own providers."""


class GameLength:
    """Annotation of a number of rounds: searches and the command line fill in the length of the game."""


def _number_or_range(allowed: str, holds: Callable[[float], bool]) -> WrapValidator:
    """Return a validator of a number, or of a range from which a number is drawn."""

    def check(value: Any, read: ValidatorFunctionWrapHandler) -> Any:
        try:
            parsed = read(value)
        except ValidationError:
            parsed = None
        low, high = parsed if isinstance(parsed, tuple) else (parsed, parsed)
        has_bool = isinstance(value, list | tuple) and any(isinstance(bound, bool) for bound in value)
        if parsed is None or has_bool or not (holds(low) and holds(high) and low <= high):
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

Ridge = Annotated[float, _within("[0.001, inf)", lambda x: 0.001 <= x < float("inf"))]
"""Strength with which a regression is drawn to its prior. With a smaller one, rounding would decide."""

Factor = Annotated[float, _within("(0, 1]", lambda x: 0 < x <= 1)]
"""Factor of a geometric decay."""

LessThanHalf = Annotated[float, _within("[0, 0.5)", lambda x: 0 <= x < 0.5)]
"""Share that is cut off at both ends."""

Tail = Annotated[float, _within("[1e-6, 0.5)", lambda x: 1e-6 <= x < 0.5)]
"""Probability that is cut off at either end of a distribution."""

Power = Annotated[float, _within("[0, 8]", lambda x: 0 <= x <= 8)]
"""Exponent of a share, for example of trust in a weight. With 0 all weights are equal."""

ShareOrRange = Annotated[float | tuple[float, float], _number_or_range("[0, 1]", lambda x: 0 <= x <= 1)]
"""Share, or a range from which it is drawn."""

BiasOrRange = Annotated[float | tuple[float, float], _number_or_range("[-1, 1]", lambda x: -1 <= x <= 1)]
"""Number added to a quality, or a range from which it is drawn."""

ScaleOrRange = Annotated[float | tuple[float, float], _number_or_range("[0, inf)", lambda x: 0 <= x < inf)]
"""Factor of a quality, or a range from which it is drawn."""


def allowed(hint: Any) -> str:
    """Return the values that a type allows, in words.

    Example:
        >>> from pydantic import PositiveInt
        >>> [allowed(hint) for hint in (Lam, PositiveInt, Literal["power", "linear"], PositiveInt | None, float)]
        ['[0.5, 1)', 'whole [1, inf)', 'power | linear', 'whole [1, inf) | None', 'number']
    """
    kind, *marks = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    if descriptions := [mark.allowed for mark in marks if isinstance(mark, _Allowed)]:
        return str(descriptions[-1])
    if get_origin(kind) is Literal:
        return " | ".join(map(str, get_args(kind)))
    if get_origin(kind) in (Union, UnionType):
        return " | ".join(map(allowed, get_args(kind)))
    if get_origin(kind) in (tuple, list):
        return f"some of {allowed(get_args(kind)[0])}"
    if kind in (int, float):
        bounds, whole = _interval(marks, kind is int), "whole " if kind is int else ""
        return f"{whole}{bounds or 'number'}"
    return {bool: "True | False", str: "text", NoneType: "None"}.get(kind, getattr(kind, "__name__", str(kind)))


def _interval(marks: list[Any], whole: bool) -> str:
    """Return the interval between bounds such as pydantic's `Gt`, closed where possible; empty without bounds."""
    ends: dict[str, Any] = {}
    for bound in (part for mark in marks for part in (mark, *getattr(mark, "metadata", ()))):
        ends |= {name: getattr(bound, name) for name in ("gt", "ge", "lt", "le") if hasattr(bound, name)}
    if whole:
        ends |= {"ge": ends.pop("gt") + 1} if "gt" in ends else {}
        ends |= {"le": ends["lt"] - 1} if "lt" in ends else {}
    low = f"[{ends['ge']}" if "ge" in ends else f"({ends.get('gt', '-inf')}"
    high = f"{ends['le']}]" if "le" in ends else f"{ends.get('lt', 'inf')})"
    return f"{low}, {high}" if ends else ""
