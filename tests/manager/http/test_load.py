"""1,000 acknowledged ratings in a second, each a request of its own, beside an endpoint that does
nothing."""

import asyncio
import gc
import socket
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import httpx2
import numpy as np
import pytest
import uvicorn
import uvloop
from fastapi import FastAPI
from load import offered, register
from postgres import postgres
from served import Served, served
from signing_agents import Agent

from roletrust_manager.http import answers

PER_S, SECONDS, BLOCKS, AGENTS = 1000, 2.0, 3, 100


def bare() -> None:
    """Serve an endpoint that takes and answers the same, and keeps nothing."""
    app = FastAPI()

    async def rate(body: answers.RatingTokens) -> answers.TokenReceipts:
        return answers.TokenReceipts(
            receipts=[answers.TokenReceipt(seq=1, time=time.time()) for _ in body.tokens]
        )

    app.add_api_route("/ratings", rate, methods=["POST"], status_code=201)
    with socket.create_server(("127.0.0.1", 0), backlog=1024) as listener:
        print(f"at http://127.0.0.1:{listener.getsockname()[1]}", file=sys.stderr, flush=True)
        uvicorn.Server(uvicorn.Config(app, log_level="warning", access_log=False)).run(
            sockets=[listener]
        )


@pytest.mark.slow
def test_a_thousand_ratings_a_second_are_acknowledged(tmp_path: Path):
    """All are acknowledged, at the rate that the machine has room for beside other tests; what they
    cost is checked.

    Rates and latencies are printed: `pytest -m slow -s tests/manager/http/test_load.py`.
    """
    agents = [Agent(f"a{n}", time.time) for n in range(AGENTS)]
    options = "--every", 2, "--set", "quota=100000"
    with ExitStack() as stack:
        servers = {
            "bare endpoint": stack.enter_context(served("none", function=bare)),
            "SQLite": stack.enter_context(served(tmp_path / "trust.sqlite", *options)),
            "PostgreSQL": stack.enter_context(served(stack.enter_context(postgres()), *options)),
        }
        managers = list(servers.values())[1:]
        for manager in managers:
            asyncio.run(register(manager.port, agents))
        found: dict[str, list[tuple[float, ...]]] = {name: [] for name in servers}
        gc.freeze()  # what the tests before have left is not looked at again and again
        for _ in range(BLOCKS):
            for name, server in servers.items():
                found[name].append(measured(server, agents))
        for manager in managers:
            assert httpx2.get(f"{manager.url}/").json()["ratings"] == PER_S * SECONDS * BLOCKS
    print(f"\n{'':16}answers/s   p50 ms   p99 ms, quartiles   CPU us, of the client")
    middle = {name: np.median(blocks, axis=0) for name, blocks in found.items()}
    for name, (rate, half, most, *cpu_us) in middle.items():
        low, high = np.quantile([block[2] for block in found[name]], [0.25, 0.75])
        print(
            f"{name:16}{rate:9.0f}{half:9.1f}{most:9.1f} {low:5.1f} "
            f"{high:5.1f}{cpu_us[0]:12.0f}{cpu_us[1]:12.0f}"
        )
    for name in ("SQLite", "PostgreSQL"):
        assert middle[name][3] < 10 * middle["bare endpoint"][3]  # it is 3 to 4 times as much


def measured(server: Served, agents: list[Agent]) -> tuple[float, ...]:
    """Acknowledged requests in a second, their latency, and the time that both sides compute for
    one, microseconds."""
    before = np.array([server.cpu_s, time.process_time()])
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        rate, latencies_s = runner.run(offered(server.port, agents, PER_S, SECONDS))
    cpu_s = np.array([server.cpu_s, time.process_time()]) - before
    return (rate, *(1e3 * np.quantile(latencies_s, [0.5, 0.99])), *(1e6 * cpu_s / len(latencies_s)))
