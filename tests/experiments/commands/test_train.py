import json
import os
import platform
import random
import shlex
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
from typer.testing import CliRunner

from roletrust_agents.learned.methods import learned_methods
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
from roletrust_experiments.cli import app

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
    tmp_path /= "a, b"  # the next command has it in quotes
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
    assert (
        "In the same games: honest play 0.0000, best script (sp_2: on-off:raters=[0,1]) 0.2000 "
        "Written" in printed
    )
    _, _, shown = printed.partition("Next: roletrust ")
    shorter = ["--set", "max_cycles=4", "--out", str(tmp_path / "played")]
    assert (
        CliRunner().invoke(app, [*shlex.split(shown.removesuffix("--video")), *shorter]).exit_code
        == 0
    )
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


def test_runs_of_several_seeds_have_a_folder_each(tmp_path):
    arguments = ["ProviderAttack", *PPO, "--steps", 80, "--out", tmp_path]
    assert run("train", *arguments, "--runs", 2, "--seed", 5).exit_code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["seed-5", "seed-6"]
    assert [load_attacker(tmp_path / f"seed-{k}").card.training.seed for k in (5, 6)] == [5, 6]
    assert len(learned_methods(tmp_path, (5, 6), "learned")) == 2
    again = run("train", *arguments, "--runs", 2, "--seed", 4)
    assert "seed-5 holds a run" in " ".join(again.output.split())
    assert not (tmp_path / "seed-4").exists()
    printed("train", *arguments, "--runs", 3, "--seed", 5, "--resume")
    assert (tmp_path / "seed-7" / "attacker.json").exists()


def test_options_decide_what_is_learned(tmp_path):
    who = [
        "--compromised",
        "sr_0",
        "--objective",
        "promote",
        "--accomplice",
        "sp_1",
        "--knowledge",
        "grey_box",
    ]
    price = [
        "--stealth-weight",
        2,
        "--stealth-tolerance",
        0.2,
        "--model",
        "mean",
        "--scenario",
        "crowd-10x10",
    ]
    attacker, _ = train(tmp_path, "RoleTrust/RaterAttack-v0", *PPO, *who, *price, "--steps", 80)
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


@pytest.mark.parametrize("algo", [pytest.param("sac", marks=pytest.mark.slow), "recurrent-ppo"])
def test_other_learners_stop_and_go_on(tmp_path, algo):
    settings = (
        "learning_starts=40,buffer_size=200" if algo == "sac" else "n_steps=10,n_epochs=1,lstm=4"
    )
    arguments = ["RaterAttack", *TINY, "--learner", f"{algo}:{SMALL},{settings}", "--steps", 320]
    attacker, _ = train(tmp_path, *arguments)
    assert attacker.card.architecture.lstm == (0 if algo == "sac" else 4)
    assert attacker.card.architecture.squash == ("tanh" if algo == "sac" else "clip")
    newest = max((tmp_path / "checkpoints").iterdir())
    for file in newest.iterdir():
        file.unlink()
    again, _ = train(tmp_path, "--resume")
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
        ("--resume",): ["ProviderAttack", *PPO, "--steps", 80],
        ("config.json",): ["ProviderAttack", *PPO, "--steps", 160, "--resume"],
        ("Provider",): ["Provider"],
        ("RateAttack", "RaterAttack"): ["RateAttack"],
        ("gama", "gamma"): ["ProviderAttack", "--learner", "PPO:gama=0.9"],
        ("recurent-PPO", "recurrent-PPO"): ["ProviderAttack", "--learner", "recurent-PPO"],
    }
    for words, arguments in cases.items():
        assert_names(printed("train", *arguments, "--out", tmp_path, code=2), *words)
    assert_names(run("train", "--resume", "--out", tmp_path / "new").output, "new")
    continued = printed("train", "--resume", "--steps", 9, "--set", "noise=0", code=2)
    assert_names(continued, "--steps", "--set")
    for arguments in ([], ["--steps", 9], ["--seed", 3, "--runs", 2]):
        line = run("train", *arguments, "--out", tmp_path / "new").output
        assert "name a task: ProviderAttack, RaterAttack" in line
        assert "a run that is continued" not in line
    (tmp_path / "config.json").write_text("{")
    assert_names(run("train", "--resume", "--out", tmp_path).output, "config.json")


