import json
import os
import platform
import random
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from command_line import printed, run
from refusals import assert_names, refuses

pytest.importorskip("sb3_contrib")

from csv_files import csv_rows

import roletrust_agents
from roletrust_agents.learned.policy import play_task
from roletrust_agents.learned.saved import ZOO, load_attacker
from roletrust_agents.training import loop
from roletrust_agents.training.learners import (
    make_model,
    network_of,
    parameters_bytes,
    set_parameters,
)
from roletrust_agents.training.runs import Checkpoint, RunFolder
from roletrust_agents.training.settings import make_settings
from roletrust_agents.training.yardsticks import Yardstick
from roletrust_env.envs.sb3 import AttackVecEnv
from roletrust_env.game.make_task import make_task

TINY = ["--set", "max_cycles=10", "--set", "noise=0", "--set", "perturbations=[]"]
SMALL = "games=8,hidden=[8],batch_size=40"
PPO = [*TINY, "--learner", f"PPO:{SMALL},n_steps=10,n_epochs=1", "--steps", "1600"]


@pytest.fixture(autouse=True)
def _few_yardsticks(monkeypatch):
    """Which have a test of their own, and take longer than these trainings."""
    found = [
        Yardstick("honest play", 0.0),
        Yardstick("best script (sp_2: on-off:raters=[0,1])", 0.2, is_script=True),
    ]
    monkeypatch.setattr("roletrust_agents.training.yardsticks.yardsticks", lambda attacker: found)


def train(out, *arguments):
    result = printed("train", *arguments, "--out", out)
    return load_attacker(out), result


def test_a_run_and_what_it_leaves_behind(tmp_path, drawn):
    attacker, printed = train(tmp_path, "provider-attack", *PPO, "--seed", 3)
    config = json.loads((tmp_path / "config.json").read_text())
    assert config["run"]["seed"] == 3
    assert config["run"]["settings"]["gamma"] == 0.95
    assert config["learner_packages"]["stable-baselines3"]
    rows = csv_rows(tmp_path / "curve.csv")
    assert len(rows) == 20
    assert rows[-1]["steps"] == "1600"
    assert (tmp_path / "curve.png").stat().st_size > 10_000
    assert list((tmp_path / "tensorboard").iterdir())
    assert len(list((tmp_path / "checkpoints").iterdir())) == 2
    score, card = attacker.card.score, attacker.card
    assert f"score {score.mean:.4f}" in printed
    assert "honest play 0.0000" in printed
    assert "0.2000" in printed
    again = play_task(attacker.task(), attacker.network, games=score.games, seed=score.seed)
    assert again.mean() == pytest.approx(score.mean)
    assert score.mean >= max(float(row["score"]) for row in rows) - 1e-6
    assert (card.task.compromised, card.scenario.max_cycles, card.training.steps) == (
        ("sp_2",),
        10,
        1600,
    )
    assert (
        card.training.rounds == 1600 + 20 * 16 * 10 + 16 * 10
    )  # learned from, 20 scores, games to normalise by


@pytest.mark.parametrize("algo", ["ppo", "sac", "recurrent-ppo"])
def test_the_same_seed_learns_the_same_to_the_last_bit(algo):
    """Where luck has a part, that of the games which the observations are normalised by
    included."""
    learned = []
    for seed in (3, 3, 4):
        env = AttackVecEnv(make_task("paper-3x3", ("sr_2",), max_cycles=10), 4)
        changes = (
            {"n_steps": 5, "n_epochs": 1}
            if algo != "sac"
            else {"learning_starts": 8, "buffer_size": 100}
        )
        model = make_model(
            algo,
            make_settings("any", algo, {"hidden": (8,), "batch_size": 20, **changes}),
            env,
            seed,
        )
        learned.append(network_of(model.learn(40)))
    one, again, other = (
        np.concatenate([n.mean, n.variance, *map(np.ravel, n.weights.values())]) for n in learned
    )
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)


def test_settings_decide_what_is_learned(tmp_path):
    who = ['compromised=["sr_0"]', "objective=promote", 'accomplices=["sp_1"]']
    more = ["knowledge=grey_box", "stealth={weight=2, tolerance=0.2}", "scenario=crowd-10x10"]
    settings = [word for each in [*who, *more] for word in ("--set", each)]
    options = [*PPO, *settings, "--model", "mean", "--steps", 80]
    attacker, _ = train(tmp_path, "RoleTrust/RaterAttack-v0", *options)
    task = attacker.card.task
    assert (task.compromised, task.objective, task.accomplices, task.knowledge) == (
        ("sr_0",),
        "promote",
        ("sp_1",),
        "grey_box",
    )
    assert (task.stealth.weight, task.stealth.tolerance) == (2, 0.2)
    assert attacker.card.trust_model.name == "mean"
    assert attacker.card.scenario.name == "crowd-10x10"
    assert attacker.card.architecture.inputs == 2 + 5 * 10 + 10 + 10


