"""`roletrust train` takes every trust model."""

import pytest

pytest.importorskip("sb3_contrib")

from typer.testing import CliRunner

from roletrust_agents.learned.saved import load_attacker
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.trust import trust_models
from roletrust_experiments.cli import app

TASK = ["RaterAttack", "--set", "max_cycles=4"]
LEARNER = ["--learner", "PPO:games=2,hidden=[4],n_steps=4,n_epochs=1"]


def run(command, name, *arguments):
    result = CliRunner().invoke(app, [command, *TASK, "--model", name, *map(str, arguments)])
    assert result.exit_code == 0, result.output


QUICK = ("role-trust", "own-experience", "median")  # central, personal, and one that jumps


@pytest.mark.parametrize(
    "name",
    [pytest.param(one, marks=() if one in QUICK else pytest.mark.slow) for one in trust_models()],
)
def test_an_attacker_learns_against_it_and_is_saved_with_it(tmp_path, name):
    run("train", name, *LEARNER, "--steps", 8, "--out", tmp_path)
    attacker = load_attacker(tmp_path)
    assert attacker.card.trust_model.name == name
    game = attacker.task().game
    assert game.model == parse_trust_model(name, game.scenario)
