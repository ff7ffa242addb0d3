"""Scenarios as files."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from roletrust_env import Scenario
from roletrust_env.storage.files import replacing


def write_scenario(path: Path, scenario: Scenario, names: Sequence[str] = ()) -> None:
    """Write a scenario as TOML that `make_scenario` reads; what is as usual is left out.

    Args:
        path: of the file.
        scenario: its groups of agents are of one agent each, where they have names.
        names: what each group is called elsewhere, for people; they may be anything.
    """
    with replacing(path) as temporary:
        temporary.write_text(as_toml(scenario, names), encoding="utf-8")


def as_toml(scenario: Scenario, names: Sequence[str] = ()) -> str:
    """What `write_scenario` writes."""
    data = scenario.model_dump(mode="json", exclude_defaults=True)
    if "access" in data:
        data["access"] = {"kind": scenario.access.kind, **data["access"]}
    lines, tables = [], []
    for field, value in data.items():
        if isinstance(value, Mapping):
            tables.append((f"[{field}]", "", value))
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            called = [f"  # {readable(name)}" for name in names] if field == "agents" else []
            tables += [(f"[[{field}]]", called[k] if called else "", item) for k, item in enumerate(value)]
        else:
            lines.append(f"{field} = {_toml(value)}")
    for heading, comment, table in tables:
        lines += ["", heading + comment, *(f"{key} = {_toml(value)}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def readable(name: str) -> str:
    """A name from elsewhere, without the signs that end lines or move a terminal's cursor."""
    return name if name.isprintable() else ascii(name)


def _toml(value: Any) -> str:
    """A plain value; strings, numbers and lists are written in TOML as they are in JSON."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {_toml(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")
