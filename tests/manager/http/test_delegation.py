"""Agents and a manager as processes of their own: the example of the guide, and a manager that is
killed."""

import asyncio
import os
import subprocess
import sys
from pathlib import Path

import delegation
import pytest
from mcp.client import Client
from mcp.client.stdio import StdioServerParameters
from pages import HOUSE, blocks
from refusals import assert_names
from served import served

ROUNDS = "--every", 1  # seconds


@pytest.mark.parametrize("url", ["http://127.0.0.1:9", "127.0.0.1:9"])
@pytest.mark.parametrize("options", [[], ["--work", "bob"]])
def test_an_example_without_a_manager_ends_with_one_line(tmp_path, url, options):
    done = subprocess.run(
        [sys.executable, HOUSE / "docs/guide/delegation.py", url, "--keys", tmp_path, *options],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    assert done.stdout == ""
    assert_names(done.stderr, url)
    assert not list(tmp_path.iterdir())


@pytest.fixture
def programs(monkeypatch):
    """Find the command `roletrust` of this environment."""
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")


@pytest.mark.slow
@pytest.mark.usefixtures("programs")
def test_the_consumer_finds_the_better_worker(tmp_path):
    with served(tmp_path / "trust.sqlite", *ROUNDS) as manager:
        chosen = delegation.main(
            [manager.url, "--keys", str(tmp_path / "keys"), "--tasks", "4", "--pause", "3"]
        )
    assert chosen == ["bob", "eve", "bob", "bob"]


@pytest.mark.slow
@pytest.mark.usefixtures("programs")
def test_the_agents_of_the_guide_rate_and_find_an_omission(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    with served(tmp_path / "trust.sqlite", *ROUNDS) as manager:
        for block in blocks(HOUSE / "docs/guide/manager.md", "python"):
            exec(block.replace("http://127.0.0.1:8000", manager.url), names)
    first, second = capsys.readouterr().out.splitlines()
    assert "trust=0.5" in first
    assert second == "the checkpoint has 4 events, the export has 3"


@pytest.mark.slow
@pytest.mark.usefixtures("programs")
def test_tools_outlive_the_manager(tmp_path):
    """It is killed between a rating and its repetition, and nothing that was acknowledged is
    lost."""
    store, keys = tmp_path / "trust.sqlite", str(tmp_path / "keys")

    async def use(manager):
        def tools(name):
            return Client(
                StdioServerParameters(
                    command="roletrust",
                    args=["manager", "mcp", manager.url, "--name", name, "--keys", keys],
                )
            )

        async with tools("ann") as ann, tools("bob") as bob:
            for one in (ann, bob):
                await delegation.call(one, "register")
            first = await delegation.call(ann, "rate", name="bob", rating=0.9)
            manager.process.kill()
            manager.process.join()
            again = asyncio.create_task(delegation.call(ann, "rate", name="bob", rating=0.8))
            await asyncio.sleep(0.5)
            with served(store, *ROUNDS, "--port", manager.port):
                second = await again
                await asyncio.sleep(1.5)
                found = await delegation.call(bob, "ask", name="bob")
            return first, second, found["provider"]

    with served(store, *ROUNDS) as manager:
        first, second, trust = asyncio.run(use(manager))
    assert second["seq"] == first["seq"] + 1
    assert (trust["ratings"], trust["agents"]) == (2, 1)
