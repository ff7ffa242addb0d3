"""One-line messages of validation errors."""

from typing import Any, Literal

import pytest
from pydantic import BaseModel, TypeAdapter, ValidationError, model_validator

from roletrust_env.errors import validation_message


class Part(BaseModel):
    size: int = 0


class Whole(BaseModel):
    name: str
    parts: tuple[Part, ...] = ()

    @model_validator(mode="after")
    def _check(self) -> "Whole":
        if self.name == "bad":
            raise ValueError("bad is not a name")
        return self


def message(**fields: Any) -> str:
    with pytest.raises(ValidationError) as raised:
        Whole(**fields)
    return validation_message(raised.value)


def test_a_missing_field_a_wrong_value_and_a_rule_of_the_whole() -> None:
    assert message() == "field name is missing"
    assert message(name="a", parts=[{"size": "x"}]).startswith(
        "parts.0.size is 'x': it must be an integer"
    )
    assert message(name="bad") == "bad is not a name"
    assert message(name=3, parts=3) == "name is 3: it must be a text; parts is 3: it must be a list"
    assert message(name="a", parts=[3]) == "parts.0 is 3: it must be a table of names and values"


class Kinds(BaseModel):
    value: int | float


def test_a_union_is_one_field_and_a_message_of_pydantic_is_printable() -> None:
    with pytest.raises(ValidationError) as raised:
        Kinds(value="x")  # type: ignore[arg-type]
    assert (
        validation_message(raised.value)
        == "value is 'x': it must be an integer, or it must be a number"
    )
    with pytest.raises(ValidationError) as raised:
        TypeAdapter(Literal["a"]).validate_python("b\nc")
    assert validation_message(raised.value) == "it must be 'a'"


def test_ten_wrong_fields_are_listed_and_the_others_counted() -> None:
    ten = message(name="a", parts=[{"size": "x"}] * 10)
    assert ten.count("; parts") == 9
    assert "more" not in ten
    twelve = message(name="a", parts=[{"size": "x"}] * 12)
    assert twelve.count("; parts") == 9
    assert twelve.endswith("; and 2 more")


def test_a_long_value_is_cut_after_300_characters() -> None:
    assert f"is {repr('x' * 299)[:300]}...: " in message(name="a", parts=[{"size": "x" * 299}])


def test_exactly_300_characters_are_not_cut() -> None:
    exact = message(name="a", parts=[{"size": "x" * 298}])
    assert f"is {'x' * 298!r}: " in exact
    assert "..." not in exact
