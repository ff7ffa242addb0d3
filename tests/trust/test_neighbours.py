"""Rounds of few ratings among many pairs: the numbers of a model that is `nearby` are those of a
round of all pairs."""

from typing import Any

import numpy as np
import pytest

from roletrust_env.trust import neighbours
from roletrust_env.trust.algorithms import upper_median
from roletrust_env.trust.edge_run import EdgeRun
from roletrust_env.trust.models.central.leave_one_out import LeaveOneOut
from roletrust_env.trust.neighbours import LowerMedian, PairChains


class Far(LeaveOneOut):
    """The same model, of which every round updates all pairs."""

    nearby = False


def leave(runs: list[EdgeRun], rng: np.random.Generator) -> None:
    gone = rng.integers(0, min(runs[0].shape), 2)
    for run in runs:
        run.remove(gone, gone[:1])


def save(runs: list[EdgeRun], rng: np.random.Generator) -> None:
    """Both have the same state, and go on from a copy of it."""
    states = [{name: array.copy() for name, array in run.save().items()} for run in runs]
    for name, array in states[0].items():
        assert np.array_equal(array, states[1][name])
    for run, state in zip(runs, states, strict=True):
        run.load(state)


def pause(runs: list[EdgeRun], rng: np.random.Generator) -> None:
    for run in runs:
        run.skip(2)


def join(runs: list[EdgeRun], rng: np.random.Generator) -> None:
    for run in runs:
        run.join(run.shape[0] + 3, run.shape[1] + 2)


@pytest.mark.parametrize("seeds", [range(4), pytest.param(range(4, 60), marks=pytest.mark.slow)])
def test_a_round_of_few_ratings_has_the_numbers_of_a_round_of_all_pairs(
    monkeypatch: pytest.MonkeyPatch, seeds: range
) -> None:
    """To the last bit: while agents join and leave, rounds are empty, and the median wanders below
    and above."""
    few, play_near = [0, 0], EdgeRun._play_near

    def counted(self: EdgeRun, *arguments: Any) -> bool:
        few[found := play_near(self, *arguments)] += 1
        return found

    monkeypatch.setattr(EdgeRun, "_play_near", counted)
    for seed in seeds:
        rng = np.random.default_rng(seed)
        agents, one_role = int(rng.integers(50, 1500)), bool(seed % 2)
        monkeypatch.setattr(neighbours, "_WIDTH", int(rng.integers(1, 40)))
        given: Any = {"modesty": [0.0, 0.5, 1.0, 1.0][seed % 4], "power": [0.0, 6.0][seed % 3 % 2]}
        runs = [EdgeRun(model(**given), one_role=one_role) for model in (LeaveOneOut, Far)]
        mean = rng.random()
        for number in range(40):
            size = max(2, agents // 100) if number else agents // 2
            who, whom = (
                rng.integers(0, agents, size),
                (agents * rng.random(size) ** rng.integers(1, 4)).astype(int),
            )
            whom += (not one_role) * (who == whom)
            values = rng.normal(mean, 0.3, size).clip(0, 1).round(1)
            for run in runs:
                run.play(who, whom, values)
            if rng.random() < 0.2:
                [leave, save, pause, join][rng.integers(4)](runs, rng)
            if rng.random() < 0.4:
                for trust, wanted in zip(
                    *((run.rater_trust, run.provider_trust) for run in runs), strict=True
                ):
                    assert np.array_equal(trust, wanted)
    assert min(few) > 4 * len(seeds)


def test_newcomers_without_ratings_have_the_prior_of_the_round() -> None:
    """Where the median of all stays as it is, below the initial trust."""
    runs = [EdgeRun(model(), one_role=False) for model in (LeaveOneOut, Far)]

    def same() -> None:
        assert np.array_equal(*(run.provider_trust for run in runs))

    for run in runs:
        run.play(np.arange(200), np.arange(200, 400), np.zeros(200))
        run.play(np.r_[400], np.r_[401], np.zeros(1))
    same()
    join(runs, np.random.default_rng(0))
    pause(runs, np.random.default_rng(0))
    same()
    for run in runs:
        run.play(np.r_[406], np.r_[407], np.zeros(1))
    join(runs, np.random.default_rng(0))
    same()


def test_the_median_of_many_is_that_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(neighbours, "_WIDTH", 5)
    rng, median, size = np.random.default_rng(0), LowerMedian(), 10
    values, there = np.zeros(400), np.zeros(400, bool)
    for number in range(400):
        size = min(400, size + int(rng.integers(0, 4)))
        places = np.flatnonzero(rng.random(size) < 0.1)
        values[places] = rng.normal(0.3 * np.sin(number / 30), 0.2, len(places)).round(2)
        there[places] = rng.random(len(places)) < 0.9
        found = median.put(places, size, values[places], there[places])
        assert found == min(upper_median(values, there), 0.0)


def test_the_window_of_a_growing_median_stays_small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(neighbours, "_WIDTH", 5)
    median, values = LowerMedian(), np.random.default_rng(0).normal(-1, 0.1, 1000)
    for last in range(10, 1000, 10):
        median.put(np.arange(last - 10, last), last, values[last - 10 : last], np.ones(10, bool))
        assert len(median._inside) < 40


def test_chains_have_the_pairs_of_their_agents() -> None:
    rng, chains = np.random.default_rng(0), PairChains()
    agents = rng.integers(0, 1000, 5000)
    for start in range(0, 5000, 600):
        chains.extend(agents[start : start + 600], 1000)
    some = np.array([3, 7, 3, 999])
    found = chains.of(some, 5000)
    assert found is not None
    assert sorted(found.tolist()) == np.flatnonzero(np.isin(agents, some)).tolist()
    assert chains.of(some, len(found) - 1) is None
    chains.extend(np.zeros(100, np.int64), 1000)
    assert chains.of(np.array([0]), 5000) is None  # too long a chain
