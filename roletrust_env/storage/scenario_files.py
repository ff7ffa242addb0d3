"""Scenario files in TOML."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from roletrust_env.storage.files import replacing
from roletrust_env.world import Scenario


def write_scenario(path: Path, scenario: Scenario, names: Sequence[str] = ()) -> None:
    """Write a scenario as TOML that `make_scenario` reads; default values are left out.

    Args:
        path: Path of the file.
        scenario: Scenario; with `names`, each of its groups is a single agent.
        names: Names of the groups in their source, written as comments; any text is allowed.
    """
    with replacing(path) as temporary:
        temporary.write_text(as_toml(scenario, names), encoding="utf-8")


def as_toml(scenario: Scenario, names: Sequence[str] = ()) -> str:
    """Return a scenario as TOML, see `write_scenario`."""
    data = scenario.model_dump(mode="json", exclude_defaults=True)
    if "access" in data:
        data["access"] = {"kind": scenario.access.kind, **data["access"]}
    lines, tables = [], []
    for field, value in data.items():
        if isinstance(value, Mapping):
            tables.append((f"[{field}]", "", value))
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            comments = (
                [f"  # {printable_name(name)}" for name in names] if field == "agents" else []
            )
            tables += [
                (f"[[{field}]]", comments[k] if comments else "", item)
                for k, item in enumerate(value)
            ]
        else:
            lines.append(f"{field} = {_toml(value)}")
    for heading, comment, table in tables:
        lines += [
            "",
            heading + comment,
            *(f"{key} = {_toml(value)}" for key, value in table.items()),
        ]
    return "\n".join(lines) + "\n"


def printable_name(name: str) -> str:
    """Return a name with control characters escaped, since it may come from the network."""
    return name if name.isprintable() else ascii(name)


def _toml(value: Any) -> str:
    """Return a plain value as TOML. Strings, numbers and lists are written as in JSON."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {_toml(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")
