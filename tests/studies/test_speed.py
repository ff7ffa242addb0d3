"""Timing of games: every contestant gets its turns, and rates are computed from the times."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from csv_files import csv_rows

from roletrust_agents.smooth import one_thread
from studies import speed
from studies.speed import COMPILED, Contestant, measure
from studies.study import run

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("make", "steps"),  # an episode has 240 rounds
    [
        (partial(speed.one_environment, "paper-3x3", False, "rules"), 250),
        (partial(speed.one_environment, "paper-3x3", True, "compiled"), 250),
        (partial(speed.simple_adversary, False), 250),
        (partial(speed.attack_tasks, "compiled", np.float32, 5), 250),
        (partial(speed.batch, COMPILED, "cpu", 5), 16),
    ],
)
def test_contestants_play_on_past_the_end_of_an_episode(make: Any, steps: int) -> None:
    pytest.importorskip("mpe2")
    contestant = make(0)
    for _ in range(steps):
        contestant.step()


def test_every_contestant_gets_its_turns():
    taken = []
    contestants = [Contestant(name, partial(taken.append, name), 1) for name in "ab"]
    timings = measure(contestants, repeats=3, slice_s=1e-9)
    assert timings.shape == (2, 3)
    assert taken[-6:] == ["a", "b"] * 3


def test_speed_in_its_smallest_form(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mpe2")
    monkeypatch.setattr(speed, "_SLICE_S", 1e-9)
    monkeypatch.setattr(speed, "_TRAINING_ROUNDS", 1)
    run("studies.speed", ["--games", "2", "--out", str(tmp_path)])
    found = csv_rows(tmp_path / "speed.csv")
    assert {
        "paper-3x3, rules, parallel",
        "paper-3x3, compiled, in turn",
        "attack tasks, compiled, float64",
    } <= {row["contestant"] for row in found}
    peers = [row for row in found if "simple" in row["contestant"]]
    assert [float(row["times the peer"]) for row in peers] == [1.0] * len(peers)
    assert all(float(row["times the peer"]) > 0 for row in found)


def test_torch_has_its_threads_again_afterwards() -> None:
    torch = pytest.importorskip("torch")
    before = torch.get_num_threads()
    with one_thread():
        assert torch.get_num_threads() == 1
    assert torch.get_num_threads() == before


def test_time_is_per_action(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter(range(1000))
    monkeypatch.setattr(speed.time, "perf_counter", lambda: float(next(clock)))
    contestants = [Contestant("x", lambda: None, amount) for amount in (1, 4)]
    np.testing.assert_allclose(measure(contestants, repeats=2, slice_s=1), [[1, 1], [0.25, 0.25]])
