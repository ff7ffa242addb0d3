"""Nodes as processes of one command: they begin together, and end with it."""

import multiprocessing
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any, NamedTuple, Self

_READY_S = 120.0  # in which a process must be up, on however busy a machine
_STOP_S = 5.0

Run = Callable[..., object]


class _Process(NamedTuple):
    process: Any
    pipe: Connection


class Processes:
    """Processes that are started one after the other, told together to begin, and stopped at the end.

    Each is a function that runs until SIGTERM. Its module is imported before it says that it is ready.
    """

    def __init__(self) -> None:
        self._spawn = multiprocessing.get_context("spawn")
        self._processes: dict[str, _Process] = {}
        self._ready: set[str] = set()

    def start(self, name: str, run: Run, /, **arguments: Any) -> None:
        """Start a process that will call `run`, with these arguments and those of `begin`."""
        here, there = self._spawn.Pipe()
        process = self._spawn.Process(target=_told, args=(there, run, arguments), name=name, daemon=True)
        process.start()
        there.close()
        self._processes[name] = _Process(process, here)

    def ready(self) -> None:
        """Wait until all are.

        Raises:
            ValueError: one is not, and will not be.
        """
        for name, (_, pipe) in self._processes.items():
            try:
                ready = name in self._ready or (pipe.poll(_READY_S) and pipe.recv())
            except EOFError:
                ready = False
            if not ready:
                raise ValueError(f"{name} did not start")
            self._ready.add(name)

    def begin(self, *names: str, **arguments: Any) -> None:
        """Let some begin when all are ready, with these further arguments."""
        self.ready()
        for name in names:
            self._processes[name].pipe.send(arguments)

    def check(self) -> None:
        """See whether all are well.

        Raises:
            ValueError: one has failed; it says why.
        """
        for name, (process, pipe) in self._processes.items():
            with suppress(EOFError):
                if pipe.poll():
                    raise ValueError(f"{name}: {pipe.recv()}")
            if process.exitcode not in (None, 0):
                raise ValueError(f"{name} ended with {process.exitcode}")

    def running(self, *names: str) -> bool:
        """Whether any of these still runs."""
        return any(self._processes[name].process.is_alive() for name in names)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        for process, _ in self._processes.values():
            process.terminate()
        until = time.monotonic() + _STOP_S
        for process, _ in self._processes.values():
            process.join(max(0.0, until - time.monotonic()))
            process.kill()


def _told(pipe: Connection, run: Run, arguments: Mapping[str, Any]) -> None:
    """Run when told to; what goes wrong is told in turn."""
    pipe.send(True)
    with suppress(KeyboardInterrupt, EOFError):
        further = pipe.recv()
        try:
            run(**arguments, **further)
        except (ValueError, OSError) as error:
            pipe.send(str(error))
