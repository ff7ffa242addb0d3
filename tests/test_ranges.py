"""Ranges: the values that they allow, and their description in words."""

from typing import Annotated, Any, Literal

import pytest
from pydantic import ConfigDict, Field, NonNegativeInt, PositiveFloat, TypeAdapter, ValidationError
from refusals import refuses

from roletrust_env import Policy, make_trust_model, parameters
from roletrust_env.parameters import Lam, NotSearched, SearchRange, Share, Tail, allowed


@pytest.mark.parametrize(
    ("hint", "description"),
    [
        (Share, "0 to 1"),
        (Lam, "0.5 to below 1"),
        (Annotated[Tail, NotSearched()], "1e-6 to below 0.5"),
        (Annotated[Share, SearchRange(0, 0.5)], "0 to 1"),
        (PositiveFloat, "above 0"),
        (NonNegativeInt, "whole number from 0"),
        (Annotated[int, Field(gt=2, lt=7)], "whole number 3 to 6"),
        (Annotated[float, Field(lt=7)], "below 7"),
        (int, "whole number"),
        (float, "number"),
        (bool, "True or False"),
        (str, "text"),
        (Policy, "Policy"),
        (Literal["a", "b"], "a or b"),
        (
            Annotated[tuple[NonNegativeInt, ...], Field(min_length=1)] | None,
            "several: whole number from 0, or None",
        ),
    ],
)
def test_what_is_allowed(hint, description):
    assert allowed(hint) == description


LIMITS = [
    (parameters.Share, [0, 1], [-1e-9, 1 + 1e-9]),
    (parameters.Lam, [0.5, 1 - 1e-9], [0.5 - 1e-9, 1]),
    (parameters.Inside, [0.001, 0.999], [0.000999, 0.999001]),
    (parameters.Ridge, [0.001, 1e6], [0.000999, 1.1e6, float("inf")]),
    (parameters.Factor, [1e-300, 1], [0, 1 + 1e-9]),
    (parameters.LessThanHalf, [0, 0.5 - 1e-9], [-1e-9, 0.5]),
    (parameters.Tail, [1e-6, 0.5 - 1e-9], [0.999e-6, 0.5]),
    (parameters.Power, [0, 8], [-1e-9, 8 + 1e-9]),
    (parameters.Exponent, [1, 8], [1 - 1e-9, 8 + 1e-9]),
    (
        parameters.ShareOrRange,
        [0, 1, (0, 1), (0.5, 0.5)],
        [-1e-9, 1 + 1e-9, (0.6, 0.5), (0, 1.1), (False, 1)],
    ),
    (parameters.BiasOrRange, [-1, 1, (-1, 1)], [-1 - 1e-9, 1 + 1e-9, (1, -1)]),
    (parameters.ScaleOrRange, [0, 1e6, (0, 2)], [-1e-9, 1.1e6, float("inf"), (2, 1)]),
    (parameters.Amount, [0, 1e-30, 1e6], [-1e-30, 1.1e6, float("nan")]),
    (parameters.PositiveAmount, [1e-6, 1e6], [0, 9e-7, 1.1e6, float("nan")]),
    (parameters.ZeroOrAmount, [0, 1e-6, 1e6], [-1, 9e-7, 1.1e6, float("nan")]),
]


@pytest.mark.parametrize(("hint", "allowed_values", "refused_values"), LIMITS)
def test_the_limits_of_each_range(
    hint: Any, allowed_values: list[Any], refused_values: list[Any]
) -> None:
    reader = TypeAdapter(hint, config=ConfigDict(strict=True))
    for value in allowed_values:
        assert reader.validate_python(value) == value
    for value in [*refused_values, float("nan")]:
        with refuses(ValidationError, "1", "check()"):
            reader.validate_python(value)


@pytest.mark.parametrize(
    ("low", "high"), [(1, 0), (float("-inf"), 0), (0, float("inf")), (float("nan"), 1)]
)
def test_a_search_range_is_finite_and_in_order(low: float, high: float) -> None:
    assert SearchRange(1, 1).high == 1
    with refuses(ValueError, "SearchRange"):
        SearchRange(low, high)


@pytest.mark.parametrize(
    ("name", "field"),
    [
        ("travos", "bins"),
        ("yu-singh", "memory"),
        ("sybil-rank", "steps"),
        ("blade", "levels"),
        ("habit", "levels"),
    ],
)
def test_what_sizes_a_memory_has_an_end(name: str, field: str) -> None:
    with refuses(ValueError, "100000", field):
        make_trust_model(name, **{field: 100_000})
