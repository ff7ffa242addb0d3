"""The C compiler of the machine, and shared objects that are kept between processes."""

import ctypes
import hashlib
import os
import shlex
import shutil
import subprocess
import tempfile
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path

FLAGS = ("-O2", "-ffp-contract=off", "-fno-math-errno")  # exact: no fused and no reordered arithmetic

_BUILD = '{command} -o "$1.so" -x c "$1" -lm && mv "$1.so" "$2"; rm -f "$1" "$1.so"'
"""What the shell does, with the source as $1: it goes on when the process that started it ends."""

_KEPT_S = 60 * 24 * 3600
"""Time for which a file is kept after its last use, in seconds."""


@cache
def compiler() -> str | None:
    """Return the C compiler, `$CC` or else `cc`; None where there is none."""
    found = os.environ.get("CC") or "cc"
    return found if shutil.which(shlex.split(found)[0]) and os.name == "posix" else None


class SharedObject:
    """A shared object of a source in C. The compiler runs beside this process, unless the file is there already.

    A file is found again by a hash of the source, the flags, the compiler and the instructions of the processor. It
    lies in the user's cache, `$XDG_CACHE_HOME/roletrust` or `~/.cache/roletrust`; where that cannot be written, in a
    folder of this process. Compilers that run at once do not disturb each other. Files that were not used for two
    months are deleted.

    Args:
        source: Source in C.
        flags: Flags of the compiler.
    """

    def __init__(self, source: str, flags: Sequence[str] = FLAGS) -> None:
        command = shlex.join([*shlex.split(compiler() or "cc"), *flags, "-shared", "-fPIC"])
        text = "\0".join([source, command, _target(tuple(flags))])
        self._path = _folder() / f"{hashlib.sha256(text.encode()).hexdigest()[:32]}.so"
        self._process: subprocess.Popen[bytes] | None = None
        if not self._path.exists():
            handle, name = tempfile.mkstemp(dir=self._path.parent)
            with os.fdopen(handle, "w") as file:
                file.write(source)
            self._process = subprocess.Popen(
                ["sh", "-c", _BUILD.format(command=command), "sh", name, str(self._path)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # an interrupt is for this process
            )

    @property
    def ready(self) -> bool:
        """Whether the compiler is done."""
        return self._process is None or self._process.poll() is not None

    def load(self) -> ctypes.CDLL | None:
        """Return the library when it is compiled; None if the compiler refuses."""
        if self._process is not None:
            self._process.wait()
        try:
            os.utime(self._path)
            return ctypes.CDLL(str(self._path))
        except OSError:
            return None


@cache
def _target(flags: tuple[str, ...]) -> str:
    """Return what the compiler says of itself and of the processor for which it writes."""
    command = [*shlex.split(compiler() or "cc"), *flags, "-dM", "-E", "-x", "c", os.devnull]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout


@cache
def _folder() -> Path:
    """Return a folder for shared objects that only this user can write to."""
    folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "roletrust"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        state = folder.stat()
        if state.st_uid == os.getuid() and not state.st_mode & 0o022 and os.access(folder, os.W_OK | os.X_OK):
            for file in folder.iterdir():
                if time.time() - file.stat().st_mtime > _KEPT_S:
                    file.unlink(missing_ok=True)
            return folder
    except OSError:
        pass
    return Path(_own_folder().name)


@cache
def _own_folder() -> "tempfile.TemporaryDirectory[str]":
    return tempfile.TemporaryDirectory(prefix="roletrust-")
