"""A trust manager in a process of its own, as `roletrust manager serve` makes it; it starts in
milliseconds."""

import os
import re
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerProcess
from typing import NamedTuple

from signing_agents import NAME

from roletrust_experiments import main

_processes = get_context("forkserver")
_processes.set_forkserver_preload(
    [
        "pytest",
        "pandas",
        "psycopg",
        "sqlite3",
        "uvicorn.main",
        "uvloop",
        "roletrust_manager.http.serve",
        "roletrust_manager.http.endpoints",
        "roletrust_manager.http.connections",
        "served",
    ]
)
_LISTENS = re.compile(r"at http://[^:]+:(\d+)")
OPTIONS = "--name", NAME, "--set", "work=0", "--port", 0


class Served(NamedTuple):
    """A process that listens at a port of this machine."""

    process: ForkServerProcess
    port: int

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def cpu_s(self) -> float:
        """Time that the process has computed, seconds."""
        with open(f"/proc/{self.process.pid}/stat") as file:
            user, system = file.read().rpartition(")")[2].split()[11:13]
        return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def _call(function: Callable[[], object], arguments: list[str], errors: Connection) -> None:
    """Call a function as a command, whose standard error goes to a pipe."""
    os.dup2(errors.fileno(), 2)
    sys.stderr = os.fdopen(
        2, "w", 1, closefd=False
    )  # the one so far takes it for a file, in which one can seek
    sys.argv = ["roletrust", *arguments]
    function()


@contextmanager
def served(
    store: object, *arguments: object, function: Callable[[], object] = main
) -> Iterator[Served]:
    """A manager, or another program; at the end it is told to end, if it is not killed before."""
    ours, theirs = _processes.Pipe(duplex=False)
    command = ["manager", "serve", "role-trust", *map(str, [store, *OPTIONS, *arguments])]
    process = _processes.Process(target=_call, args=(function, command, theirs))
    process.start()
    theirs.close()
    try:
        words = ""
        while (found := _LISTENS.search(words)) is None:
            read = os.read(ours.fileno(), 10_000)
            assert read, words
            words += read.decode()
        yield Served(process, int(found[1]))
        if process.is_alive():
            process.terminate()
            process.join(20)
            assert process.exitcode in (0, -signal.SIGTERM)
            os.set_blocking(ours.fileno(), False)
            with suppress(BlockingIOError):
                assert b"Traceback" not in os.read(ours.fileno(), 100_000)
    finally:
        process.kill()
        process.join()
        ours.close()
