"""Who plays the cells: a Ray cluster. Each of its processes has one of its own, as `Here` has them, to play in."""

import os
import socket
import sys
from collections.abc import Sequence
from typing import Any

import ray
from ray.exceptions import RayActorError, RayError

from roletrust_env.benchmark.pool import TRIES, Plays, gone, played, players
from roletrust_env.benchmark.schema import CellResult, reason
from roletrust_env.benchmark.suite_types import AnyCell, AnySuite
from roletrust_env.storage.provenance import software


class Cluster:
    """A Ray cluster that runs already, with this package in the same version on all its machines.

    Args:
        address: of its head, such as `10.0.0.1:6379`, or `auto` for one on this machine.

    Raises:
        ValueError: nobody answers there.
    """

    def __init__(self, address: str) -> None:
        self.address = address
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        try:
            _check_answers(address)
            ray.init(address, log_to_driver=False, logging_level="ERROR")
        except (OSError, RuntimeError, ValueError, RayError) as error:
            line = (str(error).strip() or type(error).__name__).splitlines()[0]
            raise ValueError(f"--ray {address}: no Ray cluster answers there ({line})") from None

    def play(self, suite: AnySuite, cells: Sequence[Any]) -> Plays:
        """See `Pool.play`.

        Raises:
            ValueError: a machine of the cluster has other software.
        """
        number = min(len(cells), max(1, int(ray.available_resources().get("CPU", 1))))
        seat: Any = ray.remote(num_cpus=1, max_restarts=-1, max_task_retries=TRIES - 1)(Seat)
        free = [seat.remote([os.getcwd(), *sys.path]) for _ in range(number)]
        seats = list(free)
        running: dict[Any, tuple[Any, AnyCell]] = {}
        waiting = list(reversed(cells))
        try:
            while waiting or running:
                while waiting and free:
                    cell, player = waiting.pop(), free.pop()
                    running[player.play.remote(software(), suite, cell)] = player, cell
                for ended in ray.wait(list(running))[0]:
                    player, cell = running.pop(ended)
                    free.append(player)
                    yield cell, _result(ended)
        finally:
            for player in seats:
                ray.kill(player)

    def close(self) -> None:
        """Leave the cluster."""
        ray.shutdown()


class Seat:
    """A process of the cluster, which plays cells in another one, so that one that hangs can be stopped.

    Args:
        path: where the other side finds its modules, so that a model of one's own is found here, too.
    """

    def __init__(self, path: Sequence[str]) -> None:
        sys.path += [folder for folder in path if folder not in sys.path]
        self._crew = players(1)

    def play(self, theirs: dict[str, Any], suite: AnySuite, cell: AnyCell) -> CellResult:
        """Play a cell, for somebody with this software."""
        if theirs != (mine := software()):
            other = [name for name in theirs if theirs[name] != mine[name]]
            raise ValueError(f"a machine of the cluster has other software ({', '.join(other)}); results would differ")
        return next(done for _, done in played(self._crew, suite, [cell]))


def _check_answers(address: str) -> None:
    """See that somebody answers at HOST:PORT, which Ray would wait minutes for.

    Raises:
        OSError: nobody does.
        ValueError: the port is no number.
    """
    host, colon, port = address.rpartition("://")[2].rpartition(":")
    if colon:
        socket.create_connection((host.strip("[]"), int(port)), timeout=10).close()


def _result(ended: Any) -> CellResult:
    """What came of a cell."""
    try:
        done: CellResult = ray.get(ended)
        return done
    except RayActorError:
        return gone("with its machine or its place on it")
    except RayError as error:
        cause = getattr(error, "cause", None) or error
        if isinstance(cause, ValueError):
            raise ValueError(str(cause)) from None
        return CellResult((), 0.0, failed=reason(cause))
