"""What a run would take of the resources, said before it starts."""

import re
import tracemalloc

import numpy as np
import pytest
from typer.testing import CliRunner

from roletrust_agents.learned.saved import ZOO
from roletrust_baselines import BadMouthing
from roletrust_env import Game, JointPolicy, make_scenario, memory
from roletrust_env.evaluation import games as playing
from roletrust_env.evaluation import resources
from roletrust_env.evaluation.games import foresee, play
from roletrust_env.evaluation.measurement import task_memory
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.metrics.confidence import over_games, student_quantile
from roletrust_env.world.presets import scenarios
from roletrust_experiments.cli import app


def run(*arguments):
    return CliRunner().invoke(app, [*map(str, arguments)])


def peak(work):
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("scenario", "games", "rounds", "models", "attacked"),
    [
        ("paper-3x3", 6000, 10, ["role-trust"], True),
        ("robots-that-move", 600, 12, ["role-trust", "role-trust:lam=0.6"], True),
    ],
)
def test_games_take_what_was_foreseen(monkeypatch, scenario, games, rounds, models, attacked):
    game = Game(make_scenario(scenario).change(max_cycles=rounds))
    attackers = {"sr_0": BadMouthing()} if attacked else {}
    joint_policies = [
        JointPolicy(Game(game.scenario, parse_trust_model(model, game.scenario)), attackers)
        for model in models
    ]
    foreseen = games * foresee(joint_policies, attackers).memory

    monkeypatch.setattr(playing, "_check_memory", lambda *_: None)  # it measures memory, too

    def work():
        return play(game.scenario, model=models, attacks=attackers, games=games, seed=0)

    assert 0.9 < foreseen / peak(work) < 1.35


def test_measured_attackers_take_what_was_foreseen():
    from roletrust_agents.learned.coalition_attacker import NetworkAttacker
    from roletrust_agents.learned.policy import play_task
    from roletrust_agents.learned.saved import load_attacker, task_from_card

    attacker = load_attacker(ZOO / "collusion-10x10")
    card, network = attacker.card, attacker.network
    task = task_from_card(card.task, card.trust_model, card.scenario.change(max_cycles=10))
    foreseen = 1000 * task_memory(task, NetworkAttacker(network, "black_box"))
    assert 0.9 < foreseen / peak(lambda: play_task(task, network, games=1000, seed=0)) < 1.35


@pytest.mark.parametrize(
    ("command", "option", "name", "work"),
    [
        (
            ["play", "--attack", "sr_0=bad-mouthing"],
            "--games ",
            "games",
            "roletrust_env.evaluation.games._play_games",
        ),
        (
            ["train", "RaterAttack", "--set", "max_cycles=10"],
            "--learner PPO:games=",
            "--learner games",
            "roletrust_agents.training.loop.train",
        ),
        (
            ["train", "RaterAttack", "--set", "max_cycles=10"],
            "--learner evolution:games=",
            "games at once:",
            "roletrust_agents.training.coalition_loop.train",
        ),
    ],
    ids=["play", "train", "train evolution"],
)
def test_what_is_too_large_is_refused_and_what_fits_is_not(
    tmp_path, monkeypatch, command, option, name, work
):
    class BegunError(ValueError):
        pass

    def begin(*_, **__):
        raise BegunError("it has begun")

    monkeypatch.setattr(work, begin)
    monkeypatch.setattr("roletrust_agents.training.loop.MANY", 50)  # quickly tried
    monkeypatch.setattr(memory, "available", lambda: 1e9)
    monkeypatch.chdir(tmp_path)

    def attempt(number):
        result = run(*command, *f"{option}{number}".split())
        assert result.exit_code == 2
        return " ".join(result.stderr.split())

    said = attempt(9_000_000)
    pattern = rf"Error: {name} 9,000,000 would take about [\d.]+ [GT]B of memory.*; 800 MB can be had, enough for about "  # noqa: E501
    assert re.match(pattern, said), said
    assert not list(tmp_path.iterdir())
    fits = int(said.rpartition("about ")[2].replace(",", ""))
    assert 1000 < fits < 9_000_000
    assert "it has begun" in attempt(fits // 50)


def test_one_game_that_is_too_long_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 5e8)
    monkeypatch.setattr(playing, "_play_games", lambda *_, **__: pytest.fail("it has begun"))
    result = run(
        "play",
        "--set",
        "max_cycles=1000000",
        "--attack",
        "sr_0=bad-mouthing",
        "--out",
        tmp_path / "out",
    )
    assert result.exit_code == 2
    pattern = r"Error: max_cycles 1,000,000 would take about 5\d\d MB .*400 MB can be had, enough for about [\d,]+"  # noqa: E501
    assert re.match(pattern, " ".join(result.stderr.split())), result.stderr


def test_memory_is_that_of_the_kernel_and_of_the_container(monkeypatch):
    assert 0 < memory.available() < 2**50
    files = {
        "/proc/meminfo": "MemTotal: 9 kB\nMemAvailable:    4000000 kB\n",
        "/sys/fs/cgroup/memory.max": "max\n",
    }
    monkeypatch.setattr(memory, "kernel_file", lambda path: files[path])
    assert memory.available() == 4_096_000_000
    files["/sys/fs/cgroup/memory.max"] = "1000000000\n"
    assert memory.available() == 1e9


def test_intervals_of_very_many_games():
    for freedom, quantile in ((1000, 1.9623390808), (1001, 1.9623367056), (30_000, 1.9600430330)):
        assert student_quantile(freedom) == pytest.approx(quantile, abs=2e-6)
    values = np.random.default_rng(0).random((3, 200_000))
    values[1, 100_000:] = np.nan
    mean, half, games = over_games(values)
    assert mean == pytest.approx([0.5] * 3, abs=0.005)
    assert games.tolist() == [200_000, 100_000, 200_000]
    assert half[1] == pytest.approx(1.96 * 12**-0.5 * 100_000**-0.5, rel=0.01)


def test_every_scenario_can_be_tried_out(monkeypatch):
    monkeypatch.setattr(resources, "_CELLS", 20_000)
    for name in [name for name in scenarios() if "sparse" not in make_scenario(name).tags]:
        game = Game(make_scenario(name))
        cost = foresee([JointPolicy(game, {})], {})
        assert cost.memory > 0
        assert cost.seconds >= 0
