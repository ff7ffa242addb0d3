"""The wheel with the oldest releases that `pyproject.toml` allows, and with the newest on each
Python that it names."""

import os
import re
import subprocess
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from fresh_environments import HOUSE, PINNED, Environment
from test_extras import SHORT, benchmark_and_report

pytestmark = pytest.mark.extras

PROJECT = tomllib.loads((HOUSE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PYTHONS = [line.rpartition(" ")[2] for line in PROJECT["classifiers"] if ":: Python :: 3." in line]
TORCH = re.search(r"^torch==.*$", PINNED.read_text(encoding="utf-8"), re.MULTILINE)[
    0
]  # the build for CPUs
EVERYTHING = "all,jax"
IMPORTED = """
import importlib, pkgutil
other = "cluster", "__main__", "roletrust_env.live", "roletrust_env.service"  # Ray, and what moved
for package in ("env", "agents", "baselines", "experiments", "manager"):
    package = importlib.import_module(f"roletrust_{package}")
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        if not module.name.endswith(other) and "roletrust_nodes" not in module.name:  # ROS 2
            importlib.import_module(module.name)
"""
LOG = "from roletrust_env.logs import write_log; write_log('log.csv.gz')"
MEMBERS = "--set", "same_agents=true", "--scale", -10, 10
PLAYED = """
import gymnasium, pettingzoo, roletrust_env
env = pettingzoo.make("parallel", "RoleTrust-v0", max_cycles=3)
env.reset(seed=0)
while env.agents:
    env.step({agent: env.action_space(agent).sample() for agent in env.agents})
games = gymnasium.make_vec("RoleTrust/RaterAttack-v0", num_envs=2, max_cycles=3)
games.reset(seed=0)
print(games.step(games.action_space.sample())[1].shape)
"""
SERVED = """
import threading, time, uvicorn
from pathlib import Path
from roletrust_manager.http.client import TrustClient
from roletrust_manager.http.endpoints import make_app
from roletrust_manager.http.manager import TrustManager
from roletrust_manager.http.requests import Settings
from roletrust_manager.journal.sql import JournalStore
app = make_app(TrustManager(JournalStore("trust.sqlite"), "role-trust", Settings(work=4)))
server = uvicorn.Server(uvicorn.Config(app, port=0, log_level="error"))
threading.Thread(target=server.run, daemon=True).start()
while not server.started:
    time.sleep(0.01)
url = "http://127.0.0.1:%d" % server.servers[0].sockets[0].getsockname()[1]
for name in ("bob", "ann"):
    with TrustClient(url, name, Path("keys")) as client:
        client.register()
        if name == "ann":
            print(client.rate("bob", 0.9).seq > 0)
server.should_exit = True
"""


def minima(extras: str) -> Iterator[str]:
    """The oldest allowed release of each requirement of the package and its extras."""
    optional = PROJECT["optional-dependencies"]
    for line in [
        *PROJECT["dependencies"],
        *(line for extra in extras.split(",") for line in optional[extra]),
    ]:
        if own := re.fullmatch(r"roletrust-env\[(.*)\]", line):
            yield from minima(own[1])
        else:
            yield "==".join(re.match(r"([\w.-]+)(?:\[.*\])?>=([\d.]+)", line).groups())


def interpreter(version: str) -> str:
    """Path of a Python on this machine, also of one that pyenv keeps."""
    command = [f"python{version}", "-c", "import sys; print(sys.executable)"]
    try:
        done = subprocess.run(
            command, env={**os.environ, "PYENV_VERSION": version}, capture_output=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        pytest.skip(f"there is no Python {version} here")
    return done.stdout.decode().strip()


def check(environment: Environment) -> None:
    """Use each part of the library that needs other packages; learners only where there is
    torch."""
    assert environment.python(PLAYED) == "(2,)\n"
    environment.roletrust("play", *SHORT, "--attack", "sr_2=bad-mouthing", "--games", 2)
    environment.python(LOG)
    environment.roletrust("compare", "log.csv.gz", *MEMBERS, "--model", "mean", "--out", "measured")
    environment.roletrust("rate", "log.csv.gz", *MEMBERS, "--out", "trust")
    assert environment.python(SERVED) == "True\n"
    assert "Made in keys" in environment.roletrust("robots", "keys", "keys")


def test_the_oldest_releases(fresh: Callable[..., Environment], tmp_path: Path) -> None:
    oldest = tmp_path / "oldest.txt"
    oldest.write_text("\n".join(sorted(set(minima(EVERYTHING)))), encoding="utf-8")
    environment = fresh(EVERYTHING, oldest)
    environment.python(IMPORTED)
    check(environment)
    benchmark_and_report(environment)


@pytest.mark.parametrize("version", PYTHONS)
def test_the_newest_releases(
    version: str, fresh: Callable[..., Environment], tmp_path: Path
) -> None:
    """Without constraints but for torch, of which the newest has CUDA; with torch and what needs it
    on one Python."""
    torch = tmp_path / "torch.txt"
    torch.write_text(TORCH, encoding="utf-8")
    first = version == PYTHONS[0]
    environment = fresh(
        EVERYTHING if first else "video,logs,robots,manager", torch, interpreter(version)
    )
    check(environment)
    if first:
        environment.python(IMPORTED)
        benchmark_and_report(environment)


@pytest.mark.skipif(not (HOUSE / ".git").exists(), reason="this is no clone")
def test_the_same_commit_gives_the_same_wheel_and_source(tmp_path: Path) -> None:
    tools = Environment(tmp_path / "tools")
    for name in ("build", "hatchling", "twine"):
        tools.install(name)
    sums = []
    for name, mask, zone in (("one", 0o022, "UTC"), ("two", 0o077, "Asia/Tokyo")):
        made = (
            "make",
            "-o",
            ".venv/.ready-release",
            "dist",
            f"BIN={tools.path / 'bin'}",
            f"DIST={tmp_path / name}",
        )
        around = {**os.environ, "TZ": zone}
        subprocess.run(made, cwd=HOUSE, env=around, umask=mask, check=True, capture_output=True)
        sums.append((tmp_path / name / "SHA256SUMS").read_text())
    assert sums[0] == sums[1]
    assert len(sums[0].splitlines()) == 2
