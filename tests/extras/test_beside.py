"""The installed wheel beside what others have: folders named like those of the repository, and a
plug-in package."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from csv_files import csv_rows
from fresh_environments import HELPS, HOUSE, SMALL, Environment
from test_outside import ATTACK, MODEL

pytestmark = pytest.mark.extras

LEARNER = '''
import numpy as np


class Steady:
    """Plays one quality in every round."""

    def __init__(self, quality: float = 0.4) -> None:
        self.quality = quality

    def learn(self, env, budget, seed):
        env.step(np.full(env.action_space.shape, self.quality, np.float32))
        return lambda seen: np.full((len(seen), 1), self.quality, np.float32)
'''
PROJECT = """
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"
[project]
name = "village"
version = "1.0"
[project.entry-points."roletrust_env.trust_models"]
grudge = "village.grudge:Grudge"
[project.entry-points."roletrust_env.attackers"]
gossip = "village.gossip:Gossip"
[project.entry-points."roletrust_env.learners"]
steady = "village.steady:Steady"
"""
MODELS = f"""
models = ["mean", "grudge"]
attacks = ["gossip"]
{SMALL}"""
LEARNERS = """
kind = "learners"
learners = ["steady"]
budgets = [200]
games = 2
[tasks.provider]
task = "ProviderAttack"
set = { max_cycles = 12, noise = 0.0, perturbations = [] }
"""
SHORT = ("--set", "max_cycles=8")


def put(folder: Path, **files: str) -> None:
    """Write files, named by their stems."""
    folder.mkdir(parents=True)
    for stem, text in files.items():
        (folder / f"{stem}.py").write_text(text, encoding="utf-8")


def beside_packages_of_the_same_name(environment: Environment) -> None:
    """Give the working folder packages of the user's own, named like the folders of the
    repository."""
    for name in ("agents", "baselines", "experiments"):
        put(
            environment.folder / name,
            __init__=f"OWNER = 'the user: {name}'\n",
            cli="raise SystemExit('not ours')\n",
        )


def test_folders_named_like_those_of_the_repository_are_the_users_own(
    fresh: Callable[..., Environment],
) -> None:
    user = fresh("cli")
    beside_packages_of_the_same_name(user)
    readme = (HOUSE / "README.md").read_text(encoding="utf-8")
    (loop,) = (
        block
        for block in re.findall(r"^```python\n(.*?)^```$", readme, re.M | re.S)
        if "while env" in block
    )
    assert "'sr_2'" in user.python(loop)
    own = (
        "import agents, baselines, experiments; print(agents.OWNER, baselines.OWNER, "
        "experiments.OWNER)"
    )
    assert user.python(own) == "the user: agents the user: baselines the user: experiments\n"
    assert "Usage: roletrust" in user.roletrust("--help")
    user.python(HELPS)
    assert "bad-mouthing" in user.roletrust("list")
    assert "damage" in user.roletrust("play", *SHORT, "--attack", "sr_2=bad-mouthing", "--games", 2)


def test_a_package_of_plug_ins_is_listed_plays_and_enters_the_benchmark(
    fresh: Callable[..., Environment], tmp_path: Path
) -> None:
    """It is known by its entry points only, and nothing of it is in the repository."""
    user = fresh("train")
    beside_packages_of_the_same_name(user)
    put(tmp_path / "project" / "village", __init__="", grudge=MODEL, gossip=ATTACK, steady=LEARNER)
    (tmp_path / "project" / "pyproject.toml").write_text(PROJECT, encoding="utf-8")
    user.install(str(tmp_path / "project"))
    listed = user.roletrust("list")
    for name in ("grudge", "gossip", "steady"):
        assert name in listed
    assert "gossip" in user.roletrust(
        "play", *SHORT, "--model", "grudge", "--attack", "sr_2=gossip", "--games", 2
    )
    assert [path.name for path in (user.folder / "results").iterdir()] == ["play"]
    for name, text, every in (("models", MODELS, ["all"]), ("learners", LEARNERS, [])):
        (user.folder / f"{name}.toml").write_text(text, encoding="utf-8")
        suite = ("--suite", f"{name}.toml")
        user.roletrust("benchmark", *every, *suite, "--workers", 1, "--out", name)
    board = {row["model"]: row for row in csv_rows(user.folder / "models" / "leaderboard.csv")}
    assert board.keys() == {"mean", "grudge"}
    assert {row["worst_attack"] for row in board.values()} <= {"honest", "gossip"}
    shares = {row["learner"]: row for row in csv_rows(user.folder / "learners" / "learners.csv")}
    assert float(shares["steady"]["share"]) > 0
    called = """
from roletrust_env.benchmarking import benchmark
board = benchmark(["mean", "grudge"], "models.toml", attacks=["gossip"], workers=1, progress=False)
print(sorted(row.model for row in board.rows), {row.missing for row in board.rows})
"""
    (user.folder / "three_lines.py").write_text(called, encoding="utf-8")
    script = str(user.folder / "three_lines.py")
    run = f"import runpy; runpy.run_path({script!r}, run_name='__main__')"
    assert user.python(run) == "['grudge', 'mean'] {0}\n"
