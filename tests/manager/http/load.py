"""Many agents that rate at once, on connections that cost little beside the manager."""

import asyncio
import json
import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from signing_agents import Agent

from roletrust_env.trust.key_index import Floats


class Connection(asyncio.Protocol):
    """A connection of HTTP that is kept, with one request at a time; no library is as cheap."""

    def __init__(self) -> None:
        self._answer: asyncio.Future[tuple[int, Any]] | None = None
        self._received = b""

    def connection_made(self, transport: Any) -> None:
        self._transport = transport

    def data_received(self, data: bytes) -> None:
        self._received += data
        head, _, body = self._received.partition(b"\r\n\r\n")
        length = head.lower().partition(b"content-length: ")[2].partition(b"\r\n")[0]
        if self._answer is not None and length and len(body) >= int(length):
            self._received = b""
            self._answer.set_result((int(head[9:12]), json.loads(body)))

    def connection_lost(self, error: Exception | None) -> None:
        if self._answer is not None and not self._answer.done():
            self._answer.set_exception(ConnectionError("no answer"))

    async def post(self, path: str, body: object) -> tuple[int, Any]:
        """Return the status and the body of the answer.

        Raises:
            ConnectionError: There is none.
        """
        text = json.dumps(body).encode()
        head = (
            f"POST {path} HTTP/1.1\r\nHost: m\r\nContent-Type: "
            f"application/json\r\nContent-Length: {len(text)}"
        )
        self._answer = asyncio.get_running_loop().create_future()
        if self._transport.is_closing():
            raise ConnectionError("the connection has ended")
        self._transport.write(head.encode() + b"\r\n\r\n" + text)
        return await self._answer


async def connected(port: int) -> Connection:
    """Return a connection to a manager on this machine."""
    return (await asyncio.get_running_loop().create_connection(Connection, "127.0.0.1", port))[1]


async def register(port: int, agents: Sequence[Agent]) -> None:
    """Let agents register."""
    connection = await connected(port)
    for agent in agents:
        status, answer = await connection.post("/agents", {"token": agent.registration(0)})
        assert status == 201, answer


class Latencies(NamedTuple):
    """What a load has come to.

    Attributes:
        answers: Number of acknowledged requests in a second.
        latencies_s: Time from when each request was due to its answer, seconds.
    """

    answers: float
    latencies_s: Floats


async def offered(port: int, agents: Sequence[Agent], per_s: float, seconds: float) -> Latencies:
    """Offer ratings at a steady rate, whether they are answered or not, each by the next agent that
    waits for none.

    A request that finds no agent waits for one, and the wait is counted (Tene, "How NOT to Measure
    Latency", 2013).
    """
    waiting: asyncio.Queue[tuple[Agent, Connection]] = asyncio.Queue()
    for agent in agents:
        waiting.put_nowait((agent, await connected(port)))
    number, start, latencies = round(per_s * seconds), time.perf_counter(), list[float]()

    async def rate(due: float, agent: Agent, connection: Connection) -> None:
        provider = agents[len(latencies) % len(agents)].name
        rated = (
            provider if provider != agent.name else agents[len(latencies) % len(agents) - 1].name
        )
        status, answer = await connection.post("/ratings", {"tokens": [agent.rating(rated, 0.7)]})
        assert status == 201, answer
        latencies.append(time.perf_counter() - due)
        waiting.put_nowait((agent, connection))

    async with asyncio.TaskGroup() as group:
        for turn in range(number):
            due = start + turn / per_s
            await asyncio.sleep(max(0.0, due - time.perf_counter()))
            group.create_task(rate(due, *await waiting.get()))
    return Latencies(number / (time.perf_counter() - start), np.array(latencies))
