"""One writer for many requests that wait: what waits together is written together."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from roletrust_manager.http.manager import TrustManager
from roletrust_manager.http.requests import Checked, Receipt, RefusedError, Request
from roletrust_manager.journal.sql import StoreError

MAX_WAITING = 10_000
"""Number of requests that may wait."""

_FEW = 4  # tokens that are checked at once; more would let all others wait

_Value = TypeVar("_Value")
_Answer = list[Receipt] | RefusedError | StoreError


class BusyError(Exception):
    """Too many wait already."""


class RequestWriter:
    """Hands requests to a manager, in a thread of its own, all that wait at once, after the checks
    that need no turn.

    So the disk is waited for once for many requests, the more the busier it is (group commit:
    DeWitt et al., "Implementation Techniques for Main Memory Database Systems", 1984).
    """

    def __init__(self, manager: TrustManager) -> None:
        self._manager = manager
        self._thread = ThreadPoolExecutor(1, "writer")
        self._checker = ThreadPoolExecutor(1, "checker")
        self._waiting: list[tuple[Checked, asyncio.Future[_Answer]]] = []
        self._task: asyncio.Task[None] | None = None

    async def take(self, request: Request) -> list[Receipt]:
        """Return the receipts of a request, which is in the store then.

        Raises:
            RefusedError: The request is refused.
            StoreError: The store cannot be written.
            BusyError: Too many requests wait.
        """
        if len(self._waiting) >= MAX_WAITING:
            raise BusyError
        loop = asyncio.get_running_loop()
        if len(request.tokens) <= _FEW:
            checked = self._manager.check(request)
        else:
            checked = await loop.run_in_executor(self._checker, self._manager.check, request)
        future: asyncio.Future[_Answer] = loop.create_future()
        self._waiting.append((checked, future))
        if self._task is None:
            self._task = asyncio.create_task(self._work())
        answer = await future
        if isinstance(answer, Exception):
            raise answer
        return answer

    async def run(self, work: Callable[[], _Value]) -> _Value:
        """Return the value of a function that needs the manager for itself."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, work)

    def close(self) -> None:
        """End the threads, after what they do."""
        self._checker.shutdown()
        self._thread.shutdown()

    async def _work(self) -> None:
        while self._waiting:
            batch, self._waiting = self._waiting, []
            requests = [request for request, _ in batch]
            try:
                answers = await self.run(lambda: self._manager.take(requests))  # noqa: B023 - awaited here
            except Exception as error:
                for _, future in batch:
                    if not future.done():
                        future.set_exception(error)
            else:
                for (_, future), answer in zip(batch, answers, strict=True):
                    if not future.done():  # whoever asked may have gone
                        future.set_result(answer)
        self._task = None