def test_the_function_and_its_command_train_the_same(tmp_path):
    command, shown = train(tmp_path / "command", "ProviderAttack", *PPO, "--steps", 80)
    training = roletrust_agents.train(
        "ProviderAttack",
        learner=f"PPO:{SMALL},n_steps=10,n_epochs=1",
        steps=80,
        max_cycles=10,
        noise=0,
        perturbations=(),
        out=tmp_path / "function",
    )
    assert training.attacker.card.score == command.card.score
    assert f"{command.card.score.mean:.4f}" in shown
    assert training.completed
    assert not training.beats_script
    assert f"{command.card.score.mean:.4f}" in training._repr_markdown_()


@pytest.mark.parametrize("algo", [pytest.param("sac", marks=pytest.mark.slow), "recurrent-ppo"])
def test_other_learners_stop_and_go_on(tmp_path, algo):
    settings = (
        "learning_starts=40,buffer_size=200" if algo == "sac" else "n_steps=10,n_epochs=1,lstm=4"
    )
    arguments = ["RaterAttack", *TINY, "--learner", f"{algo}:{SMALL},{settings}", "--steps", 320]
    attacker, _ = train(tmp_path, *arguments)
    assert attacker.card.architecture.lstm == (0 if algo == "sac" else 4)
    assert attacker.card.architecture.squash == ("tanh" if algo == "sac" else "clip")
    max((tmp_path / "checkpoints").iterdir()).unlink()
    again, _ = train(tmp_path, *arguments)
    assert again.card.training.steps == 320
    assert again.card.score.games == attacker.card.score.games


@pytest.mark.parametrize("algo", ["ppo", "sac", "recurrent-ppo"])
def test_the_saved_network_plays_as_the_learner_does(algo):
    task = make_task("paper-3x3", ("sr_2",), max_cycles=10)
    env = AttackVecEnv(task, 4, seed=0)
    settings = make_settings(
        "any", algo, {"hidden": (8, 8), **({"lstm": 4} if algo == "recurrent-ppo" else {})}
    )
    model, other = make_model(algo, settings, env, 0), make_model(algo, settings, env, 1)
    set_parameters(other, parameters_bytes(model))
    network, seen, states, starts = network_of(other), env.reset(), None, np.ones(4, bool)
    memory = network.begin(seen[:, 0])
    for _ in range(4):
        kept = {"state": states, "episode_start": starts} if algo == "recurrent-ppo" else {}
        expected, states = model.predict(seen, deterministic=True, **kept)
        starts = np.zeros(4, bool)
        action, memory = network(seen.T, memory)
        assert np.allclose(action.T * 2 - 1, expected, atol=1e-5)
        seen, *_ = env.step(expected)


def test_what_is_asked_wrongly(tmp_path):
    train(tmp_path, "ProviderAttack", *PPO, "--steps", 80)
    cases = {
        ("steps", "settings"): ["ProviderAttack", *PPO, "--steps", 160],
        ("Provider",): ["Provider"],
        ("RateAttack", "RaterAttack"): ["RateAttack"],
        ("gama", "gamma"): ["ProviderAttack", "--learner", "PPO:gama=0.9"],
        ("recurent-PPO", "recurrent-PPO"): ["ProviderAttack", "--learner", "recurent-PPO"],
        ("seed",): ["ProviderAttack", "--set", "seed=3"],
        ("rounds", "max_cycles"): ["ProviderAttack", "--set", "rounds=3"],
        ("compromised", "sr_2"): ["ProviderAttack", "--set", "compromised=sr_2"],
        ("model", "2"): ["ProviderAttack", "--model", "mean", "--model", "beta"],
    }
    for words, arguments in cases.items():
        assert_names(printed("train", *arguments, "--out", tmp_path, code=2), *words)
    for arguments, words in (({"steps": 0}, ("steps", 0)), ({"seed": -1}, ("seed", -1))):
        with refuses(ValueError, *words):
            roletrust_agents.train("ProviderAttack", out=tmp_path / "new", **arguments)
    (tmp_path / "config.json").write_text("{")
    line = run("train", "ProviderAttack", *PPO, "--out", tmp_path).output
    assert_names(line, "config.json")


