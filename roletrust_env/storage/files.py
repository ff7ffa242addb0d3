"""Files, written whole or not at all."""

import csv
import json
import os
import platform
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any


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
