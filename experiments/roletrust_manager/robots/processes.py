"""Nodes as processes of one command, which start together and end with it."""

import multiprocessing
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any, NamedTuple, Self

from roletrust_env.interrupts import without_interrupts
from roletrust_manager.dds.nodes.run_loop import run_with_parent

_NODES = [
    f"roletrust_manager.dds.nodes.{name}"
    for name in ("agent_nodes", "manager_node", "recorder_node")
]
_READY_S = 120.0  # time for a process to start, even on a busy machine
_STOP_S = 20.0  # time for a process to end, even on a busy machine

Run = Callable[..., object]


def node_context() -> Any:
    """Return a context of `multiprocessing` whose processes start quickly: each is a copy of one
    with all modules.
    """
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(_NODES)
    return context


class _Process(NamedTuple):
    process: Any
    pipe: Connection


class NodeProcesses:
    """Processes that are started one by one, begin their work together, and are stopped at the end.

    They also end if the process that started them is killed.

    Each process runs a function until SIGTERM. It reports that it is ready once the function's
    module is imported.
    """

    def __init__(self) -> None:
        self._context = node_context()
        self._processes: dict[str, _Process] = {}
        self._ready: set[str] = set()

    def start(self, name: str, run: Run, /, **arguments: Any) -> None:
        """Start a process that waits for `begin`, and then calls `run` with the arguments of
        both.
        """
        here, far_end = self._context.Pipe()
        process = self._context.Process(
            target=run_with_parent,
            args=(_run_child, far_end, run, arguments),
            name=name,
            daemon=True,
        )
        with without_interrupts():  # they are stopped at the end
            process.start()
        far_end.close()
        self._processes[name] = _Process(process, here)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the processes."""
        return tuple(self._processes)

    def ready(self, *names: str) -> None:
        """Wait until some processes are ready; all if none is named.

        Raises:
            ValueError: A process did not start.
        """
        for name in names or self._processes:
            pipe = self._processes[name].pipe
            try:
                ready = name in self._ready or (pipe.poll(_READY_S) and pipe.recv())
            except EOFError:
                ready = False
            if not ready:
                raise ValueError(f"{name} did not start")
            self._ready.add(name)

    def begin(self, *names: str, **arguments: Any) -> None:
        """Let some processes begin with further arguments, once they are ready."""
        self.ready(*names)
        for name in names:
            self._processes[name].pipe.send(arguments)

    def check(self, *ended: str) -> None:
        """Check that no process has failed, and that none has ended.

        Args:
            ended: Names of processes that may have ended.

        Raises:
            ValueError: A process has failed, for the given reason, or has ended.
        """
        for name, (process, pipe) in self._processes.items():
            with suppress(EOFError):
                if pipe.poll():
                    raise ValueError(f"{name}: {pipe.recv()}")
            if process.exitcode not in (None, 0):
                raise ValueError(f"{name} ended with exit code {process.exitcode}")
            if process.exitcode == 0 and name not in ended:
                raise ValueError(f"{name} has ended before the others")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, failure: object, *more: object) -> None:
        """Stop all processes.

        Raises:
            ValueError: There was no failure until now, and one of them fails or does not stop.
        """
        for process, _ in self._processes.values():
            process.terminate()
        until, late = time.monotonic() + _STOP_S, list[str]()
        for name, (process, _) in self._processes.items():
            process.join(max(0.0, until - time.monotonic()))
            if process.exitcode is None:
                late.append(name)
            process.kill()
        if failure is None:
            if late:
                raise ValueError(
                    f"{', '.join(late)} did not stop within {_STOP_S:g} s, and may have lost "
                    "something"
                )
            self.check(*self.names)


def _run_child(pipe: Connection, run: Run, arguments: Mapping[str, Any]) -> None:
    """Wait for `begin`, run the function, and send the message of an error back."""
    pipe.send(True)
    with suppress(KeyboardInterrupt, EOFError):
        further = pipe.recv()
        try:
            run(**arguments, **further)
        except (ValueError, OSError) as error:
            pipe.send(str(error))
