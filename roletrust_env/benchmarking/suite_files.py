"""Suites by name and in TOML files, and the command that plays one."""

import shlex
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from roletrust_env.benchmarking.learners.suite import LearnersSuite
from roletrust_env.benchmarking.suite import Cell, Suite
from roletrust_env.benchmarking.worlds import AttackedWorld
from roletrust_env.errors import suggest, validation_message

AnySuite = Suite | LearnersSuite
"""Suite of any type that a file may have."""

_WORLDS = ", worlds "
"""Part of the name of a suite before the seed of its worlds."""

_FOLDER = Path(__file__).parent / "suites"


def suites() -> dict[str, str]:
    """Return the descriptions of the suites of the project, by name."""
    return {name: load_suite(name).description for name in _names()}


def load_suite(suite: str | Path, worlds: int | None = None) -> AnySuite:
    """Return a suite by name, or from a TOML file.

    Args:
        suite: Name of a suite, or path of a file that ends in `.toml`.
        worlds: Seed of its worlds. None means those of the file; with another one the suite has
            another name.

    Raises:
        ValueError: The name is unknown, the file cannot be read or does not contain a valid suite,
            or it has no worlds that are drawn.
    """
    path = Path(suite)
    if path.suffix != ".toml":
        if str(suite) not in (names := _names()):
            raise ValueError(
                f"unknown suite {str(suite)!r}{suggest(suite, names)}, or the path of a .toml file"
            )
        path = _FOLDER / f"{suite}.toml"
    fields = {"name": path.stem, **_fields(path)}
    if worlds is not None:
        if not isinstance(fields.get("worlds"), Mapping):
            raise ValueError(
                f"suite {suite} has no table of worlds, so none can be drawn with another seed"
            )
        fields["name"] = f"{fields['name']}{_WORLDS}{worlds}"
        fields["worlds"] = {**fields["worlds"], "seed": worlds}
    return read_suite(fields, f"suite {suite}")


def setting_worlds(text: str) -> list[AttackedWorld]:
    """Return the selection worlds of a setting of a suite, with their compromised agents.

    Args:
        text: `SUITE:SETTING`, such as `standard:coalition`. For `SUITE` see `load_suite`.

    Raises:
        ValueError: The suite is unknown, or it does not have such a setting with compromised
            agents.
    """
    name, _, setting = text.rpartition(":")
    suite = load_suite(name)
    attacked = (
        [each for each, fields in suite.settings.items() if fields.roles]
        if isinstance(suite, Suite)
        else []
    )
    if not isinstance(suite, Suite) or setting not in attacked:
        raise ValueError(
            f"suite {name} does not have a setting {setting!r} with compromised agents"
            f"{suggest(setting, attacked)}"
        )
    cell = Cell(suite.solo["common"], "common", setting, "scripts")
    return [suite.world(cell, "selection", k) for k in range(suite.worlds.selection)]


def read_suite(data: Mapping[str, Any], source: str) -> AnySuite:
    """Return a suite from plain data.

    Args:
        data: Fields of the suite.
        source: Origin of the data, for error messages.

    Raises:
        ValueError: A field is wrong. The message states its value and the allowed ones.
    """
    if not isinstance(data, Mapping):
        raise ValueError(f"{source}: a suite must be a table of fields, not {str(data)[:100]!r}")
    kind = str(data.get("kind", "closed-loop"))
    if kind not in _TYPES:
        raise ValueError(f"{source}: kind is {kind!r}; it must be one of {', '.join(_TYPES)}")
    try:
        return _TYPES[kind].model_validate(data)
    except ValidationError as error:
        raise ValueError(f"{source}: {validation_message(error)}") from None


_TYPES: dict[str, type[AnySuite]] = {
    "closed-loop": Suite,
    "learners": LearnersSuite,
}


def _names() -> list[str]:
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


def _fields(path: Path, *extending: Path) -> dict[str, Any]:
    """Return the fields of a suite in a file, and those of the suite that it extends where it has
    none of its own.

    Args:
        path: Path of a TOML file. A file that it extends is in the same folder.
        *extending: Files that extend this one.

    Raises:
        ValueError: A file cannot be read, is not valid TOML or extends what it must not.
    """
    if path in extending:
        raise ValueError(f"suite {path} extends itself")
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ValueError(f"suite {path} is not valid TOML: {error}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"suite {path} cannot be read: {error}") from None
    if "extends" not in data:
        return data
    base = str(data.pop("extends"))
    if base not in (names := _names()) and not base.endswith(".toml"):
        allowed = ", ".join(names)
        raise ValueError(
            f"suite {path}: extends is {base!r}; it must be one of {allowed}, or a .toml file "
            "beside it"
        )
    file = _FOLDER / f"{base}.toml" if base in names else path.parent / base
    return _fitting({**_fields(file, path, *extending), **data}, data)


def _fitting(fields: dict[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a suite without those replayed attacks of an extended suite that do not
    fit. Fields of the wrong type stay as they are, for the checks of the suite.

    Args:
        fields: All fields.
        own: Fields that the file has itself.
    """
    replayed: Any = fields.get("replayed")
    methods: Any = fields.get("methods")
    settings: Any = fields.get("settings")
    known = isinstance(methods, list) and isinstance(settings, dict)
    if "replayed" in own or not isinstance(replayed, list) or not known:
        return fields
    replaced = "attacks" in own or "replayed" not in methods
    names = [] if replaced else list(settings)
    kept = [
        attack
        for attack in replayed
        if not isinstance(attack, dict) or attack.get("setting") in names
    ]
    if "methods" not in own and not kept:
        methods = [name for name in methods if name != "replayed"]
    return {**fields, "replayed": kept, "methods": methods}


def reproduction_command(suite: AnySuite, path: Path) -> str:
    """Return the command that plays a suite, or continues its run.

    Args:
        suite: Suite from the file of the run, with the selected models, attacks or learners.
        path: Path of that file.

    Returns:
        Command for a shell. A suite that is not part of the project is given by the name of its
        file.
    """
    name, _, seed = suite.name.partition(_WORLDS)
    options = ["--suite", name if name in _names() else f"{name}.toml"]
    options += ["--seed", seed] if seed else []
    names = list(suite.models) if isinstance(suite, Suite) else []
    bundled = load_suite(name) if name in _names() else suite
    if isinstance(suite, LearnersSuite):
        if getattr(bundled, "learners", None) != suite.learners:
            names = list(suite.learners)
    elif isinstance(bundled, Suite):
        if "search" in suite.methods:
            options.append("--search")
        scripts = suite.attacks if suite.attacks != bundled.attacks else ()
        trained = () if suite.replayed == bundled.replayed else suite.replayed
        attacks = dict.fromkeys([*scripts, *(attack.finder for attack in trained)])
        options += [part for attack in attacks for part in ("--attack", attack)]
    return shlex.join(["roletrust", "benchmark", *names, *options, "--out", str(path.parent)])
