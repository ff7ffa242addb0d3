"""Kills of a trust manager under load: what was acknowledged is there, once, and trust is that of
`roletrust rate`."""

import asyncio
import random
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import httpx2
import pytest
from command_line import printed
from csv_files import csv_rows
from load import connected, register
from postgres import crash, postgres
from served import Served, served
from signing_agents import Agent

from roletrust_manager.http.client import TrustClient

KILLS, CRASHES, RATERS = 20, 3, 12
LOAD_S = 0.1, 0.5  # until a kill


@pytest.fixture(params=["sqlite", "postgresql"])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    if request.param == "sqlite":
        yield str(tmp_path / "trust.sqlite")
    else:
        with postgres() as address:
            yield address


class Rater:
    """An agent that rates as fast as it is answered, and sends again what got no answer."""

    def __init__(self, name: str) -> None:
        self.agent, self._draw = Agent(name, time.time), random.Random(name)
        self._pending: list[str] = []
        self.acknowledged: dict[str, int] = {}
        self.refusals = 0

    async def rate(
        self, port: int, others: list[str], going: Callable[[], bool] = lambda: True
    ) -> None:
        """Rate as long as it goes on, or until there is no answer."""
        with suppress(ConnectionError):
            connection = await connected(port)
            while self._pending or going():
                self._pending = self._pending or self._ratings(others)
                status, answer = await connection.post("/ratings", {"tokens": self._pending})
                if status == 503:
                    self.refusals += 1
                    await asyncio.sleep(0.05)
                    continue
                assert status == 201, answer
                self.acknowledged |= zip(
                    self._pending, (one["seq"] for one in answer["receipts"]), strict=True
                )
                self._pending = []

    def _ratings(self, others: list[str]) -> list[str]:
        rated = self._draw.sample(others, self._draw.choice([2, 2, 4]))
        return [
            self.agent.rating(one, round(self._draw.random(), 3))
            for one in rated
            if one != self.agent.name
        ]


async def live(manager: Served, raters: list[Rater], newcomer: Agent, load_s: float) -> None:
    """Let a newcomer register and all others rate until the manager is killed."""
    await register(manager.port, [newcomer])
    names = [rater.agent.name for rater in raters]
    asyncio.get_running_loop().call_later(load_s, manager.process.kill)
    await asyncio.gather(*(rater.rate(manager.port, [*names, newcomer.name]) for rater in raters))
    manager.process.join()


@pytest.mark.slow
def test_nothing_acknowledged_is_lost_by_kills_under_load(store: str, tmp_path: Path):
    draw = random.Random(39)
    raters, newcomers = [Rater(f"a{n}") for n in range(RATERS)], []
    with served(store, "--every", 1) as manager:
        asyncio.run(register(manager.port, [rater.agent for rater in raters]))
    for kill in range(KILLS):
        newcomers.append(Agent(f"n{kill}", time.time))
        with served(store, "--every", 1) as manager:
            asyncio.run(live(manager, raters, newcomers[-1], draw.uniform(*LOAD_S)))
    with (
        served(store, "--every", 1) as manager,
        httpx2.Client(base_url=manager.url) as client,
    ):
        for rater in raters:  # what got no answer
            asyncio.run(rater.rate(manager.port, [], lambda: False))
        while (about := client.get("/").json())["counted"] < about["ratings"]:
            time.sleep(0.1)
        agents = client.get("/agents?limit=1000").json()["agents"]
        TrustClient(manager.url).export(tmp_path / "export.csv")
    assert check_export(tmp_path / "export.csv", raters) == about["ratings"] > KILLS * RATERS
    assert {one["name"] for one in agents} == {
        one.name for one in [*(rater.agent for rater in raters), *newcomers]
    }
    print(f"{KILLS} kills, {about['ratings']} acknowledged ratings, none lost")
    check_rate(tmp_path, agents)


@pytest.mark.slow
def test_nothing_acknowledged_is_lost_when_the_database_is_killed(tmp_path: Path):
    raters = [Rater(f"a{n}") for n in range(RATERS)]
    names = [rater.agent.name for rater in raters]

    async def crash_often() -> None:
        for _ in range(CRASHES):
            await asyncio.sleep(0.5)
            await asyncio.to_thread(crash, store)

    async def rate(port: int) -> None:
        await register(port, [rater.agent for rater in raters])
        crashes = asyncio.create_task(crash_often())
        await asyncio.gather(
            crashes, *(rater.rate(port, names, lambda: not crashes.done()) for rater in raters)
        )

    with postgres() as store, served(store, "--set", "quota=100000") as manager:
        asyncio.run(rate(manager.port))
        TrustClient(manager.url).export(tmp_path / "export.csv")
    assert check_export(tmp_path / "export.csv", raters) > RATERS
    assert sum(rater.refusals for rater in raters) >= CRASHES


def check_export(path: Path, raters: list[Rater]) -> int:
    """Check that an export has all acknowledged ratings, once and in order, and no others; return
    their number."""
    kept = [row["token"] for row in csv_rows(path)]
    acknowledged = {token: seq for rater in raters for token, seq in rater.acknowledged.items()}
    assert len(kept) == len(set(kept)) == len(acknowledged)
    assert kept == sorted(acknowledged, key=acknowledged.__getitem__)
    return len(kept)


def check_rate(folder: Path, agents: list[dict[str, Any]]) -> None:
    """Check that `roletrust rate` has the same trust and evidence of the export."""
    options = "--model", "role-trust", "--every", "1", "--out", str(folder)
    printed("rate", folder / "export.csv", "--set", "same_agents=true", *options)
    for role, file, others in (
        ("provider", "ratees.csv", "raters"),
        ("rater", "raters.csv", "ratees"),
    ):
        ours = {one["name"]: one[role] for one in agents if one[role]["rank"]}
        found = {row["name"]: row for row in csv_rows(folder / file)}
        assert ours.keys() == found.keys()
        for name, row in found.items():
            one = ours[name]
            assert (one["ratings"], one["agents"]) == (int(row["ratings"]), int(row[others]))
            for field in ("trust", "independent"):
                assert f"{one[field]:.6f}" == row[field]
