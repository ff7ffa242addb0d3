"""Ranges that values of scenarios, trust models and policies are kept to, and those on which attacks are searched."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Annotated, Any

from pydantic import AfterValidator, ValidationError, ValidatorFunctionWrapHandler, WrapValidator
from pydantic_core import PydanticCustomError


def _within(allowed: str, holds: Callable[[float], bool]) -> AfterValidator:
    """A validator that refuses NaN, too, and says what is allowed."""

    def check(value: float) -> float:
        if not holds(value):
            raise PydanticCustomError("range", "it must lie in {allowed}", {"allowed": allowed})
        return value

    return AfterValidator(check)


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
