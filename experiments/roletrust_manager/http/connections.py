"""Connections of strangers: what uvicorn leaves without a limit."""

from asyncio import TimerHandle
from collections.abc import Callable
from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

_MOST_HEAD = 64_000  # bytes that may come before the headers of a request have ended
_MOST_WAITING = 100  # requests that may be sent ahead of the answers
_ARRIVAL_S = 30.0  # for a request, from the connection or its first byte
_READING_S = 10.0  # for what a connection has not read yet, some 64,000 bytes


def limited_protocol(refuse: Callable[[], object]) -> type[Any]:
    """Return the protocol of connections: HTTP by uvicorn with limits, at which a connection is
    cut.

    Without them, one stranger could fill the memory of a manager with headers, with requests that
    wait and with answers that it does not read, or its table of files with requests that never end.

    Args:
        refuse: Function that counts a refusal.
    """

    class LimitedProtocol(HttpToolsProtocol):  # type: ignore[misc]
        _head = 0
        _deadline: TimerHandle | None = None
        _reading: TimerHandle | None = None
        _cycles: tuple[Any, ...] = ()  # requests without a whole answer

        def connection_made(self, transport: Any) -> None:
            super().connection_made(transport)
            self._await_request()

        def connection_lost(self, error: Exception | None) -> None:
            self._end()
            super().connection_lost(error)

        def pause_writing(self) -> None:
            super().pause_writing()
            self._reading = self.loop.call_later(_READING_S, self._cut)

        def resume_writing(self) -> None:
            self._has_read()
            super().resume_writing()

        def data_received(self, data: bytes) -> None:
            self._head += len(data)
            super().data_received(data)
            if self._head > _MOST_HEAD or len(self.pipeline) > _MOST_WAITING:
                self._cut()

        def on_message_begin(self) -> None:
            self._await_request()
            super().on_message_begin()

        def on_headers_complete(self) -> None:
            self._head = 0
            super().on_headers_complete()
            if self.cycle is not None:
                self._cycles = (
                    *(cycle for cycle in self._cycles if not cycle.response_complete),
                    self.cycle,
                )

        def on_body(self, body: bytes) -> None:
            self._head = 0
            super().on_body(body)

        def on_message_complete(self) -> None:
            self._head = 0
            self._arrived()
            super().on_message_complete()

        def _await_request(self) -> None:
            self._arrived()
            self._deadline = self.loop.call_later(_ARRIVAL_S, self._cut)

        def _arrived(self) -> None:
            if self._deadline is not None:
                self._deadline.cancel()

        def _has_read(self) -> None:
            if self._reading is not None:
                self._reading.cancel()

        def _end(self) -> None:
            """End all requests; uvicorn ends the newest only, and another one would write an error
            to the log.
            """
            self._arrived()
            self._has_read()
            for cycle in self._cycles:
                cycle.disconnected = True
                cycle.message_event.set()

        def _cut(self) -> None:
            if not self.transport.is_closing():
                refuse()
                self._end()
                self.transport.abort()

    return LimitedProtocol
