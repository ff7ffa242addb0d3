"""Atomic writing: a file is written completely or not at all."""

import csv
import errno
import json
import os
import platform
import re
import shutil
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

_holders = set[tuple[int, int, Path]]()  # thread, process and folder of each lock


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Replace a file at the end of the context, or remove the temporary file if an error occurs.

    Where the path is a link, its file is replaced. The new file has the permissions of the old one.

    Args:
        path: Path of the file; its folder is created if it does not exist.

    Yields:
        The path of the temporary file, with the same suffix.

    Raises:
        OSError: The path is that of a folder or of a device, which is as it was.
    """
    path = Path(os.path.realpath(path))
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "it is no file that can be replaced", str(path))
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = unfinished_path(path)
    try:
        yield temporary
        if path.exists():
            shutil.copymode(path, temporary)
        os.replace(temporary, path)
    except OSError as error:
        if str(error.filename) != str(temporary):
            raise
        raise type(error)(f"{path} cannot be written: {error.strerror}") from None
    finally:
        temporary.unlink(missing_ok=True)


def unfinished_path(path: Path) -> Path:
    """Return the path of a file or folder until it is complete: hidden, and with the number of the
    writing process.
    """
    return path.with_name(f".{path.stem}.{platform.node()}-{os.getpid()}{path.suffix}")


def clear_unfinished(folder: Path, own: Path | None = None) -> None:
    """Remove unfinished files and folders of dead processes of this machine from a folder.

    Args:
        folder: Folder.
        own: File that nobody else may write now: its unfinished ones are removed whoever left them,
            since each run of a container is another machine.
    """
    name = re.compile(rf"\..+\.{re.escape(platform.node())}-(\d+)(\.\w+)?")
    mine = (
        None
        if own is None
        else re.compile(rf"\.{re.escape(own.stem)}\..+-\d+{re.escape(own.suffix)}")
    )
    for path in folder.glob(".*"):
        match = name.fullmatch(path.name)
        if (match and not _alive(int(match[1]))) or (mine and mine.fullmatch(path.name)):
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep others out who lock the same folder; they wait. The lock leaves no file, and ends with
    its process.

    Raises:
        OSError: The folder cannot be created, this thread has locked it, or the system has no such
            locks.
    """
    folder.mkdir(parents=True, exist_ok=True)
    holder = threading.get_ident(), os.getpid(), folder.resolve()
    if holder in _holders:
        raise OSError(
            f"{folder} is in use by this thread already, which would wait for itself for ever"
        )
    if os.name != "posix":
        raise OSError(f"{folder} cannot be locked on this system")
    import fcntl

    descriptor = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        except OSError as error:
            raise OSError(f"{folder} cannot be locked: {error.strerror}") from None
        _holders.add(holder)
        yield
    finally:
        _holders.discard(holder)
        os.close(descriptor)


def prepare_folder(folder: Path) -> None:
    """Check before the work that results can be written to a folder, and remove unfinished files
    from it.

    A new folder is not left behind; it is created with the first result.

    Raises:
        OSError: The folder cannot be written.
    """
    try:
        new = [path for path in (folder, *folder.parents) if not path.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        clear_unfinished(folder)
        probe = unfinished_path(folder / "probe")
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise type(error)(
            f"--out {folder} is no folder that can be written: {error.strerror}"
        ) from None
    for path in new:
        with suppress(
            OSError
        ):  # in use by another run, or the parent of another folder, such as `a/..`
            path.rmdir()


def write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write a table. Floats have six decimals; None and NaN give an empty cell."""
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows([_cell(value) for value in row] for row in rows)


def write_json(path: Path, data: Mapping[str, Any]) -> None:
    """Write plain data as indented JSON."""
    write_text(path, json.dumps(data, indent=2, ensure_ascii=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text file."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _alive(process: int) -> bool:
    """Return whether a process is alive; true on systems that offer no safe check."""
    if os.name != "posix":
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # a process of another user
        return True
    return True


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return "" if value != value else f"{value:.6f}"
    return "" if value is None else str(value)


def write_lock(path: Path) -> Any:
    """Acquire the lock of the only writer of a file or a folder: the file `PATH.lock`.

    Raises:
        ValueError: Another process holds it.
    """
    from filelock import FileLock, Timeout

    path.parent.mkdir(parents=True, exist_ok=True)
    lock = FileLock(f"{path}.lock")
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise ValueError(
            f"another run writes to {path}; wait for it, or give another --out"
        ) from None
    return lock
