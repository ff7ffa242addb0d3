"""Ranges that values of scenarios, trust models and policies are kept to, and those on which attacks are searched."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import AfterValidator, ValidationError, ValidatorFunctionWrapHandler, WrapValidator
from pydantic_core import PydanticCustomError


@dataclass(frozen=True)
class _Allowed(AfterValidator):
    """A validator that can tell what it lets pass."""

    allowed: str


def _within(allowed: str, holds: Callable[[float], bool]) -> _Allowed:
    """A validator that refuses NaN, too, and says what is allowed."""

    def check(value: float) -> float:
        if not holds(value):
            raise PydanticCustomError("range", "it must lie in {allowed}", {"allowed": allowed})
        return value

    return _Allowed(check, allowed)


@dataclass(frozen=True)
class Searched:
    """Annotated to a number's type: the range, both ends included, on which searches look for its best value.

    Raises:
        ValueError: the range is empty, or an end is not finite.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        if not -inf < self.low <= self.high < inf:
            raise ValueError(f"{self} is no range; low must not be above high, and both must be finite")


class Tried:
    """Annotated to a parameter's type: the few values that a grid tries; by default both ends and the middle."""

    def __init__(self, *values: Any) -> None:
        self.values = values


class Kept:
    """Annotated to a parameter's type: searches leave it at its default, whatever its range."""


class Victims:
    """Annotated to a tuple of places on the provider axis: searches pick how many honest providers it names."""


class Identities:
    """Annotated to a number of identities in reserve: searches try from 1 to as many as the attacker has."""


class Accomplices:
    """Annotated to a tuple of places on the provider axis: the attacker's own providers, told where they are known."""


class Length:
    """Annotated to a number of rounds: the length of the game, told where it is known."""


def _drawn(allowed: str, holds: Callable[[float], bool]) -> WrapValidator:
    """A validator of a number, or of a range from which one is drawn."""

    def check(value: Any, read: ValidatorFunctionWrapHandler) -> Any:
        try:
            found = read(value)
        except ValidationError:
            found = None
        low, high = found if isinstance(found, tuple) else (found, found)
        flags = isinstance(value, list | tuple) and any(isinstance(bound, bool) for bound in value)
        if found is None or flags or not (holds(low) and holds(high) and low <= high):
            message = "it must be a number in {allowed}, or a range (low, high) of two such numbers"
            raise PydanticCustomError("drawn", message, {"allowed": allowed})
        return found

    return WrapValidator(check)


Share = Annotated[float, _within("[0, 1]", lambda x: 0 <= x <= 1), Searched(0, 1)]
"""A trust, a quality, a rating, a probability."""

Lam = Annotated[float, _within("[0.5, 1)", lambda x: 0.5 <= x < 1)]
"""Weight of the newest round in every trust."""

Inside = Annotated[float, _within("[0.001, 0.999]", lambda x: 0.001 <= x <= 0.999)]
"""A share that is neither 0 nor 1, nor so near that it is lost in rounding."""

Ridge = Annotated[float, _within("[0.001, inf)", lambda x: 0.001 <= x < float("inf"))]
"""How strongly a regression is drawn to where it is when nothing is known; with less, rounding decides."""

Factor = Annotated[float, _within("(0, 1]", lambda x: 0 < x <= 1)]
"""What is left of something each time."""

LessThanHalf = Annotated[float, _within("[0, 0.5)", lambda x: 0 <= x < 0.5)]
"""A share that is cut from both ends."""

Tail = Annotated[float, _within("[1e-6, 0.5)", lambda x: 1e-6 <= x < 0.5)]
"""The probability that is cut off at either end of a distribution."""

DrawnShare = Annotated[float | tuple[float, float], _drawn("[0, 1]", lambda x: 0 <= x <= 1)]
"""A share, or a range of them from which one is drawn."""

DrawnBias = Annotated[float | tuple[float, float], _drawn("[-1, 1]", lambda x: -1 <= x <= 1)]
"""What is added to a quality, or a range to draw it from."""

DrawnScale = Annotated[float | tuple[float, float], _drawn("[0, inf)", lambda x: 0 <= x < inf)]
"""What a quality is multiplied by, or a range to draw it from."""


def allowed(hint: Any) -> str:
    """What values a type allows, in words.

    Example:
        >>> from pydantic import PositiveInt
        >>> [allowed(hint) for hint in (Lam, PositiveInt, Literal["power", "linear"], PositiveInt | None, float)]
        ['[0.5, 1)', 'whole [1, inf)', 'power | linear', 'whole [1, inf) | None', 'number']
    """
    kind, *marks = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    if said := [mark.allowed for mark in marks if isinstance(mark, _Allowed)]:
        return str(said[-1])
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
    """The interval that bounds such as pydantic's `Gt` leave, as closed as can be; empty if there are none."""
    ends: dict[str, Any] = {}
    for bound in (part for mark in marks for part in (mark, *getattr(mark, "metadata", ()))):
        ends |= {name: getattr(bound, name) for name in ("gt", "ge", "lt", "le") if hasattr(bound, name)}
    if whole:
        ends |= {"ge": ends.pop("gt") + 1} if "gt" in ends else {}
        ends |= {"le": ends["lt"] - 1} if "lt" in ends else {}
    low = f"[{ends['ge']}" if "ge" in ends else f"({ends.get('gt', '-inf')}"
    high = f"{ends['le']}]" if "le" in ends else f"{ends.get('lt', 'inf')})"
    return f"{low}, {high}" if ends else ""
