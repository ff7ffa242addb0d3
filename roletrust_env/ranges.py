"""Ranges that values of scenarios, trust models and policies are kept to."""

from collections.abc import Callable
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


Share = Annotated[float, _within("[0, 1]", lambda x: 0 <= x <= 1)]
"""A trust, a quality, a rating, a probability."""

Lam = Annotated[float, _within("[0.5, 1)", lambda x: 0.5 <= x < 1)]
"""Weight of the newest round in every trust."""

DrawnShare = Annotated[float | tuple[float, float], _drawn("[0, 1]", lambda x: 0 <= x <= 1)]
"""A share, or a range of them from which one is drawn."""

DrawnBias = Annotated[float | tuple[float, float], _drawn("[-1, 1]", lambda x: -1 <= x <= 1)]
"""What is added to a quality, or a range to draw it from."""

DrawnScale = Annotated[float | tuple[float, float], _drawn("[0, inf)", lambda x: 0 <= x < inf)]
"""What a quality is multiplied by, or a range to draw it from."""
