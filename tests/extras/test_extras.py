"""Each extra stands alone: the built wheel, in a fresh environment for each. Minutes: `make
test-extras`."""

import os
import signal
import subprocess
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from fresh_environments import HELPS, HOUSE, PACKAGES, SMALL, Environment

pytestmark = pytest.mark.extras

TINY = f"""
models = ["mean", "role-trust"]
attacks = ["bad-mouthing"]
{SMALL}"""
COMPILED = """
import gymnasium
env = gymnasium.make("roletrust_env:RoleTrust/RaterAttack-v0", engine="compiled")
env.reset(seed=0)
print(env.step(env.action_space.sample())[1] > 0)
"""
SHORT = ("--set", "max_cycles=8")
ZOO = HOUSE / "agents" / "roletrust_agents" / "zoo" / "provider-3x3"


def test_the_wheel_holds_every_file(wheel: Path) -> None:
    held = set(zipfile.ZipFile(wheel).namelist())
    for package in PACKAGES:
        files = [
            path
            for path in (HOUSE / package).rglob("*")
            if path.is_file() and "__pycache__" not in path.parts
        ]
        assert {str(path.relative_to((HOUSE / package).parent)) for path in files} <= held
    assert {name.partition("/")[0] for name in held if ".dist-info/" not in name} == {
        package.rpartition("/")[2] for package in PACKAGES
    }


def test_the_library_alone(fresh: Callable[..., Environment]) -> None:
    alone = fresh()
    played = """
import gymnasium, roletrust_env
from roletrust_baselines import BadMouthing
env = roletrust_env.parallel_env("open-system", max_cycles=3)
env.reset(seed=0)
env.step({agent: env.action_space(agent).sample() for agent in env.agents})
task = gymnasium.make("RoleTrust/RaterAttack-v0", max_cycles=3)
task.reset(seed=0)
print(task.step(task.action_space.sample())[1] >= 0)
"""
    assert alone.python(played) == "True\n"
    missing = alone.python(
        "import roletrust_env\ntry: roletrust_env.AttackJaxEnv\nexcept Exception as error: "
        "print(error)"
    )
    assert "pip install 'roletrust-env[jax]'" in missing
    missing = alone.python(
        "import roletrust_env\ntry: roletrust_env.parallel_env(engine='compiled')\n"
        "except ValueError as error: print(error)"
    )
    assert "pip install 'roletrust-env[compiled]'" in missing
    for arguments in ([], ["--help"], ["play"]):
        assert "pip install 'roletrust-env[cli]'" in alone.refused(*arguments)


def test_jax(fresh: Callable[..., Environment]) -> None:
    played = """
import jax, optax, roletrust_env
env = roletrust_env.AttackJaxEnv(max_cycles=3)
_, state = jax.jit(env.reset)(jax.random.key(0))
print(env.step(jax.random.key(1), state, {"attacker": jax.numpy.ones(1)})[1].game.round)
"""
    assert fresh("jax").python(played) == "1\n"


def test_compiled(fresh: Callable[..., Environment]) -> None:
    assert fresh("compiled").python(COMPILED) == "True\n"


def test_cli(fresh: Callable[..., Environment]) -> None:
    cli = fresh("cli")
    for needed, arguments in (
        ("train", ["train", "ProviderAttack"]),
        ("train", ["list", "zoo"]),
        ("train", ["play", "--attack", f"sp_2=learned:path={ZOO}"]),
        ("vision", ["play", "paper-3x3-hog"]),
        ("vision", ["figures"]),
        ("robots", ["robots", "keys", "keys"]),
        ("manager", ["manager", "mcp", "http://127.0.0.1:9", "--name", "ann", "--keys", "keys"]),
        ("manager", ["manager", "serve", "mean", "trust.sqlite"]),
        ("train", ["benchmark", "mean", "--dry-run"]),
        ("train", ["report", "results.sqlite"]),
    ):
        assert f"pip install 'roletrust-env[{needed}]'" in cli.refused(*arguments)
    cli.python(HELPS)
    listed = cli.roletrust("list")
    assert all(
        name in listed for name in ("paper-3x3-hog", "role-trust", "bad-mouthing", "learned")
    )
    assert "first-hand" in cli.roletrust("benchmark")
    assert "damage" in cli.roletrust("play", *SHORT, "--attack", "sr_2=bad-mouthing", "--games", 2)
    assert "not ok" not in cli.roletrust("figures", "paper-3x3")


