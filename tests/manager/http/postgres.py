"""A server of PostgreSQL for tests, as Debian's package brings it: in a folder of its own, and gone
at the end."""

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import chown, which
from tempfile import TemporaryDirectory

import pytest

_FOLDERS = [path.parent for path in sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))]
_PROGRAMS = _FOLDERS[-1] if _FOLDERS else Path(which("initdb") or "").parent


def _run(program: str, *arguments: object) -> None:
    """Run a program of PostgreSQL, which refuses to be run by root."""
    user = ["runuser", "-u", "postgres", "--"] if os.geteuid() == 0 else []
    command = [*user, *map(str, (_PROGRAMS / program, *arguments))]
    done = subprocess.run(command, capture_output=True, text=True, cwd="/")
    assert done.returncode == 0, done.stdout + done.stderr


def _start(folder: str) -> None:
    options = f"-k {folder} -c listen_addresses="
    _run("pg_ctl", "-D", f"{folder}/data", "-l", f"{folder}/log", "-o", options, "-w", "start")


def _kill(folder: str) -> None:
    _run("pg_ctl", "-D", f"{folder}/data", "-m", "immediate", "-w", "stop")


def crash(address: str) -> None:
    """Kill the server of a database, and start it again."""
    folder = address.partition("host=")[2]
    _kill(folder)
    _start(folder)


@contextmanager
def postgres() -> Iterator[str]:
    """Start a server, which listens at a socket in its folder, and return the address of its
    database.

    A test that needs it is skipped where PostgreSQL is not installed.
    """
    if not (_PROGRAMS / "initdb").exists():
        pytest.skip("PostgreSQL is not installed: apt-get install postgresql")
    with TemporaryDirectory(prefix="pg") as folder:
        if os.geteuid() == 0:
            chown(folder, "postgres")
        _run("initdb", "-D", f"{folder}/data", "-U", "postgres", "-A", "trust", "-E", "UTF8")
        _start(folder)
        try:
            yield f"postgresql://postgres@/postgres?host={folder}"
        finally:
            _kill(folder)
