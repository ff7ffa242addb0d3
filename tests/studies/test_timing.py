"""Timing of models, lists and games: what is measured, left out and foretold."""

import csv
import os
import subprocess
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from roletrust_env.trust import Mean, Ratings, RoleTrust, make_trust_model
from studies import costs, edge_costs, live_load, speed
from studies.costs import Cell, Found, Limits, Trial, compile_ahead, growth, measure_models, sizes, too_much
from studies.edge_costs import BYTES, measure_lists
from studies.speed import Plan, Target, ppo_share, stream
from studies.timing import (
    PLAIN,
    Contestant,
    Edges,
    Size,
    Spread,
    Timing,
    measure,
    on_edges,
    plain,
    torch_threads,
    trust_update,
)

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (costs, edge_costs):
        monkeypatch.setattr(module, "_SLICE_S", 1e-9)


def quickly(models: Any, sides: Any, **more: Any) -> Found:
    return measure_models(models, sides, ["NumPy"], **{"limits": Limits(), **more})


def rows(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def a_timing(*seconds, games=1, agents=1, ratings=0):
    return Timing(Contestant("x", games, agents, lambda: None, ratings), seconds)


def test_costs_have_a_row_for_each_model_and_size(tmp_path: Path) -> None:
    sides = ["--side", "3", "--side", "2", "--library", "NumPy"]
    costs.main(["--model", "mean", "--model", "beta:keep=0.5", *sides, "--out", str(tmp_path)])
    found = rows(tmp_path / "model-costs.csv")
    assert [(row["model"], row["raters"], row["providers"]) for row in found[-2:]] == [
        ("mean", "3", "3"),
        ("beta:keep=0.5", "3", "3"),
    ]
    assert all(float(row["ns_per_rating"]) > 0 for row in found)
    assert "| model | grows as | 2x2 | 3x3 | S^ | P^ |" in (tmp_path / "model-costs.md").read_text()
    with pytest.raises(SystemExit):
        costs.main(["--side", "3", "--out", str(tmp_path)])


def test_lists_have_a_row_for_each_model(tmp_path: Path) -> None:
    edge_costs.main(["--model", "mean", "--ratings", "2000", "--ratings", "1000", "--out", str(tmp_path)])
    found = rows(tmp_path / "edge-costs.csv")
    assert [(row["model"], row["ratings_asked"]) for row in found] == [
        (name, size) for size in ("1000", "2000") for name in (PLAIN, "mean")
    ]
    for row in found:
        assert 0.5 * int(row["ratings_asked"]) < int(row["ratings"]) <= int(row["ratings_asked"])
        assert float(row["ns_per_rating_least"]) <= float(row["ns_per_rating"])
    assert "## 2,000 ratings" in (tmp_path / "edge-costs.md").read_text()


def test_a_longer_list_is_left_out_by_what_the_shorter_one_took(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(edge_costs, "SECONDS", 0.0)
    found = measure_lists({"mean": make_trust_model("mean")}, [100, 200, 400])
    assert found["mean", 100].timing is not None
    assert all("would take about" in found["mean", size].left_out for size in (200, 400))
    with pytest.raises(ValueError, match=r"a list of .* ratings would take about"):
        measure_lists({}, [int(1.1 * edge_costs.MEMORY / BYTES)])


def test_speed_in_its_smallest_form(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, "QUICK", Plan((2,), (), 2, 1e-9, edges=(1000,), stream=100))
    monkeypatch.setattr(speed, "_SIDES", (3, 4))
    speed.main(["--quick", "--out", str(tmp_path)])
    names = [row["name"] for row in rows(tmp_path / "speed.csv")]
    assert {"one environment", "NumPy batch", "whole round", PLAIN, "role-trust on edges"} <= set(names)
    page = (tmp_path / "speed.md").read_text()
    assert "| trust model, 3,000 x 3,000 / 300 x 300 | at most 1.5 | not measured |" in page


def test_ppo_is_timed_on_the_task_and_on_nothing() -> None:
    assert 0 < ppo_share(games=8, rollouts=1, turns=1) < 10


def test_the_load_by_trust_model_names_what_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def measured(model: str, side: int, seconds: float, rate: float, folder: Path) -> live_load.Load:
        if (model, side) == ("mean", 100):
            raise live_load.TeamIncompleteError("100 raters do not get together")
        return live_load.Load(model, side, 20, 1.0, 0.1, side / 8, 1.0, 2.0, 80.0, 0.0)

    monkeypatch.setattr(live_load, "measure_load", measured)
    live_load.main(["live-load-models", "--model", "mean", "--model", "median", "--out", str(tmp_path)])
    table = [line for line in (tmp_path / "live-load.md").read_text().splitlines() if line.startswith("|")]
    assert table[0] == "| trust model | 10x10 | 100x100 |"
    assert table[2:] == ["| mean | 1.2 | - |", "| median | 1.2 | 12.5 |"]
    assert len(rows(tmp_path / "live-load.csv")) == 3
    live_load.main(["--side", "10", "--out", str(tmp_path / "one")])
    assert "| role-trust | 10x10 | 100% of 20 | 10.0% |" in (tmp_path / "one" / "live-load.md").read_text()


@pytest.mark.parametrize(
    "make",
    [
        speed.one_environment,
        speed.simple_adversary,
        partial(speed.batch, "NumPy", 5),
        partial(speed.batch, "torch", 5),
        partial(speed.whole_round, 4),
    ],
)
def test_contestants_play_on_past_the_end_of_an_episode(make: Any) -> None:
    pytest.importorskip("mpe2")
    contestant = make(0)
    for _ in range(250):  # an episode has 240 rounds
        contestant.step()


def test_numpy_has_the_sizes_from_which_growth_is_read() -> None:
    assert sizes((3, 30, 300), "NumPy") == [(3, 3), (30, 30), (30, 300), (300, 30), (300, 300)]
    assert sizes((3, 30, 300), "compiled torch") == [(3, 3), (30, 30), (300, 300)]


def test_every_model_is_timed_at_every_size() -> None:
    seen: list[str] = []
    models = {"role-trust": RoleTrust(), "mean": Mean()}
    found = quickly(models, (2, 3), advance=seen.append)
    assert list(found) == [(name, "NumPy", size) for size in sizes((2, 3), "NumPy") for name in models]
    assert len(seen) == len(found)
    for (name, _, size), cell in found.items():
        assert cell.timing is not None
        assert (cell.timing.contestant.name, cell.timing.contestant.ratings) == (name, size.raters * size.providers)
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

    found = quickly({"broken": Broken(), "mean": Mean()}, (2, 3))
    assert found["broken", "NumPy", Size(2, 3)].timing
    assert found["broken", "NumPy", Size(3, 2)] == Cell(None, "too many raters")
    assert all(found["mean", "NumPy", size].timing for size in sizes((2, 3), "NumPy"))


def test_what_would_take_too_much_is_left_out_in_every_library() -> None:
    found = quickly({"mean": Mean()}, (2, 3), limits=Limits(seconds=0))
    assert "an update would take about" in found["mean", "NumPy", Size(3, 3)].left_out
    assert all(found["mean", "NumPy", size].timing for size in sizes((2, 3), "NumPy")[:-1])


def test_what_an_update_takes_is_foretold_from_smaller_ones() -> None:
    """S^2 P: 10 times the raters take 100 times the time, 10 times the providers 10 times."""
    trials = {Size(30, 30): Trial(0.01, 1e6), Size(30, 300): Trial(0.1, 1e7), Size(300, 30): Trial(1.0, 1e8)}
    large = Size(300, 300)
    assert "10 seconds" in too_much(trials, large, Limits(seconds=9, memory=1e12))
    assert "1 GB" in too_much(trials, large, Limits(seconds=11, memory=0.9e9))
    assert not too_much(trials, large, Limits(seconds=11, memory=1.1e9))
    assert not too_much(trials, Size(300, 3000), Limits(0, 0))  # nothing tried tells of it


def test_growth_is_the_power_between_the_largest_sizes() -> None:
    def cell(size: Size, seconds: float) -> Cell:
        return Cell(Timing(Contestant("x", 1, 1, lambda: None, size.raters * size.providers), (seconds,)))

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
    contestant = trust_update("role-trust", RoleTrust(), Size(2, 3), "compiled torch", seed=0)
    state, raters, providers = contestant.step()
    assert isinstance(state, tuple)
    assert (tuple(raters.shape), tuple(providers.shape), raters.dtype) == ((2,), (3,), torch.float32)


def test_threads_of_torch_are_as_before_afterwards() -> None:
    torch = pytest.importorskip("torch")
    before = torch.get_num_threads()
    with torch_threads(3):
        assert torch.get_num_threads() == 3
    assert torch.get_num_threads() == before


@pytest.mark.parametrize("ratings", [300, 3000])
def test_the_sums_by_hand_are_those_of_the_model(ratings: int) -> None:
    edges = Edges.of(ratings, 0)
    assert 0.5 * ratings < len(edges.raters) <= ratings
    tor, top, last = plain(edges)()
    state = on_edges(edges, make_trust_model("role-trust"))()
    np.testing.assert_allclose(state.tor, tor, atol=1e-12)
    np.testing.assert_allclose(state.top, top, atol=1e-12)
    assert np.array_equal(state.last, last)


def test_a_stream_goes_on() -> None:
    one = stream(20, 30, 0)
    for _ in range(100):
        one.step()
    assert (one.ratings, one.agents) == (20, 60)


def shell(command: str) -> tuple[list[str]]:
    return (["sh", "-c", command],)


def ends(pid: int) -> bool:
    """Whether it is gone, or will be as soon as whoever inherited it looks."""
    for _ in range(600):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False


@pytest.mark.skipif(os.name != "posix", reason="the jobs are commands of a POSIX shell")
def test_what_takes_too_long_is_stopped_with_all_that_it_has_started(tmp_path: Path) -> None:
    """What cannot be sent and what raises is lost; what ends its process is named."""
    began: list[str] = []
    jobs: Any = {
        "first": shell(f"touch {tmp_path}/first"),
        "late": shell(f"echo $$ > {tmp_path}/late; exec sleep 600"),
        "unsent": (lambda: None,),
        "raises": (["no-such-command"],),
        "ends": shell("kill -9 $PPID"),
        "last": shell(f"touch {tmp_path}/last"),
    }
    undone: Any = compile_ahead(jobs, 20, 1, began.append, subprocess.run)
    assert list(undone) == ["ends", "late"]
    assert "crashed" in undone["ends"]
    assert "more than 20 seconds" in undone["late"]
    assert began == ["first", "late", "raises", "ends", "last"]
    assert (tmp_path / "first").exists()
    assert (tmp_path / "last").exists()
    assert ends(int((tmp_path / "late").read_text()))


def test_no_job_needs_no_process() -> None:
    assert compile_ahead({}, 1, 1, print) == {}


def test_every_contestant_gets_its_turns():
    taken, turns = [], []
    contestants = [Contestant(name, 1, 1, partial(taken.append, name)) for name in "ab"]
    timings = measure(contestants, repeats=3, slice_s=1e-9, advance=lambda: turns.append(len(taken)))
    assert [len(t.seconds) for t in timings] == [3, 3]
    assert taken[-6:] == ["a", "b"] * 3
    assert len(turns) == 6


def test_rates_and_ratios():
    ours = a_timing(1.0, 2.0, 4.0, games=10, agents=6)
    assert ours.env_steps() == Spread(5, 2.5, 10)
    assert ours.agent_steps() == Spread(30, 15, 60)
    peer = a_timing(1.0, 2.0, 8.0, games=10, agents=3)
    assert ours.times_faster(peer) == Spread(2, 2, 4)
    large, small = a_timing(9.0, 9.0, ratings=9), a_timing(2.0, 4.0, ratings=4)
    assert large.per_rating() == Spread(1, 1, 1)
    assert large.times_dearer(small) == Spread(1.5, 1, 2)


@pytest.mark.parametrize(
    ("found", "at_least", "ok"),
    [(4.1, True, True), (3.9, True, False), (4.1, False, False), (3.9, False, True), (None, True, None)],
)
def test_the_median_decides(found, at_least, ok):
    spread = None if found is None else Spread(found, 0, 99)
    assert Target("", 4.0, at_least, spread).ok is ok
