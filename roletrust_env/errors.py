"""Validation errors of pydantic, told in one line."""

from typing import Any

from pydantic import ValidationError


def explain(error: ValidationError) -> str:
    """Name each wrong field, its value and what is allowed, in one line."""
    return "; ".join(_explain(detail) for detail in error.errors())


def _explain(detail: Any) -> str:
    field = ".".join(str(part) for part in detail["loc"])
    if detail["type"] == "missing":
        return f"field {field} is missing"
    reason: str = detail["msg"].removeprefix("Value error, ")
    if detail["type"] == "value_error":
        return f"{field}: {reason}" if field else reason
    return f"{field} is {detail['input']!r}: {reason}"
