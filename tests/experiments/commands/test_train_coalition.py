"""`roletrust train` of coalitions, by evolution, a strategy or PPO: saved, continued, and
played by others."""

import json

import numpy as np
import pytest
from refusals import assert_names, refuses

pytest.importorskip("sb3_contrib")
pytest.importorskip("cma")

from csv_files import csv_rows
from typer.testing import CliRunner

from roletrust_agents.learned import coalition_of, learned, load_attacker
from roletrust_agents.learned.cards import Card
from roletrust_agents.learned.saved import parse_attacker
from roletrust_agents.training import coalition_loop
from roletrust_env.benchmarking import benchmark
from roletrust_env.benchmarking.suite_files import setting_worlds
from roletrust_env.evaluation.measurement import HELD_OUT, mean_rewards
from roletrust_env.game.make_task import make_task
from roletrust_experiments.cli import app

TINY = [
    "--set",
    "max_cycles=10",
    "--set",
    "objective=mislead",
    "--set",
    'compromised=["sr_8", "sp_9"]',
]
EVOLUTION = [
    "--learner",
    "evolution:population=4,games=2,units=3,validation=4,validate_every=2,start=random",
]
STRATEGY = [
    "--learner",
    "evolution-strategy:pairs=2,games=2,units=3,validation=4,validate_every=2,start=random",
]
PPO = ["--learner", "coalition-PPO:games=4,units=3,validation=4,validate_every=2,start=random"]
LEARNERS = {
    "evolution": EVOLUTION,
    "evolution-strategy": STRATEGY,
    "coalition-ppo": PPO,
}
EACH = pytest.mark.parametrize(
    "learner",
    [
        pytest.param(one, id=name, marks=pytest.mark.slow if name != "evolution" else ())
        for name, one in LEARNERS.items()
    ],
)


@pytest.fixture(autouse=True)
def _no_yardsticks(monkeypatch):
    """Which have a test of their own, and take longer than these trainings."""
    monkeypatch.setattr("roletrust_agents.training.yardsticks.yardsticks", lambda attacker: [])


def train(out, *arguments, code=0):
    texts = ["train", *map(str, arguments), "--out", str(out)]
    result = CliRunner().invoke(app, texts)
    assert result.exit_code == code, result.output
    return " ".join(result.output.split())


def weights(path):
    return load_attacker(path).network.flatten()


@EACH
def test_a_run_leaves_a_coalition_that_plays_in_other_worlds(tmp_path, learner):
    name = learner[1].partition(":")[0].lower()
    printed = train(
        tmp_path / "one", "CollusionAttack", *TINY, *learner, "--steps", 2000, "--model", "beta"
    )
    attacker = load_attacker(tmp_path / "one")
    card = attacker.card
    assert (card.training.algorithm, card.trust_model.name, card.observation) == (
        name,
        "beta",
        None,
    )
    assert f"score {card.score.mean:.4f}" in printed
    rows = csv_rows(tmp_path / "one" / "curve.csv")
    assert int(rows[-1]["steps"]) == card.training.rounds >= 2000
    elsewhere = {
        "scenario": "paper-3x3",
        "compromised": ("sr_2",),
        "objective": "damage",
        "max_cycles": 5,
    }
    coalition = coalition_of(str(tmp_path / "one"))
    assert mean_rewards(make_task(**elsewhere), coalition, 0, (1, 2), HELD_OUT)[0].shape == (1, 2)
    with refuses(ValueError, "accomplices"):
        learned(str(tmp_path / "one"))
    assert "beta" in json.dumps(card.model_dump(mode="json"))


@EACH
def test_an_interrupted_run_goes_on_to_the_same_end(tmp_path, monkeypatch, learner):
    arguments = ["CollusionAttack", *TINY, *learner, "--steps", 2400, "--model", "beta"]
    train(tmp_path / "whole", *arguments)
    saved = []

    def stop(report):
        saved.append(report)
        if len(saved) == 11:
            raise KeyboardInterrupt

    learn = coalition_loop.train
    monkeypatch.setattr(coalition_loop, "train", lambda run, folder, _: learn(run, folder, stop))
    train(tmp_path / "part", *arguments, code=130)
    assert load_attacker(tmp_path / "part").card.training.steps < 2400
    monkeypatch.undo()
    train(tmp_path / "part", *arguments)
    assert np.array_equal(weights(tmp_path / "whole"), weights(tmp_path / "part"))
    rounds = [load_attacker(tmp_path / name).card.training.rounds for name in ("whole", "part")]
    assert rounds[0] == rounds[1]


