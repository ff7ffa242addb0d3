"""Timing of models, lists and games: what is measured and left out."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from csv_files import csv_rows

from roletrust_agents.smooth import one_thread
from roletrust_env.metrics.confidence import Interval
from roletrust_env.trust import Mean, Ratings, RoleTrust, make_trust_model
from studies import costs, edge_costs, speed
from studies.costs import Cell, Found, compile_ahead, growth, measure_models, sizes
from studies.edge_costs import PLAIN, Edges, on_edges, plain
from studies.study import run
from studies.timing import COMPILED, Contestant, Size, Timing, measure, trust_update

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (costs, edge_costs, speed):
        monkeypatch.setattr(module, "_SLICE_S", 1e-9)


def test_costs_have_a_row_for_each_model_and_size(tmp_path: Path) -> None:
    sides = ["--side", "3", "--side", "2", "--library", "NumPy"]
    run(
        "studies.costs",
        ["--model", "mean", "--model", "beta:keep=0.5", *sides, "--out", str(tmp_path)],
    )
    found = csv_rows(tmp_path / "model-costs.csv")
    assert [(row["model"], row["raters"], row["providers"]) for row in found[-2:]] == [
        ("mean", "3", "3"),
        ("beta:keep=0.5", "3", "3"),
    ]
    assert all(float(row["ns_per_rating"]) > 0 for row in found)
    assert "| model | grows as | 2x2 | 3x3 | S^ | P^ |" in (tmp_path / "model-costs.md").read_text()


def test_lists_have_a_row_for_each_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(edge_costs, "_RUNS", 1)
    sizes = ["--ratings", "2000", "--ratings", "1000", "--agents", "100", "--rows", "50"]
    run("studies.edge_costs", ["--model", "mean", *sizes, "--out", str(tmp_path)])
    found = csv_rows(tmp_path / "edge-costs.csv")
    assert [(row["model"], row["ratings_asked"]) for row in found] == [
        (name, size) for size in ("1000", "2000") for name in (PLAIN, "mean")
    ]
    for row in found:
        assert 0.5 * int(row["ratings_asked"]) < int(row["ratings"]) <= int(row["ratings_asked"])
        assert float(row["ns_per_rating_least"]) <= float(row["ns_per_rating"])
    page = (tmp_path / "edge-costs.md").read_text()
    assert "## 2,000 ratings" in page
    assert "\n| 100 | " in page
    assert "of the CPU for 50 rows" in page


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


def test_numpy_has_the_sizes_from_which_growth_is_read() -> None:
    assert sizes((3, 30, 300), "NumPy") == [(3, 3), (30, 30), (30, 300), (300, 30), (300, 300)]
    assert sizes((3, 30, 300), "compiled torch") == [(3, 3), (30, 30), (300, 300)]


def test_every_model_is_timed_at_every_size() -> None:
    models = {"role-trust": RoleTrust(), "mean": Mean()}
    found = measure_models(models, (2, 3), "NumPy")
    assert list(found) == [
        (name, "NumPy", size) for size in sizes((2, 3), "NumPy") for name in models
    ]
    for (name, _, size), cell in found.items():
        assert cell.timing is not None
        assert (cell.timing.contestant.name, cell.timing.contestant.amount) == (
            name,
            size.raters * size.providers,
        )
        assert len(cell.timing.seconds) == 5


def test_a_model_may_ask_who_is_who_and_nobody_rates_itself() -> None:
    seen = []

    class Sociable(Mean):
        takes_peers = True

        def start(self, like: Any, peers: Any) -> Any:  # type: ignore[override]
            seen.append(peers)
            return super().start(like)

        def update(self, state: Any, ratings: Ratings) -> Any:
            seen.append(ratings.mask)
            return super().update(state, ratings)

    trust_update("sociable", Sociable(), Size(2, 3), "NumPy", seed=0).step()
    assert np.array_equal(seen[0], np.eye(2, 3, dtype=bool))
    assert all(np.array_equal(mask, ~seen[0]) for mask in seen[1:])


def test_a_model_that_fails_is_left_out_and_harms_no_other() -> None:
    class Broken(Mean):
        def update(self, state: Any, ratings: Ratings) -> Any:
            if ratings.shape[0] > 2:
                raise RuntimeError("too many raters\nand a long story")
            return super().update(state, ratings)

    found = measure_models({"broken": Broken(), "mean": Mean()}, (2, 3), "NumPy")
    assert found["broken", "NumPy", Size(2, 3)].timing
    assert found["broken", "NumPy", Size(3, 2)] == Cell(None, "too many raters")
    assert all(found["mean", "NumPy", size].timing for size in sizes((2, 3), "NumPy"))


def test_growth_is_the_power_between_the_largest_sizes() -> None:
    def cell(size: Size, seconds: float) -> Cell:
        return Cell(Timing(Contestant("x", lambda: None, size.raters * size.providers), (seconds,)))

    found: Found = {
        ("x", "NumPy", size): cell(size, (size.raters**2 * size.providers + 50) / 1e9)
        for size in sizes((3, 30, 300), "NumPy")
    }
    assert growth(found, "x") == pytest.approx((2, 1), abs=1e-3)
    found["x", "NumPy", Size(300, 300)] = Cell(None, "too much")
    assert growth(found, "x") == pytest.approx((2, 1), abs=1e-2)
    assert np.isnan(growth(found, "y")).all()


def test_a_model_is_timed_compiled() -> None:
    torch = pytest.importorskip("torch")
    contestant = trust_update("role-trust", RoleTrust(), Size(2, 3), COMPILED, seed=0)
    state, raters, providers = contestant.step()
    assert isinstance(state, tuple)
    assert (tuple(raters.shape), tuple(providers.shape), raters.dtype) == (
        (2,),
        (3,),
        torch.float32,
    )


@pytest.mark.parametrize("ratings", [300, 3000])
def test_the_sums_by_hand_are_those_of_the_model(ratings: int) -> None:
    edges = Edges.of(ratings, 0)
    assert 0.5 * ratings < len(edges.raters) <= ratings
    tor, top, last = plain(edges)()
    state = on_edges(edges, make_trust_model("role-trust"))()
    np.testing.assert_allclose(state.tor, tor, atol=1e-12)
    np.testing.assert_allclose(state.top, top, atol=1e-12)
    assert np.array_equal(state.last, last)


def test_every_contestant_gets_its_turns():
    taken = []
    contestants = [Contestant(name, partial(taken.append, name), 1) for name in "ab"]
    timings = measure(contestants, repeats=3, slice_s=1e-9)
    assert [len(t.seconds) for t in timings] == [3, 3]
    assert taken[-6:] == ["a", "b"] * 3


def test_speed_in_its_smallest_form(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mpe2")
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


def test_what_takes_too_long_to_compile_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch")
    monkeypatch.setattr(costs, "_COMPILING_S", 0.01)
    undone = compile_ahead({("mean", Size(3, 3)): ("mean", Mean(), Size(3, 3), COMPILED, 0)})
    assert list(undone) == [("mean", Size(3, 3))]
    assert "more than" in undone["mean", Size(3, 3)]


def test_torch_has_its_threads_again_afterwards() -> None:
    torch = pytest.importorskip("torch")
    before = torch.get_num_threads()
    with one_thread():
        assert torch.get_num_threads() == 1
    assert torch.get_num_threads() == before


def test_times_and_rates() -> None:
    one = Timing(Contestant("x", lambda: None, 60), (1.0, 2.0, 4.0))
    assert one.each() == pytest.approx(Interval(2e9 / 60, 1e9 / 60, 4e9 / 60))
    assert one.rate() == pytest.approx(Interval(30e-6, 15e-6, 60e-6))
