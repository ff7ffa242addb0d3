"""Pool of a Ray cluster. Each Ray actor plays its cells in a worker process of its own."""

import os
import socket
import sys
from collections.abc import Sequence
from typing import Any

import ray
from ray.exceptions import RayActorError, RayError

from roletrust_env.benchmarking.pool import TRIES, LocalPool, PlayedCells, worker_death
from roletrust_env.benchmarking.schema import AnyCell, CellResult, SuiteSchema, reason
from roletrust_env.storage.provenance import software


class Cluster:
    """Running Ray cluster with the same version of this package on all its machines.

    Args:
        address: Address of the head node, such as `10.0.0.1:6379`, or `auto` for a cluster on this
            machine.

    Raises:
        ValueError: No cluster answers at the address.
    """

    def __init__(self, address: str) -> None:
        self.address = address
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        try:
            _check_answers(address)
            ray.init(address, log_to_driver=False, logging_level="ERROR")
        except (OSError, RuntimeError, ValueError, RayError) as error:
            line = (str(error).strip() or type(error).__name__).splitlines()[0]
            raise ValueError(f"no Ray cluster answers at address {address} ({line})") from None

    def play(self, suite: SuiteSchema, cells: Sequence[Any]) -> PlayedCells:
        """See `Pool.play`.

        Raises:
            ValueError: A machine of the cluster has other software.
        """
        number = min(len(cells), max(1, int(ray.available_resources().get("CPU", 1))))
        actor: Any = ray.remote(num_cpus=1, max_restarts=-1, max_task_retries=TRIES - 1)(CellActor)
        free = [actor.remote([os.getcwd(), *sys.path]) for _ in range(number)]
        actors = list(free)
        running: dict[Any, tuple[Any, AnyCell]] = {}
        waiting = list(reversed(cells))
        try:
            while waiting or running:
                while waiting and free:
                    cell, worker = waiting.pop(), free.pop()
                    running[worker.play.remote(software(), suite, cell)] = worker, cell
                for reference in ray.wait(list(running))[0]:
                    worker, cell = running.pop(reference)
                    free.append(worker)
                    yield cell, _cell_result(reference)
        finally:
            for worker in actors:
                ray.kill(worker)

    def close(self) -> None:
        """Disconnect from the cluster."""
        ray.shutdown()


class CellActor:
    """Ray actor that plays cells in a separate process, so that a cell that hangs can be stopped.

    Args:
        path: Module search path of the client, so that its own models can be imported here.
    """

    def __init__(self, path: Sequence[str]) -> None:
        sys.path += [folder for folder in path if folder not in sys.path]
        self._pool = LocalPool(1, keep=True)

    def play(self, client: dict[str, Any], suite: SuiteSchema, cell: AnyCell) -> CellResult:
        """Play a cell.

        Raises:
            ValueError: The software of this machine differs from that of the client.
        """
        if client != (own := software()):
            other = [name for name in client if client[name] != own[name]]
            raise ValueError(
                f"a machine of the cluster has other software ({', '.join(other)}); results would "
                "differ"
            )
        return next(result for _, result in self._pool.play(suite, [cell]))


def _check_answers(address: str) -> None:
    """Check that a server answers at HOST:PORT, since Ray itself would wait for minutes.

    Raises:
        OSError: No server answers.
        ValueError: The port is not a number.
    """
    host, colon, port = address.rpartition("://")[2].rpartition(":")
    if colon:
        socket.create_connection((host.strip("[]"), int(port)), timeout=10).close()


def _cell_result(reference: Any) -> CellResult:
    try:
        result: CellResult = ray.get(reference)
        return result
    except RayActorError:
        return worker_death("with its machine or its Ray actor")
    except RayError as error:
        cause = getattr(error, "cause", None) or error
        if isinstance(cause, ValueError):
            raise ValueError(str(cause)) from None
        return CellResult((), 0.0, failed=reason(cause))
