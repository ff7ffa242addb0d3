"""`roletrust serve --store` as a process: events, a restart, and an audit of its model."""

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
AUDIT = [
    "--same-agents",
    "--scale",
    "-10",
    "10",
    "--top",
    "2",
    "--budget",
    "4",
]


@contextmanager
def served(*options: object, model: str = "mean") -> Iterator[str]:
    """Start the command, and return its address; it has to end by a signal in order."""
    command = [
        *COMMAND,
        "serve",
        model,
        "--name",
        NAME,
        "--work",
        "2",
        "--port",
        "0",
        *map(str, options),
    ]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stderr is not None
        yield re.findall(r"http://\S+:\d+", process.stderr.readline())[0]
    finally:
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) in (0, -signal.SIGTERM)


def test_options_of_a_manager_need_a_store():
    said = CliRunner().invoke(app, ["serve", "mean", "--every", "5", "--work", "3"])
    assert said.exit_code == 2
    assert_names(said.output, "--every", "--work")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("no-model", "unknown trust model"),
        ("mean:lam=7", "lam is 7"),
        ("rev2 --scale 1 1", "the scale is from 1 to 1"),  # a model of `rate`
        ("mean --every 1e300", "every is 1e+300 s"),
        ("mean --name a/b", "'a/b' is no name"),
        ("mean --port {port}", "in use"),
    ],
)
def test_a_first_start_that_fails_leaves_nothing_behind(tmp_path: Path, arguments: str, words: str):
    with socket.create_server(("127.0.0.1", 0)) as used:
        command = f"serve {arguments.format(port=used.getsockname()[1])}".split()
        options = [] if "--port" in command else ["--port", "0"]
        said = CliRunner().invoke(
            app, [*command, *options, "--store", str(tmp_path / "trust.sqlite")]
        )
    assert words in " ".join((said.output + str(said.exception)).split())
    assert not list(tmp_path.iterdir())


def test_a_model_of_rate_is_served():
    message = '{"game": 1, "round": 0, "raters": 1, "providers": 1, "ratings": []}'
    said = CliRunner().invoke(app, ["serve", "fairness-goodness"], input=message)
    assert json.loads(said.output)["providers"] == [0.5]


@pytest.mark.slow
def test_a_manager_tells_of_rounds_and_goes_on_after_its_end(tmp_path: Path):
    ann, bob = Agent("ann", time.time), Agent("bob", time.time)
    with (
        served("--store", tmp_path / "trust.sqlite", "--every", 2) as url,
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
    with served("--store", tmp_path / "trust.sqlite", "--every", 2) as url:
        after = httpx2.get(f"{url}/agents").json()["agents"]
    for agent in (*before, *after):
        del agent["time"]
    assert after == before
