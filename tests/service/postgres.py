"""A server of PostgreSQL for tests, as Debian's package brings it: in a folder of its own, and gone at the end."""

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import chown, which
from tempfile import TemporaryDirectory

import pytest

_FOUND = [path.parent for path in sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))]


def _run(*command: object) -> None:
    """Run a program of PostgreSQL, which refuses to be run by root."""
    user = ["runuser", "-u", "postgres", "--"] if os.geteuid() == 0 else []
    done = subprocess.run([*user, *map(str, command)], capture_output=True, text=True, cwd="/")
    assert done.returncode == 0, done.stdout + done.stderr


@contextmanager
def postgres() -> Iterator[str]:
    """Start a server, which listens at a socket in its folder, and return the address of its database.

    A test that needs it is skipped where PostgreSQL is not installed.
    """
    if not _FOUND and which("initdb") is None:
        pytest.skip("PostgreSQL is not installed: apt-get install postgresql")
    programs = _FOUND[-1] if _FOUND else Path(which("initdb") or "").parent
    with TemporaryDirectory(prefix="pg") as folder:
        if os.geteuid() == 0:
            chown(folder, "postgres")
        data, options = f"{folder}/data", f"-k {folder} -c listen_addresses="
        _run(programs / "initdb", "-D", data, "-U", "postgres", "-A", "trust", "-E", "UTF8")
        _run(programs / "pg_ctl", "-D", data, "-l", f"{folder}/log", "-o", options, "-w", "start")
        try:
            yield f"postgresql://postgres@/postgres?host={folder}"
        finally:
            _run(programs / "pg_ctl", "-D", data, "-m", "immediate", "-w", "stop")
