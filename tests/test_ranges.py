"""What a type allows, in words."""

from typing import Annotated, Literal

import pytest
from pydantic import Field, NonNegativeInt, PositiveFloat

from roletrust_env import Policy
from roletrust_env.ranges import GridValues, Lam, NotSearched, SearchRange, Share, Tail, allowed


@pytest.mark.parametrize(
    ("hint", "said"),
    [
        (Share, "[0, 1]"),
        (Lam, "[0.5, 1)"),
        (Annotated[Tail, NotSearched()], "[1e-6, 0.5)"),
        (Annotated[Share, SearchRange(0, 0.5), GridValues(0.1)], "[0, 1]"),
        (PositiveFloat, "(0, inf)"),
        (NonNegativeInt, "whole [0, inf)"),
        (Annotated[int, Field(gt=2, lt=7)], "whole [3, 6]"),
        (Annotated[float, Field(lt=7)], "(-inf, 7)"),
        (int, "whole number"),
        (float, "number"),
        (bool, "True | False"),
        (str, "text"),
        (Policy, "Policy"),
        (Annotated[Literal["a", "b"], GridValues("a")], "a | b"),
        (Annotated[tuple[NonNegativeInt, ...], Field(min_length=1)] | None, "some of whole [0, inf) | None"),
    ],
)
def test_what_is_allowed(hint, said):
    assert allowed(hint) == said
