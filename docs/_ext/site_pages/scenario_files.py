"""Scenarios as TOML."""

import json
from collections.abc import Mapping
from typing import Any

from roletrust_env.world import Scenario


def as_toml(scenario: Scenario) -> str:
    """Return a scenario as TOML that `make_scenario` reads; default values are left out."""
    data = scenario.model_dump(mode="json", exclude_defaults=True)
    if "access" in data:
        data["access"] = {"kind": scenario.access.kind, **data["access"]}
    lines, tables = [], []
    for field, value in data.items():
        if isinstance(value, Mapping):
            tables.append((f"[{field}]", value))
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            tables += [(f"[[{field}]]", item) for item in value]
        else:
            lines.append(f"{field} = {_toml(value)}")
    for heading, table in tables:
        lines += ["", heading, *(f"{key} = {_toml(value)}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    """Return a plain value as TOML. Strings, numbers and lists are written as in JSON."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {_toml(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")