def test_a_finished_run_that_goes_on_is_as_it_was(tmp_path):
    before, _ = train(tmp_path, "ProviderAttack", *PPO, "--steps", 160)
    (tmp_path / "attacker.safetensors").unlink()
    after, _ = train(tmp_path, "ProviderAttack", *PPO, "--steps", 160, "--resume")
    assert after.card == before.card


def test_a_damaged_checkpoint_is_passed_over(tmp_path):
    folder = RunFolder(tmp_path)
    for steps in (1, 2, 3):
        folder.save(Checkpoint(steps, {"a": bytes([steps])}, {"n": steps}))
    assert folder.last() == Checkpoint(3, {"a": b"\x03"}, {"n": 3})
    (tmp_path / "checkpoints" / "000000000003" / "a").write_bytes(b"\x04")
    assert folder.last() == Checkpoint(2, {"a": b"\x02"}, {"n": 2})
    folder.save(Checkpoint(3, {"a": b"\x05"}, {}))
    assert folder.last() == Checkpoint(3, {"a": b"\x05"}, {})
    for path in (tmp_path / "checkpoints").glob("*/about.json"):
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
    (
        tmp_path / "checkpoints" / f".000000000001.{platform.node()}-{process.pid}"
    ).mkdir()  # it might have been at it
    attacker, _ = train(tmp_path, "--resume")
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


def test_the_zoo_scores_what_it_says():
    result = CliRunner().invoke(app, ["list", "zoo", "--games", "16"], env={"COLUMNS": "160"})
    assert result.exit_code == 0, result.output
    names = [path.stem for path in ZOO.glob("*.json")]
    assert len(names) >= 2
    for name in names:
        assert name in result.output
        for suffix in (".json", ".safetensors"):
            assert (ZOO / name).with_suffix(suffix).stat().st_size < 200_000
    assert "nobody" in CliRunner().invoke(app, ["list", "zoo", "nobody"]).output


def test_the_zoo_says_what_is_damaged_and_what_does_not_hold(tmp_path):
    text, data = (
        (ZOO / "provider-3x3").with_suffix(s).read_bytes() for s in (".json", ".safetensors")
    )
    card = json.loads(text)
    card["score"]["mean"] += 0.1
    for name, json_bytes, weights in (
        ("damaged", text, data[:-1]),
        ("boaster", json.dumps(card).encode(), data),
    ):
        (tmp_path / f"{name}.json").write_bytes(json_bytes)
        (tmp_path / f"{name}.safetensors").write_bytes(weights)
    result = CliRunner().invoke(
        app, ["list", "zoo", "--games", "2", "--folder", str(tmp_path)], env={"COLUMNS": "160"}
    )
    assert result.exit_code == 1
    assert "digest" in result.output
    assert "no" in result.output.split("boaster")[1]


def test_a_wrong_first_command_leaves_nothing_behind(tmp_path):
    printed("train", "ProviderAttack", "--compromised", "sr_0", "--out", tmp_path / "run", code=2)
    assert not (tmp_path / "run" / "config.json").exists()


def test_a_model_without_a_name_cannot_be_trained_against(tmp_path):
    model = "roletrust_env.trust.models.central.means:Mean"
    refused = printed(
        "train", "ProviderAttack", "--model", model, "--out", tmp_path / "run", code=2
    )
    assert_names(refused, "roletrust_env.trust.models.central.means:Mean")


def test_what_is_to_go_on_of_several_runs_is_said(tmp_path):
    (tmp_path / "seed-0").mkdir()
    refused = run("train", "--resume", "--out", tmp_path)
    assert "the whole command again" in " ".join(refused.output.split())


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
    assert_names(stopped, f"{card.score.mean:.4f}", "0.2000", "--resume")
    assert train(tmp_path, "--resume")[0].card.training.steps == 1600


@pytest.mark.parametrize("checkpoint", [None, Checkpoint(1, {}, {})])
def test_an_interrupted_run_says_how_to_go_on(tmp_path, monkeypatch, checkpoint):
    """Unless there is nothing to go on from."""

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("roletrust_agents.training.loop.train", interrupted)
    monkeypatch.setattr(RunFolder, "last", lambda _: checkpoint)
    stopped = printed("train", "ProviderAttack", *PPO, "--out", tmp_path, code=130)
    assert (f"--resume --out {tmp_path}" in stopped) == (checkpoint is not None)


def test_attackers_of_the_zoo_are_found_by_name():
    assert load_attacker("provider-3x3").card == load_attacker(ZOO / "provider-3x3").card