def test_mcp(fresh: Callable[..., Environment]) -> None:
    listed = """
import asyncio
from pathlib import Path
from mcp.client import Client
from roletrust_manager.http.client import TrustClient
from roletrust_manager.http.tools import make_tools
async def tools():
    async with Client(make_tools(TrustClient("http://127.0.0.1:9", "ann", Path("keys")))) as client:
        print(*(tool.name for tool in (await client.list_tools()).tools))
asyncio.run(tools())
"""
    assert fresh("manager").python(listed) == "register ask rate list_agents leave\n"


def test_serve(fresh: Callable[..., Environment]) -> None:
    described = """
from roletrust_manager.http.endpoints import make_app
from roletrust_manager.http.manager import TrustManager
from roletrust_manager.journal.sql import JournalStore
print(*make_app(TrustManager(JournalStore("trust.sqlite"), "mean")).openapi()["paths"])
"""
    paths = fresh("manager").python(described).split()
    assert {"/", "/agents", "/ratings", "/journal", "/checkpoint"} <= set(paths)


def test_cli_and_vision(fresh: Callable[..., Environment]) -> None:
    both = fresh("cli,vision")
    assert "not ok" not in both.roletrust("figures")
    assert "pip install 'roletrust-env[video]'" in both.refused("play", "--video")


def test_video(fresh: Callable[..., Environment]) -> None:
    video = fresh("video")
    assert "play.mp4" in video.roletrust("play", *SHORT, "--video")
    filmed = """
import gymnasium, roletrust_env, tempfile, pathlib
from gymnasium.wrappers import RecordVideo
folder = tempfile.mkdtemp()
env = RecordVideo(gymnasium.make("RoleTrust/RaterAttack-v0", max_cycles=3, render_mode="rgb_array"), folder)
env.reset(seed=0)
while not any(env.step(env.action_space.sample())[2:4]): pass
env.close()
print("frames in", *(path.name for path in pathlib.Path(folder).glob("*.mp4")))
"""  # noqa: E501
    assert "frames in rl-video-episode-0.mp4" in video.python(filmed)


def test_vision(fresh: Callable[..., Environment]) -> None:
    seen = """
import roletrust_env
env = roletrust_env.parallel_env("paper-3x3-hog", max_cycles=3)
env.reset(seed=0)
for _ in range(2):
    _, _, _, _, infos = env.step({agent: env.action_space(agent).high for agent in env.agents})
print(infos["sp_0"]["trust"] > 0.5)
"""
    assert fresh("vision").python(seen) == "True\n"


def test_torch(fresh: Callable[..., Environment]) -> None:
    tensors = """
import torch
from roletrust_env import JointPolicy, Game, make_scenario, record
game = Game(make_scenario("paper-3x3").change(max_cycles=3), like=torch.zeros(()))
print(*record(JointPolicy(game, {}), game.random(seed=0), batch=(2,)).tor.shape)
"""
    assert fresh("torch").python(tensors) == "3 3 2\n"


def test_logs(fresh: Callable[..., Environment]) -> None:
    """A frame goes in, frames come out, and a price."""
    lines = """
import pandas as pd
from roletrust_env.logs import audit, compare, rate, read, write_log
write_log("log.csv.gz")
rated = rate(pd.read_csv("log.csv.gz"), scale=(-10, 10), every=2_592_000, same_agents=True)
rated.explain("7")
prices = audit(rated, top=2, targets=1, budget=3).table
found = compare(rated.log, ["mean"]).measures
print(len(rated.ratees), len(rated.raters), len(prices), len(found))
"""
    assert fresh("logs").python(lines) == "104 112 4 12\n"


