"""One writer for many requests that wait: what waits together is written together."""

import asyncio
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any, TypeVar

from roletrust_manager.http.manager import TrustManager
from roletrust_manager.http.requests import Checked, Receipt, Request

MAX_WAITING = 10_000
"""Number of requests that may wait."""

_FEW = 4  # tokens that are checked at once; more would let all others wait

_Value = TypeVar("_Value")
_Turn = tuple[asyncio.Future[Any], Checked | Callable[[], Any]]


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
        self._checker = ThreadPoolExecutor(1, "checker")
        self._turns: SimpleQueue[_Turn | None] = SimpleQueue()
        self._thread = Thread(target=self._work, name="writer", daemon=True)
        self._thread.start()

    async def take(self, request: Request) -> list[Receipt]:
        """Return the receipts of a request, which is in the store then.

        Raises:
            RefusedError: The request is refused.
            StoreError: The store cannot be written.
            BusyError: Too many requests wait.
        """
        if self._turns.qsize() >= MAX_WAITING:
            raise BusyError
        if len(request.tokens) <= _FEW:
            checked = self._manager.check(request)
        else:
            loop = asyncio.get_running_loop()
            checked = await loop.run_in_executor(self._checker, self._manager.check, request)
        receipts: list[Receipt] = await self._turn(checked)
        return receipts

    async def run(self, work: Callable[[], _Value]) -> _Value:
        """Return the value of a function that needs the manager for itself."""
        value: _Value = await self._turn(work)
        return value

    def close(self) -> None:
        """End the threads, after what they do."""
        self._checker.shutdown()
        self._turns.put(None)
        self._thread.join()

    async def _turn(self, what: Checked | Callable[[], Any]) -> Any:
        future = asyncio.get_running_loop().create_future()
        self._turns.put((future, what))
        return await future

    def _work(self) -> None:
        """Take all turns that wait, until the end."""
        while (turn := self._turns.get()) is not None:
            turns: list[_Turn | None] = [turn]
            with suppress(Empty):
                while turns[-1] is not None:
                    turns.append(self._turns.get_nowait())
            if turns[-1] is None:
                self._turns.put(turns.pop())
            waiting = [turn for turn in turns if turn is not None]
            requests = [what for _, what in waiting if isinstance(what, Checked)]
            taken = iter(_tried(lambda: self._manager.take(requests), len(requests)))  # noqa: B023
            answers = [
                (future, next(taken) if isinstance(what, Checked) else _tried(what)[0])
                for future, what in waiting
            ]
            with suppress(RuntimeError):  # the loop has ended
                turn[0].get_loop().call_soon_threadsafe(_answer, answers)


def _tried(work: Callable[[], Any], many: int | None = None) -> Sequence[Any]:
    """Return so many results of a function, or its error for each; None for one result."""
    try:
        results = work() if many != 0 else []
    except Exception as error:
        return [error] * (many or 1)
    return [results] if many is None else results


def _answer(answers: Sequence[tuple[asyncio.Future[Any], Any]]) -> None:
    """Give everybody their answer, who may have gone."""
    for future, answer in answers:
        if future.done():
            continue
        if isinstance(answer, Exception):
            future.set_exception(answer)
        else:
            future.set_result(answer)