def test_a_finished_run_that_goes_on_is_as_it_was(tmp_path):
    before, _ = train(tmp_path, "ProviderAttack", *PPO, "--steps", 160)
    (tmp_path / "attacker.safetensors").unlink()
    after, _ = train(tmp_path, "ProviderAttack", *PPO, "--steps", 160)
    assert after.card == before.card


def test_a_damaged_checkpoint_is_passed_over(tmp_path):
    folder = RunFolder(tmp_path)
    for steps in (1, 2, 3):
        folder.save(Checkpoint(steps, {"a": bytes([steps])}, {"n": steps}))
    assert folder.last() == Checkpoint(3, {"a": b"\x03"}, {"n": 3})
    file = tmp_path / "checkpoints" / "000000000003.npz"
    file.write_bytes(file.read_bytes().replace(b"\x03", b"\x04"))
    assert folder.last() == Checkpoint(2, {"a": b"\x02"}, {"n": 2})
    folder.save(Checkpoint(3, {"a": b"\x05"}, {}))
    assert folder.last() == Checkpoint(3, {"a": b"\x05"}, {})
    for path in (tmp_path / "checkpoints").iterdir():
        path.write_bytes(path.read_bytes()[:-9])
    assert folder.last() is None


@pytest.mark.slow
def test_a_killed_run_goes_on(tmp_path):
    command = [sys.executable, "-c", "from roletrust_experiments.cli import main; main()", "train"]
    arguments = ["ProviderAttack", *PPO, "--steps", "16000", "--out", str(tmp_path)]
    process = subprocess.Popen(
        [*command, *arguments],
        stdout=subprocess.DEVNULL,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )
    until = time.monotonic() + 600
    while not list(tmp_path.glob("checkpoints/0*")):
        assert time.monotonic() < until
        assert process.poll() is None
        time.sleep(0.05)
    time.sleep(random.Random().random() * 0.3)
    process.send_signal(signal.SIGKILL)
    process.wait()
    killed_at = RunFolder(tmp_path).last()
    assert killed_at is not None
    unfinished = f".000000000001.{platform.node()}-{process.pid}.npz"
    (tmp_path / "checkpoints" / unfinished).touch()  # it might have been at it
    attacker, _ = train(tmp_path, *arguments[:-2])
    assert not list(tmp_path.rglob(".*"))
    steps = [int(row["steps"]) for row in csv_rows(tmp_path / "curve.csv")]
    assert steps == sorted(set(steps))
    assert steps[: len(killed_at.notes["curve"])] == [row[0] for row in killed_at.notes["curve"]]
    assert steps[-1] >= 16000
    assert np.isfinite(attacker.card.score.mean)


def test_settings_are_tuned_by_task_and_changed_by_hand():
    assert make_settings("RoleTrust/ProviderAttack-v0", "ppo", {"gamma": 0.5}).gamma == 0.5
    with refuses(ValueError, "gamma", "2"):
        make_settings("RoleTrust/ProviderAttack-v0", "ppo", {"gamma": 2})


def test_a_wrong_first_command_leaves_nothing_behind(tmp_path):
    wrong = ["--set", 'compromised=["sr_7"]']
    printed("train", "ProviderAttack", *wrong, "--out", tmp_path / "run", code=2)
    assert not (tmp_path / "run" / "config.json").exists()


def test_a_model_without_a_name_cannot_be_trained_against(tmp_path):
    model = "roletrust_env.trust.models.central.means:Mean"
    refused = printed(
        "train", "ProviderAttack", "--model", model, "--out", tmp_path / "run", code=2
    )
    assert_names(refused, "roletrust_env.trust.models.central.means:Mean")


def test_a_run_that_is_stopped_is_saved_with_its_scores_and_goes_on(tmp_path, monkeypatch):
    learn = loop.train

    def stop(report):
        if len(report.curve) == 3:
            raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(loop, "train", lambda run, folder, _: learn(run, folder, stop))
        stopped = printed("train", "ProviderAttack", *PPO, "--out", tmp_path, code=130)
    card = load_attacker(tmp_path).card
    assert card.training.steps == 240
    assert_names(stopped, f"{card.score.mean:.4f}")
    assert train(tmp_path, "ProviderAttack", *PPO)[0].card.training.steps == 1600


def test_attackers_of_the_zoo_are_found_by_name():
    assert load_attacker("provider-3x3").card == load_attacker(ZOO / "provider-3x3").card
