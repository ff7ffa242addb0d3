"""`roletrust manager serve` as a process: events, and a restart."""

import json
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx2
import pytest
from refusals import assert_names
from signing_agents import NAME, Agent
from typer.testing import CliRunner

from roletrust_experiments.cli import app

COMMAND = [sys.executable, "-c", "from roletrust_experiments import main; main()"]


@contextmanager
def served(store: Path) -> Iterator[str]:
    """Start the command, and return its address; it has to end by a signal in order."""
    command = [
        *COMMAND,
        *("manager", "serve", "mean", str(store), "--name", NAME),
        *("--port", "0", "--every", "2", "--set", "work=2"),
    ]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stderr is not None
        yield re.findall(r"http://\S+:\d+", process.stderr.readline())[0]
    finally:
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) in (0, -signal.SIGTERM)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("no-model", ("no-model",)),
        ("mean:lam=7", ("lam", "7")),
        ("rev2 --set scale=[1,1]", ("scale", "1")),  # a model of `rate`
        ("mean --set scale=[1,2,3]", ("scale", "1, 2, 3")),
        ("mean --every 1e300", ("every", "1e+300")),
        ("mean --every 0.5", ("every", "0.5")),
        ("mean --set tolerance=nan", ("tolerance", "nan")),
        ("mean --set work=65", ("work", "65")),
        ("mean --set quota=0", ("quota", "0")),
        ("mean --set same_agents=7", ("same_agents", "7")),
        ("mean --set wrok=3", ("wrok", "work")),
        ("mean --name a/b", ("a/b",)),
        ("mean --port {port}", ("in use",)),
    ],
)
def test_a_first_start_that_fails_leaves_nothing_behind(
    tmp_path: Path, arguments: str, words: tuple[str, ...]
):
    with socket.create_server(("127.0.0.1", 0)) as used:
        model, *options = arguments.format(port=used.getsockname()[1]).split()
        port = [] if "--port" in options else ["--port", "0"]
        store = str(tmp_path / "trust.sqlite")
        said = CliRunner().invoke(app, ["manager", "serve", model, store, *options, *port])
    assert said.exit_code == 2, said.output
    assert said.output.count("\n") == 1
    assert_names(said.output, *words)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_manager_tells_of_rounds_and_goes_on_after_its_end(tmp_path: Path):
    ann, bob = Agent("ann", time.time), Agent("bob", time.time)
    with (
        served(tmp_path / "trust.sqlite") as url,
        httpx2.Client(base_url=url) as client,
    ):
        for agent in (ann, bob):
            assert client.post("/agents", json={"token": agent.registration()}).status_code == 201
        with client.stream("GET", "/events", timeout=30) as events:
            lines = events.iter_lines()
            assert next(lines).startswith(":")
            assert (
                httpx2.post(f"{url}/ratings", json={"tokens": [ann.rating("bob", 1)]}).status_code
                == 201
            )
            found = next(
                json.loads(line.removeprefix("data: "))
                for line in lines
                if line.startswith("data: ")
            )
        assert found["provider"] == {"bob": client.get("/agents/bob").json()["provider"]["trust"]}
        assert found["round"] == 1
        before = client.get("/agents").json()["agents"]
    with served(tmp_path / "trust.sqlite") as url:
        after = httpx2.get(f"{url}/agents").json()["agents"]
    for agent in (*before, *after):
        del agent["time"]
    assert after == before
