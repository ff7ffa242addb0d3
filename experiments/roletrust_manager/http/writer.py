"""One writer for many requests that wait: what waits together is written together."""

import asyncio
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from roletrust_manager.http.manager import TrustManager
from roletrust_manager.http.requests import Checked, Receipt, Request

MAX_WAITING = 10_000
"""Number of requests that may wait."""

_TURNS = 8  # of the event loop, microseconds, in which a request gets from its socket to here
_FEW = 4  # tokens that are checked at once; more would let all others wait

_Value = TypeVar("_Value")
_Batch = list[tuple[Checked, asyncio.Future[list[Receipt]]]]


class BusyError(Exception):
    """Too many wait already."""


class RequestWriter:
    """Hands requests to a manager, all that wait at once, after the checks that need no turn.

    So the disk is waited for once for many requests, the more the busier it is (group commit:
    DeWitt et al., "Implementation Techniques for Main Memory Database Systems", 1984). A file is
    written here, since another thread would cost more than the disk; what takes long, such as the
    end of a round, has a thread of its own, and the requests wait.
    """

    def __init__(self, manager: TrustManager) -> None:
        self._manager = manager
        self._checker, self._thread = ThreadPoolExecutor(1), ThreadPoolExecutor(1)
        self._waiting: _Batch = []
        self._turn = asyncio.Lock()

    async def take(self, request: Request) -> list[Receipt]:
        """Return the receipts of a request, which is in the store then.

        Raises:
            RefusedError: The request is refused.
            StoreError: The store cannot be written.
            BusyError: Too many requests wait.
        """
        loop = asyncio.get_running_loop()
        if len(self._waiting) >= MAX_WAITING:
            raise BusyError
        if len(request.tokens) <= _FEW:
            checked = self._manager.check(request)
        else:
            checked = await loop.run_in_executor(self._checker, self._manager.check, request)
        future: asyncio.Future[list[Receipt]] = loop.create_future()
        self._waiting.append((checked, future))
        if len(self._waiting) == 1:
            loop.call_soon(self._gather, _TURNS)
        return await future

    async def run(self, work: Callable[[], _Value]) -> _Value:
        """Return the value of a function that needs the manager for itself."""
        try:
            async with self._turn:
                return await asyncio.get_running_loop().run_in_executor(self._thread, work)
        finally:
            self._write()

    def close(self) -> None:
        """End the threads, after what they do."""
        self._checker.shutdown()
        self._thread.shutdown()

    def _gather(self, turns: int) -> None:
        """Let requests that have arrived together wait for one another; alone, one hardly waits."""
        if turns:
            asyncio.get_running_loop().call_soon(self._gather, turns - 1)
        else:
            self._write()

    def _write(self) -> None:
        """Let the manager take all requests that wait, unless the thread works."""
        if self._turn.locked() or not self._waiting:
            return
        batch, self._waiting = self._waiting, []
        requests = [request for request, _ in batch]
        if self._manager.takes_long:
            self._task = asyncio.create_task(self._write_long(batch, requests))
        else:
            _tell(batch, _taken(self._manager, requests))

    async def _write_long(self, batch: _Batch, requests: list[Checked]) -> None:
        _tell(batch, await self.run(lambda: _taken(self._manager, requests)))


def _taken(manager: TrustManager, requests: list[Checked]) -> Sequence[Any]:
    """Return the answer to each request, or the error that all have met."""
    try:
        return manager.take(requests)
    except Exception as error:
        return [error] * len(requests)


def _tell(batch: _Batch, answers: Sequence[Any]) -> None:
    """Give everybody their answer, who may have gone."""
    for (_, future), answer in zip(batch, answers, strict=True):
        if future.done():
            continue
        if isinstance(answer, Exception):
            future.set_exception(answer)
        else:
            future.set_result(answer)
