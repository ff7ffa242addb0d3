"""The C compiler of the machine, and shared objects that are kept between processes."""

import atexit
import ctypes
import hashlib
import os
import shlex
import shutil
import subprocess
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

EXACT = ("-O1", "-ffp-contract=off", "-fno-math-errno")
"""Flags of the compiler for exact arithmetic; on one game a higher level takes twice the time and
gains nothing."""

_BUILD = (
    '{command} -o "$1.so" -x c "$1" -lm && printf %s "$3" >> "$1.so" && mv "$1.so" "$2"; rm '
    '-f "$1" "$1.so"'
)
"""What the shell does, with the source as $1: it goes on when the process that started it ends. A
file ends with its hash, since to load one that was cut off, as when power fails, would end the
process."""

_KEPT_S = 60 * 24 * 3600
"""Time for which a file is kept after its last use, in seconds."""


@cache
def compiler() -> str | None:
    """Return the C compiler, `$CC` or else `cc`; None where there is none."""
    found = os.environ.get("CC", "").strip() or "cc"
    try:
        return found if shutil.which(shlex.split(found)[0]) and os.name == "posix" else None
    except ValueError:  # a quotation mark without another
        return None


class SharedObject:
    """A shared object of a source in C. The compiler runs beside this process, unless the file is
    there already.

    A file is found again by a hash of the source, the flags, the compiler and the instructions of
    the processor. It lies in the user's cache, `$XDG_CACHE_HOME/roletrust` or `~/.cache/roletrust`;
    where that cannot be written, in a folder of this process. Compilers that run at once do not
    disturb each other. Files that were not used for two months are deleted.
    """

    def __init__(self, source: str, flags: Sequence[str] = EXACT) -> None:
        command = shlex.join([*shlex.split(compiler() or "cc"), *flags, "-shared", "-fPIC"])
        text = "\0".join([source, command, _target(tuple(flags))])
        self._hash = hashlib.sha256(text.encode()).hexdigest()[:32]
        self._path = _folder() / f"{self._hash}.so"
        self._process: subprocess.Popen[bytes] | None = None
        if not self._whole():
            handle, name = tempfile.mkstemp(dir=self._path.parent)
            with os.fdopen(handle, "w") as file:
                file.write(source)
            self._process = subprocess.Popen(
                [
                    "sh",
                    "-c",
                    _BUILD.format(command=command),
                    "sh",
                    name,
                    str(self._path),
                    self._hash,
                ],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # an interrupt is for this process
            )

    @property
    def ready(self) -> bool:
        """True if the compiler is done."""
        return self._process is None or self._process.poll() is not None

    def load(self) -> ctypes.CDLL | None:
        """Return the library when it is compiled; None if the compiler refuses."""
        if self._process is not None:
            self._process.wait()
        try:
            os.utime(self._path)
            return ctypes.CDLL(str(self._path)) if self._whole() else None
        except OSError:
            return None

    def _whole(self) -> bool:
        """Return whether the file is there to its end."""
        return self._path.is_file() and self._path.read_bytes().endswith(self._hash.encode())


@cache
def _target(flags: tuple[str, ...]) -> str:
    """Return what the compiler says of itself and of the processor for which it writes."""
    command = [*shlex.split(compiler() or "cc"), *flags, "-dM", "-E", "-x", "c", os.devnull]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout


@cache
def _folder() -> Path:
    """Return a folder for shared objects that only this user can write to."""
    try:
        folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "roletrust"
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        state = folder.stat()
        if (
            state.st_uid == os.getuid()
            and not state.st_mode & 0o022
            and os.access(folder, os.W_OK | os.X_OK)
        ):
            for file in folder.iterdir():
                with suppress(OSError):  # another process has deleted it, or it is a folder
                    if time.time() - file.stat().st_mtime > _KEPT_S:
                        file.unlink()
            return folder
    except (OSError, RuntimeError):  # RuntimeError: a user without a home
        pass
    own = tempfile.TemporaryDirectory(prefix="roletrust-")
    atexit.register(own.cleanup)
    return Path(own.name)
