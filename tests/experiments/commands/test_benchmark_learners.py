"""`roletrust benchmark` with suites for learners."""

import pytest
from command_line import printed, run
from csv_files import csv_rows
from refusals import assert_names
from typer.testing import CliRunner

from roletrust_experiments.cli import app

SUITE = """
kind = "learners"
learners = ["CMA-ES"]
budgets = [2000, 4000]
games = 2
seeds = [0, 1]
[tasks.provider]
task = "ProviderAttack"
set = { max_cycles = 12, noise = 0.0, perturbations = [] }
"""
MINE = """
import numpy as np

class Always:
    def __init__(self, quality=0.5):
        self.quality = quality
    def learn(self, env, budget, seed):
        env.step(np.full(env.action_space.shape, self.quality, np.float32))
        return lambda seen: np.full((len(seen), 1), self.quality, np.float32)

class Greedy(Always):
    def learn(self, env, budget, seed):
        while True:
            super().learn(env, budget, seed)
"""

TINY = ["benchmark", "--suite", "tiny.toml", "--workers", "1"]


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tiny.toml").write_text(SUITE)
    (tmp_path / "my_learners.py").write_text(MINE)
    return tmp_path


def test_a_learner_of_ones_own_beside_the_suites(here, in_process):
    asked = ["all", "my_learners:Always:quality=0.4", "my_learners:Greedy"]
    result = printed(*TINY, *asked, "--out", "out", code=1)  # the greedy one plays more than it may
    told = result
    assert "provider: the bound" in told
    assert (
        "my_learners:Greedy|4000|0: 0 of 4000 rounds are left, and a step of 32 games needs more"
        in told
    )
    rows = {
        (row["task"], row["learner"], row["budget"]): row
        for row in csv_rows(here / "out" / "learners.csv")
    }
    assert {learner for _, learner, _ in rows} == {"CMA-ES", "my_learners:Always:quality=0.4"}
    cma = rows["provider", "CMA-ES", "4000"]
    assert cma["runs"] == "2"
    assert 0 < float(cma["share_low_95"]) <= float(cma["share"]) <= float(cma["share_high_95"]) <= 1
    assert rows["all tasks", "CMA-ES", "4000"]["share"] == cma["share"]
    before = {path.name: path.read_bytes() for path in (here / "out").glob("learners.*")}
    assert set(before) == {"learners.csv", "learners.md", "learners.png"}
    assert f"| 4,000 | `CMA-ES` | {float(cma['share']):.2f} [" in before["learners.md"].decode()
    run(*TINY, *asked, "--out", "out")
    assert {path.name: path.read_bytes() for path in (here / "out").glob("learners.*")} == before


def test_a_dry_run_tells_the_rounds(here):
    result = printed(*TINY, "--dry-run")
    assert "12,096" in result  # 2 x (2000 + 4000), and 2 x 2 x 2 games of 12 rounds
    assert not (here / "results").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--model", "mean"], ("--model",)),
        (["--attack", "on-off"], ("learners",)),
        (["PPOO"], ("PPOO", "PPO")),
        (["my_learners:MINE"], ("my_learners:MINE",)),
        (["os:system:command=touch hacked"], ("os:system",)),
        (
            ["--suite", "theirs.toml"],
            ("my_learners:Always",),
        ),
    ],
)
def test_what_cannot_be_played_is_refused(here, arguments, words):
    (here / "theirs.toml").write_text(SUITE.replace("CMA-ES", "my_learners:Always"))
    assert_names(printed("benchmark", "--suite", "tiny.toml", *arguments, code=2), *words)
    assert not (here / "results").exists()
    assert not (here / "hacked").exists()


def test_a_file_may_name_what_is_not_installed_if_the_user_says_so(here):
    (here / "theirs.toml").write_text(SUITE.replace("CMA-ES", "my_learners:Always"))
    arguments = ["benchmark", "--suite", "theirs.toml", "--allow-code", "--dry-run"]
    assert CliRunner().invoke(app, arguments).exit_code == 0
