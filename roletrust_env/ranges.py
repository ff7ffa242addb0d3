"""Ranges that values of scenarios, trust models and policies are kept to."""

from collections.abc import Callable
from typing import Annotated

from pydantic import AfterValidator
from pydantic_core import PydanticCustomError


def _within(allowed: str, holds: Callable[[float], bool]) -> AfterValidator:
    """A validator that refuses NaN, too, and says what is allowed."""

    def check(value: float) -> float:
        if not holds(value):
            raise PydanticCustomError("range", "it must lie in {allowed}", {"allowed": allowed})
        return value

    return AfterValidator(check)


Share = Annotated[float, _within("[0, 1]", lambda x: 0 <= x <= 1)]
"""A trust, a quality, a rating, a probability."""

Lam = Annotated[float, _within("[0.5, 1)", lambda x: 0.5 <= x < 1)]
"""Weight of the newest round in every trust."""

Tail = Annotated[float, _within("[1e-6, 0.5)", lambda x: 1e-6 <= x < 0.5)]
"""The probability that is cut off at either end of a distribution."""
