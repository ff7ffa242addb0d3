"""A trust manager that runs: the app on a port of this machine, in a thread, with a clock of its
own."""

import asyncio
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager

import uvicorn

from roletrust_manager.http.manager import TrustManager
from roletrust_manager.http.requests import Settings
from roletrust_manager.journal.sql import JournalStore


class Clock:
    """The clock of the machine, as the client and the manager see it: `late` seconds ahead."""

    def __init__(self, monkeypatch):
        real = time.time_ns
        self.late = 0.0
        monkeypatch.setattr(time, "time_ns", lambda: real() + round(self.late * 1e9))

    def __call__(self):
        return time.time_ns() / 1e9


class Between:
    """What stands between a client and a manager, such as a proxy.

    Attributes:
        before: What happens to the next requests before the manager has them: a delay or a status
            in its place.
        after: What happens to the next answers.
    """

    def __init__(self, app):
        self.app, self.before, self.after = app, [], []

    async def __call__(self, scope, receive, send):
        if (
            self.before
            and scope["type"] == "http"
            and await self.replaced(self.before.pop(0), send)
        ):
            return
        if self.after and scope["type"] == "http":
            answer = []

            async def keep(message):
                answer.append(message)

            await self.app(scope, receive, keep)
            if not await self.replaced(self.after.pop(0), send):
                for message in answer:
                    await send(message)
            return
        await self.app(scope, receive, send)

    async def replaced(self, what, send):
        if isinstance(what, float):
            await asyncio.sleep(what)
            return False
        await send({"type": "http.response.start", "status": what, "headers": []})
        await send({"type": "http.response.body", "body": b"<html>"})
        return True


@contextmanager
def manager(path, clock) -> Iterator[TrustManager]:
    """Open a manager on a scale of five stars, with rounds of ten minutes."""
    settings = Settings(every=600.0, work=4, scale=(1.0, 5.0))
    with closing(TrustManager(JournalStore(str(path)), "role-trust", settings, clock)) as kept:
        yield kept


@contextmanager
def running(app, port: int = 0) -> Iterator[str]:
    """Serve an app, and return its address."""
    server = uvicorn.Server(
        uvicorn.Config(app, port=port, log_level="warning", timeout_graceful_shutdown=1)
    )
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started:
        thread.join(0.01)
        assert thread.is_alive()
    yield f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}"
    server.should_exit = True
    thread.join()
