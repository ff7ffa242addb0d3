"""The README's own texts, run as they stand."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agents.ladder.rungs import find
from experiments.benchmark.learners.learner import Entered, Learner
from experiments.benchmark.learners.suite import Task
from roletrust_env import Cast, Game, load_scenario, make_scenario
from roletrust_env.game.rollout import record

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


@pytest.fixture(scope="module")
def said() -> dict[str, Any]:
    """What is defined after the Python blocks ran, one after the other."""
    names: dict[str, Any] = {"__name__": "readme"}
    for block in blocks("python"):
        exec(compile(block, "README.md", "exec"), names)
    return names


def test_the_first_loop_shows_the_liar(said):
    trust = {agent: info["trust"] for agent, info in said["infos"].items()}
    assert trust["sr_2"] < trust["sr_0"] < 0.7


def test_the_batch_shows_the_closed_form(said):
    np.testing.assert_allclose(said["history"].tor[-1, :, 0], 1 - np.sqrt([1 / 6, 1 / 6, 1 / 3]), atol=1e-6)


def test_tensors_show_the_same(said):
    np.testing.assert_allclose(said["history_of_tensors"].tor, said["history"].tor, atol=1e-5)


def test_the_model_resists_a_liar_better_than_the_mean(said):
    game = Game(make_scenario("crowd-10x10"), "weighted-mean")
    mean = Game(make_scenario("crowd-10x10"), "mean")
    liar = {"sr_0": said["BadMouthing"](level=0.0)}
    defended, undefended = (record(Cast(g, liar), g.random(seed=0)).top[-1].mean() for g in (game, mean))
    assert defended > undefended + 0.05


def test_the_attacker_plays(said):
    top = record(said["fading"], said["game"].random(seed=0)).top
    assert top[-1, 0] < 0.7 < top[-1, 1]


def test_the_learned_attacker_sells_bad_service_on_good_trust(said):
    sold = said["sold"]
    assert (sold.top * (1 - sold.quality))[:, 2].mean() > 0.2


def test_the_learner_learns(said):
    """With a few thousand rounds it lies far better than after its first update."""
    task = Task(task="RaterAttack", set={"max_cycles": 40, "noise": 0.0, "perturbations": []})
    rung = Entered(said["Reinforce"](), "mine", task.id)
    rounds = {"seed": 0, "games": 2, "tell": lambda rounds: None}
    begun, learned = (find(rung, task.arguments(), budget=budget, **rounds) for budget in (1_280, 12_800))
    assert isinstance(rung.learner, Learner)
    assert learned.rounds == 12_800
    assert learned.scores.mean() > begun.scores.mean() + 0.05


def test_the_wrappers_are_what_it_says(said):
    assert (said["clipped"].action_space.low == -1).all()
    assert said["numbered"].action_space.n == 5**3
    assert said["constant"].possible_agents == list(said["constant"].reset(seed=0)[0])
    assert (said["population"].action_space("sp_0").low == -1).all()


def test_the_scenario_is_valid(tmp_path):
    path = tmp_path / "drones.toml"
    path.write_text(blocks("toml")[0])
    assert load_scenario(path).name == "drones"


def test_the_leaderboard_is_that_of_the_benchmark():
    folder = Path(__file__).parent.parent / "docs"
    table = (folder / "leaderboard.md").read_text(encoding="utf-8")
    assert table in README
    assert table.splitlines()[-1].endswith("Made by `roletrust benchmark --suite standard --out results/standard`.")