@EACH
def test_it_trains_against_several_models_in_turn(tmp_path, learner):
    train(
        tmp_path / "two",
        "CollusionAttack",
        *TINY,
        *learner,
        "--steps",
        1500,
        "--model",
        "beta",
        "--model",
        "qor",
    )
    card = load_attacker(tmp_path / "two").card
    assert [one.name for one in (card.trust_model, *card.further_models)] == ["beta", "qor"]
    refused = train(tmp_path / "ppo", "ProviderAttack", "--model", "beta", "--model", "qor", code=2)
    assert_names(refused, "evolution", "evolution-strategy", "coalition-PPO")


@EACH
def test_a_run_of_few_rounds_plays_a_step(tmp_path, learner):
    """The choice of the start alone takes more rounds than these."""
    train(tmp_path, "CollusionAttack", *TINY, *learner, "--steps", 1)
    assert load_attacker(tmp_path).card.training.rounds > 1


def test_what_a_training_of_a_coalition_cannot_do_is_refused(tmp_path):
    few = ["CollusionAttack", *TINY, "--steps", 100]
    spelt = train(tmp_path / "spelt", *few, "--learner", "evolution strategy:spread=-1", code=2)
    assert_names(spelt, "spread")  # the name is known as the list spells it, too
    refused = train(tmp_path / "units", *few, "--learner", "coalition-PPO:units=5", code=2)
    assert_names(refused, "5", "start=random")
    short = ["CollusionAttack", "--set", "max_cycles=1", *TINY[2:], "--steps", 10]
    refused = train(tmp_path / "short", *short, "--learner", "coalition-PPO:games=1", code=2)
    assert_names(refused, "PPO")
    refused = train(tmp_path / "box", *few, *STRATEGY, "--set", "knowledge=white_box", code=2)
    assert_names(refused, "black_box")
    assert_names(
        train(tmp_path / "many", *few, "--learner", "coalition-PPO:candidates=9", code=2),
        "candidates",
    )


def test_what_a_setting_or_a_card_cannot_be_is_refused(tmp_path):
    assert_names(
        train(tmp_path, "ProviderAttack", "--learner", "evolution:population=1", code=2),
        "population",
    )
    assert_names(train(tmp_path, "ProviderAttack", "--learner", "evolution:gama=1", code=2), "gama")
    train(tmp_path / "one", "CollusionAttack", *TINY, *EVOLUTION, "--steps", 500)
    text, data = (
        (tmp_path / "one" / f"attacker.{kind}").read_bytes() for kind in ("json", "safetensors")
    )
    card = json.loads(text)
    card["architecture"]["units"] = 200
    with refuses(ValueError, "layer0.weight", "(3, 15)", "(200, 15)"):
        parse_attacker(json.dumps(card).encode(), data)
    card["architecture"]["features"][0] = "mood"
    with refuses(ValueError, "features"):
        Card.model_validate_json(json.dumps(card))
    card = json.loads(text)
    card["task"]["knowledge"] = "white_box"
    with refuses(ValueError, "black_box"):
        Card.model_validate_json(json.dumps(card))


def test_a_coalition_trains_in_the_worlds_of_a_suite_and_enters_its_benchmark(tmp_path):
    learner = "evolution:population=4,games=1,units=3,validation=1,validate_every=2,start=random"
    out = tmp_path / "trained"
    train(out, "quick:raters", "--learner", learner, "--steps", 400, "--model", "mean")
    attacker = load_attacker(out)
    worlds = setting_worlds("quick:raters")
    assert attacker.card.scenario == worlds[0].scenario
    assert [task.compromised for task in attacker.tasks()] == [each.compromised for each in worlds]
    assert attacker.card.score.games == 256 // 3 * 3
    board = benchmark(
        "mean", "quick", attackers={"mine": coalition_of(str(out))}, workers=0, progress=False
    )
    attacks = {case.attack for case in board.worst_cases.values()}
    assert attacks == {"honest", "mine"}
    assert_names(train(out, "quick:raters", "--learner", learner, code=2), "steps", "settings")


def test_what_a_suite_decides_is_refused(tmp_path):
    for wrong, name in (("quick:clean", "clean"), ("nothing:raters", "nothing")):
        with refuses(ValueError, name):
            setting_worlds(wrong)
    refused = {
        "objective": ["--set", "objective=damage"],
        "noise": ["--set", "noise=0"],
        "PPO": ["--learner", "PPO"],
    }
    for name, options in refused.items():
        assert_names(train(tmp_path / "out", "quick:raters", *options, code=2), name)
    assert not (tmp_path / "out").exists()
