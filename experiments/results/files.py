"""Results on disk: written whole or not at all, and with all that is needed to make them again."""

import csv
import dataclasses
import json
import os
import platform
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from roletrust_env import Game, Policy, __version__

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# The packages that decide what numbers come out.
_PACKAGES = (
    "numpy",
    "opencv-python-headless",
    "array-api-compat",
    "gymnasium",
    "pettingzoo",
    "pydantic",
    "torch",
    "stable-baselines3",
    "scipy",
    "cma",
)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary file beside `path` that takes its place at the end, or vanishes if anything goes wrong.

    Args:
        path: of the file to be written; its folder is made if need be.

    Yields:
        The path to write to, with the same suffix.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = unfinished(path)
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def unfinished(path: Path) -> Path:
    """What a file or folder is called until it is whole: hidden, and named after the process that writes it."""
    return path.with_name(f".{path.stem}.{platform.node()}-{os.getpid()}{path.suffix}")


def clear_unfinished(folder: Path) -> None:
    """Remove what was left unfinished in a folder by processes of this machine that are no more."""
    name = re.compile(rf"\..+\.{re.escape(platform.node())}-(\d+)(\.\w+)?")
    for path in folder.glob(".*"):
        found = name.fullmatch(path.name)
        if found and not _alive(int(found[1])):
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)


def prepare_folder(folder: Path) -> None:
    """See now rather than after the work whether results can be written to a folder; and tidy it up.

    Raises:
        OSError: they cannot.
    """
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    clear_unfinished(folder)
    probe = unfinished(folder / "probe")
    probe.touch()
    probe.unlink()
    for path in made:  # they come back with the first result
        with suppress(OSError):  # another run writes there by now, or it is another's parent, as `a/..` is
            path.rmdir()


def write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write a table; floats get six decimals, None and NaN an empty cell."""
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows([_cell(value) for value in row] for row in rows)


def write_json(path: Path, data: Mapping[str, Any]) -> None:
    """Write plain data, readable for people."""
    write_text(path, json.dumps(data, indent=2, ensure_ascii=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_figure(path: Path, figure: "Figure") -> None:
    """Write a picture for the web and for print."""
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=160, facecolor="white")


def provenance(game: Game, seed: int) -> dict[str, Any]:
    """All that decides a result but the attackers: the software, the full scenario, the trust model and the seed.

    It holds no time and no host, so the same run writes the same bytes.
    """
    return {
        **software(),
        "seed": seed,
        "trust_model": described(game.model),
        "scenario": game.scenario.model_dump(mode="json"),
    }


def software() -> dict[str, Any]:
    """This package, Python and the packages that decide what numbers come out, with their versions."""
    return {
        "package": {"name": "roletrust-env", "version": __version__},
        "python": platform.python_version(),
        "packages": {name: found for name in _PACKAGES if (found := _version(name))},
    }


def cast_list(attackers: Mapping[str, Policy]) -> dict[str, dict[str, Any]]:
    """Who attacks, and how."""
    return {agent: described(policy) for agent, policy in attackers.items()}


def described(thing: Any) -> dict[str, Any]:
    """The class and the parameters of a model or policy."""
    parameters = dataclasses.asdict(thing) if dataclasses.is_dataclass(thing) and not isinstance(thing, type) else {}
    return {"class": f"{type(thing).__module__}.{type(thing).__qualname__}", "parameters": parameters}


def _alive(process: int) -> bool:
    """Whether a process runs; where that cannot be asked without harm, it is taken to."""
    if os.name != "posix":
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # it is somebody else's
        return True
    return True


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return "" if value != value else f"{value:.6f}"
    return "" if value is None else str(value)


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
