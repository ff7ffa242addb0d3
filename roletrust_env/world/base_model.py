"""Base class of all parts of a scenario."""

from inspect import cleandoc
from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator

from roletrust_env.errors import suggest


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
                raise ValueError(f"there is no field {name!r}{suggest(name, cls.model_fields)}")
            if isinstance(value, bool):  # would pass for 0 or 1
                raise ValueError(f"{name} is {value}; no field is true or false")
        return data
