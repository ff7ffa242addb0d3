"""Base class of all parts of a scenario."""

from difflib import get_close_matches
from inspect import cleandoc
from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator


class FrozenModel(BaseModel):
    """Frozen, validated data without unknown fields. The docstrings of its fields are added to that of its class."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False, use_attribute_docstrings=True)

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """Add the docstrings of the fields to that of the class."""
        fields = [f"    {name}: {info.description}" for name, info in cls.model_fields.items()]
        cls.__doc__ = "\n".join([cleandoc(cls.__doc__ or ""), "", "Attributes:", *fields])

    @model_validator(mode="before")
    @classmethod
    def _check_fields(cls, data: Any) -> Any:
        for name, value in data.items() if isinstance(data, dict) else ():
            if name not in cls.model_fields:
                near = get_close_matches(str(name), cls.model_fields, 1)
                hint = f"did you mean {near[0]!r}? The fields are" if near else "the fields are"
                raise ValueError(f"there is no field {name!r}; {hint} {', '.join(cls.model_fields)}")
            if isinstance(value, bool):  # pydantic would take it as 0 or 1
                raise ValueError(f"{name} is {value}; no field is true or false")
        return data
