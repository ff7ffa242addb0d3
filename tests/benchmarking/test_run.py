"""The benchmark from Python: models as objects, files, progress, and the same numbers in every
pool."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from refusals import refuses
from small_suites import small, tiny

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.deep_set import DeepSet, DeepSetArchitecture, random_weights
from roletrust_env.benchmarking import benchmark
from roletrust_env.benchmarking.play import CellPlay
from roletrust_env.benchmarking.run import benchmark_learners, play_suite
from roletrust_env.benchmarking.store import ResultStore
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_env.evaluation.attackers import OpenLoop
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.trust.models.central.means import Mean

SUITE = tiny()
ATTACKS = ["bad-mouthing"]


class Mine(Mean):
    """Mean under another name."""


def test_an_object_a_class_and_a_name_share_a_rank() -> None:
    board = benchmark(
        [Mine(), Mine, "mean", "constant"], SUITE, attacks=ATTACKS, workers=0, progress=False
    )
    rows = {row.model: row for row in board.rows if row.rule == "common"}
    same = [rows[name] for name in ("Mine", "Mine-2")]
    assert len({(row.tier, row.rank, str(row.estimates)) for row in same}) == 1
    # Objects get the agents in random order, and rounding then breaks ties of trust otherwise.
    worst = [rows[name].estimates["worst"].mean for name in ("Mine", "mean")]
    assert worst[0] == pytest.approx(worst[1], abs=0.1)
    assert rows["constant"].rank > rows["mean"].rank
    assert rows["mean"].worst_attack in ("honest", "bad-mouthing")
    assert "Mine" not in trust_models.names()


def test_processes_and_this_process_give_the_same_results(tmp_path: Path) -> None:
    here = benchmark([Mine(), "mean"], SUITE, search=True, workers=0, progress=False)
    there = benchmark([Mine(), "mean"], SUITE, search=True, workers=2, progress=False, out=tmp_path)
    assert str(here.rows) == str(there.rows)  # NaN is not equal to itself
    with ResultStore(tmp_path / "results.sqlite") as store:
        assert {cell.method for cell, _ in store.all()} == {"honest", "scripts", "search"}


@pytest.mark.slow
@pytest.mark.parametrize("source", ["script", "stdin"])
def test_a_script_needs_no_guard(tmp_path: Path, source: str) -> None:
    code = (
        "from small_suites import tiny\n"
        "from roletrust_env.benchmarking import benchmark\n"
        "from roletrust_env.trust.models.central.means import Mean\n"
        "class Mine(Mean):\n"
        '    """Mean."""\n'
        "board = benchmark(Mine(), tiny(), workers=2, progress=False)\n"
        "print([row.missing for row in board.rows if row.model == 'Mine'])\n"
    )
    (tmp_path / "script.py").write_text(code)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    words = [str(tmp_path / "script.py")] if source == "script" else ["-"]
    done = subprocess.run(
        [sys.executable, *words],
        input=None if source == "script" else code,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "[0]\n", "")


def test_a_run_continues_and_reports_the_stored_cells(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("roletrust_env.benchmarking.run._QUIET_S", 0)
    first = benchmark(["mean"], SUITE, attacks=ATTACKS, workers=0, progress=False, out=tmp_path)
    started = []

    class NoPool:
        def play(self, suite, cells):
            assert not cells
            return
            yield

    with ResultStore(tmp_path / "results.sqlite") as store:
        suite = store.suite
    play_suite(suite, NoPool(), out=tmp_path, on_start=lambda *numbers: started.append(numbers))
    assert started == [([], len(suite.cells()))]
    again = benchmark(["mean"], SUITE, attacks=ATTACKS, workers=0, out=tmp_path)
    assert str(again.rows) == str(first.rows)
    assert "Playing" in capsys.readouterr().err
    with refuses(ValueError, "results.sqlite", "models"):
        benchmark(["median"], SUITE, attacks=ATTACKS, workers=0, progress=False, out=tmp_path)


def test_trained_attackers_play_every_setting_in_place_of_scripts(tmp_path: Path) -> None:
    suite = small(methods=["scripts"])
    architecture = DeepSetArchitecture.of(4, wide=True)
    weights = random_weights(architecture, np.random.default_rng(0))
    attacker = CoalitionAttacker(DeepSet.unflatten(architecture, weights.astype(np.float32)))
    benchmark("mean", suite, attackers={"mine": attacker}, workers=0, progress=False, out=tmp_path)
    with ResultStore(tmp_path / "results.sqlite") as store:
        stored = store.all()
    attacked = [(cell, result) for cell, result in stored if suite.settings[cell.setting].roles]
    assert {cell.setting for cell, _ in attacked} == {
        name for name, setting in suite.settings.items() if setting.roles
    }
    for cell, result in attacked:
        assert cell.method == "replayed"
        assert [row.attack for row in result.rows] == ["honest", "mine"]
        skills = CellPlay(suite, cell).measure("selection", [attacker]).scores["skill"][:, 0]
        assert result.rows[1].chosen["skill"] == pytest.approx(skills)


def test_an_attacker_without_a_record_is_refused() -> None:
    with refuses(ValueError, "mine", "OpenLoop"):
        benchmark("mean", tiny(), attackers={"mine": OpenLoop(np.zeros((2, 3)))}, workers=0)


def test_invalid_arguments_are_refused() -> None:
    needy = type("Needy", (Mean,), {"__init__": lambda self, must: None})
    with refuses(ValueError, "attacks", "on-off"):
        benchmark(suite=SUITE, attacks="on-off")
    with refuses(ValueError, "quick", "closed-loop"):
        benchmark_learners("PPO", "quick")
    for models, suite, words in (
        ("meen", SUITE, ("meen", "mean")),
        (3, SUITE, ("3",)),
        (needy, SUITE, ("Needy",)),
        ("mean", "learners-quick", ("learners-quick", "benchmark_learners")),
        ("mean", "quik", ("quik", "quick")),
    ):
        with refuses(ValueError, *words):
            benchmark(models, suite, workers=0, progress=False)  # type: ignore[arg-type]


def test_a_suite_keeps_of_another_one_the_replayed_attacks_that_fit(tmp_path: Path) -> None:
    text = 'extends = "standard"\n[settings.raters]\nroles = ["SR"]\nshare = 0.4\n'
    (tmp_path / "mine.toml").write_text(text)
    (tmp_path / "scripts.toml").write_text(f'methods = ["scripts"]\n{text}')
    other = text.replace("settings.raters", "settings.liars")
    (tmp_path / "other.toml").write_text(other)
    (tmp_path / "attacks.toml").write_text(f'attacks = ["rank-lies"]\n{text}')
    kept, scripts, none, attacks = (
        load_suite(tmp_path / f"{name}.toml") for name in ("mine", "scripts", "other", "attacks")
    )
    assert {attack.setting for attack in kept.replayed} == {"raters"}
    assert kept.methods == ("scripts", "replayed")
    for suite in (scripts, none, attacks):
        assert (suite.replayed, suite.methods) == ((), ("scripts",))


@pytest.mark.parametrize("line", ["methods = 3", "settings = 3", "replayed = [3]"])
def test_a_suite_that_extends_a_wrong_one_is_refused(tmp_path: Path, line: str) -> None:
    (tmp_path / "base.toml").write_text(f'{line}\nextends = "standard"\n')
    (tmp_path / "mine.toml").write_text('extends = "base.toml"\n')
    with pytest.raises(ValueError, match=line.partition(" ")[0]):
        load_suite(tmp_path / "mine.toml")


@pytest.mark.parametrize("attackers", [{"honest": None}, {"": None}, {"x": CoalitionAttacker}, [1]])
def test_wrong_attackers_are_refused(attackers: object) -> None:
    with pytest.raises(ValueError, match="attacker"):
        benchmark("mean", tiny(), attackers=attackers, workers=0)  # type: ignore[arg-type]