def test_train(fresh: Callable[..., Environment]) -> None:
    train = fresh("train")
    certain = (*SHORT, "--set", "noise=0", "--set", "perturbations=[]")
    small = ["--learner=PPO:games=8,n_steps=8,batch_size=32,n_epochs=1"]
    assert "Written to mine" in train.roletrust(
        "train", "ProviderAttack", *certain, *small, "--steps", 128, "--out", "mine"
    )
    assert "learned-provider" in train.roletrust(
        "play", *SHORT, "--attack", f"sp_2=learned:path={ZOO}"
    )
    assert train.python(COMPILED) == "True\n"
    benchmark_and_report(train)


def benchmark_and_report(alone: Environment) -> None:
    (alone.folder / "tiny.toml").write_text(TINY, encoding="utf-8")
    alone.roletrust("benchmark", "all", "--suite", "tiny.toml", "--workers", 1, "--out", "played")
    assert "Examples" in alone.roletrust("report", "--help")
    assert "report.html" in alone.roletrust("report", "played/results.sqlite", "--out", "page")
    page = (alone.folder / "page" / "report.html").read_text(encoding="utf-8")
    assert "roletrust benchmark mean role-trust --suite tiny.toml --out played" in page
    assert (alone.folder / "page" / "leaderboard.md").stat().st_size


def test_ray_and_logs(fresh: Callable[..., Environment]) -> None:
    lines = """
from roletrust_env.benchmarking import benchmark, load_suite
quick = load_suite("quick")
worlds = quick.worlds.model_copy(update={"selection": 1, "measured": 2})
suite = quick.model_copy(update={"worlds": worlds, "games": 1, "selection_games": 1})
frame = benchmark("mean", suite, workers=0, progress=False).to_pandas()
print(set(frame["missing"]))
"""
    alone = fresh("ray,logs")
    assert alone.python(lines) == "{0}\n"
    (alone.folder / "tiny.toml").write_text(TINY, encoding="utf-8")
    address = f"127.0.0.1:{20_000 + os.getpid() % 10_000}"
    options = [
        f"--port={address.split(':')[1]}",
        "--node-ip-address=127.0.0.1",
        "--num-cpus=2",
        "--block",
    ]
    options += [
        "--include-dashboard=false",
        "--disable-usage-stats",
        "--object-store-memory=100000000",
    ]
    around = {**os.environ, "PATH": f"{alone.path / 'bin'}{os.pathsep}{os.environ['PATH']}"}
    started = [alone.path / "bin" / "ray", "start", "--head", *options]
    head = subprocess.Popen(started, env=around, stdout=subprocess.DEVNULL, start_new_session=True)
    try:
        until = time.monotonic() + 240
        played = f"""
from roletrust_env.benchmarking import benchmark
from roletrust_env.benchmarking.cluster import Cluster
benchmark("all", "tiny.toml", workers=Cluster({address!r}), out="there", progress=False)
"""
        # The cluster may not have started yet.
        while "no Ray cluster answers" in (there := alone.run("python", "-c", played)).err:
            assert time.monotonic() < until, there.err
        assert there.code == 0, there.err
    finally:
        os.killpg(head.pid, signal.SIGTERM)
        head.wait(timeout=60)
    alone.roletrust("benchmark", "all", "--suite", "tiny.toml", "--out", "here")
    there, here = (
        (alone.folder / name / "leaderboard.csv").read_bytes() for name in ("there", "here")
    )
    assert there == here


def test_robots(fresh: Callable[..., Environment]) -> None:
    robots = fresh("robots")
    assert "Made in keys: manager, sr_0, sr_1, sr_2, sp_0" in robots.roletrust(
        "robots", "keys", "keys"
    )
    heard = """
import time
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.dds import Node
one, other = Node("one"), Node("other")
writer, reader = one.writer("/trust", messages.TRUST), other.reader("/trust", messages.TRUST)
while not (writer.readers and reader.writers):
    time.sleep(0.01)
print("met")
"""
    assert robots.python(heard) == "met\n"
    assert "roletrust robots demo" in robots.roletrust("robots", "--help")
    robots.roletrust("robots", "demo", "--set", "speed=4", "--no-view", "--out", "team")
    assert (robots.folder / "team" / "figure.png").exists()
