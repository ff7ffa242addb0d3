"""What the guide and the tutorials say that their code does, it does."""

import types

import numpy as np
import pytest
from pages import HOUSE, blocks, cells, run, written_file

from roletrust_baselines import BadMouthing
from roletrust_env import Game, JointPolicy, load_scenario, make_scenario
from roletrust_env.benchmarking.learners.learner import Learner, LearnerTraining
from roletrust_env.benchmarking.learners.suite import SuiteTask
from roletrust_env.evaluation.search import find
from roletrust_env.game.rollout import record
from roletrust_env.testing import check_trust_model

pytestmark = pytest.mark.slow

GUIDE, TUTORIALS = HOUSE / "docs/guide", HOUSE / "docs/tutorials"


@pytest.fixture
def games():
    return run(GUIDE / "games.md")


@pytest.fixture
def extended():
    return run(GUIDE / "extend.md")


def imported(page, name):
    """A module that a tutorial writes."""
    module = types.ModuleType(name)
    exec(compile(written_file(TUTORIALS / page, f"{name}.py"), name, "exec"), vars(module))
    return module


def test_the_batch_shows_the_closed_form(games):
    np.testing.assert_allclose(
        games["history"].tor[-1, :, 0], 1 - np.sqrt([1 / 6, 1 / 6, 1 / 3]), atol=1e-6
    )


def test_tensors_show_the_same(games):
    np.testing.assert_allclose(games["history_of_tensors"].tor, games["history"].tor, atol=1e-5)


def test_the_attacker_plays(extended):
    top = record(extended["fading"], extended["game"].random(seed=0)).top
    assert top[-1, 0] < 0.7 < top[-1, 1]


def test_the_scenario_is_valid(tmp_path):
    path = tmp_path / "drones.toml"
    path.write_text(
        next(block for block in blocks(GUIDE / "extend.md", "toml") if "max_cycles" in block)
    )
    assert load_scenario(path).name == "drones"


def test_the_learned_attacker_sells_bad_service_on_good_trust():
    sold = run(GUIDE / "tasks.md")["sold"]
    assert (sold.top * (1 - sold.quality))[:, 2].mean() > 0.2


def test_the_wrappers_are_what_it_says():
    said = run(GUIDE / "frameworks.md")
    assert (said["clipped"].action_space.low == -1).all()
    assert said["numbered"].action_space.n == 5**3
    assert said["constant"].possible_agents == list(said["constant"].reset(seed=0)[0])
    assert (said["population"].action_space("sp_0").low == -1).all()


def test_the_first_rounds_are_those_worked_out_by_hand():
    history = run(HOUSE / "docs/how/round.md")["history"]
    assert history.rated.any(axis=(1, 2)).tolist() == [False, True, True]
    np.testing.assert_allclose(history.tor[:, 0], [0.5, 0.75, 0.875])
    np.testing.assert_allclose(history.top[:, 0], [0.5, 0.625, 0.75])


def test_your_model_resists_a_liar_better_than_the_mean():
    model = imported("your-model.md", "mymodel").WeightedMean
    liar = {"sr_0": BadMouthing(level=0.0)}
    plays = [Game(make_scenario("crowd-10x10"), kind) for kind in (model(), model(power=0.0))]
    defended, undefended = (
        record(JointPolicy(game, liar), game.random(seed=0)).top[-1].mean() for game in plays
    )
    assert defended > undefended + 0.05


@pytest.mark.parametrize(
    ("page", "module", "name"),
    [("your-model.md", "mymodel", "WeightedMean"), ("notebook.md", "pessimist", "Pessimist")],
)
def test_the_models_of_the_tutorials_pass_the_check_for_plug_ins(page, module, name):
    check_trust_model(vars(imported(page, module))[name]())


def test_the_coalition_runs_down_the_best_providers_and_keeps_its_trust():
    names = {}
    exec(
        next(cell for cell in cells(TUTORIALS / "attacker.md") if "attacked_rollout" in cell), names
    )
    by_place, tor = names["by_place"].mean(axis=1), names["tor"]
    assert (np.diff(by_place) > 0).all()
    assert by_place[0] < -0.8 < 0.3 < by_place[-1]
    assert abs(tor[:, 0] - tor[:, 1]).max() < 0.05


def test_your_learner_learns():
    """With a few thousand rounds it lies far better than after its first update."""
    task = SuiteTask(task="RaterAttack", set={"max_cycles": 40, "noise": 0.0, "perturbations": []})
    method = LearnerTraining(imported("learner.md", "mylearner").Reinforce(), "mine", task.id)
    rounds = {"seed": 0, "games": 2}
    begun, learned = (
        find(method, task.arguments(), budget=budget, **rounds) for budget in (1_280, 12_800)
    )
    assert isinstance(method.learner, Learner)
    assert learned.rounds == 12_800
    assert learned.scores.mean() > begun.scores.mean() + 0.05
