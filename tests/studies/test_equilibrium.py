"""The equilibrium of models and attackers: games whose solution is known, duality, and what counts
as a strategy."""

from pathlib import Path

import numpy as np
import pytest
from csv_files import csv_rows
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from refusals import refuses
from small_suites import small

from roletrust_env.benchmarking import benchmark
from roletrust_env.benchmarking.worst_case import AttackScores, Condition
from studies.equilibrium import Payoffs, equilibrium, payoffs, responded, solve
from studies.study import run

pytestmark = pytest.mark.slow

HERE, THERE = Condition("market", "raters", 0.3), Condition("crowd", "raters", 0.3)
DOCS = Path(__file__).parents[2] / "docs"
SCORES = arrays(np.float64, (3, 4), elements=st.floats(-1, 1))


def test_two_by_two_has_its_closed_form() -> None:
    """Without a saddle point, value = (ad - bc) / (a + d - b - c), and the first row has (d - c) /
    the same."""
    a, b, c, d = 0.9, 0.2, 0.1, 0.6
    found, apart = solve([np.array([[a, b], [c, d]])]), a + d - b - c
    assert found.value == pytest.approx((a * d - b * c) / apart)
    assert found.models == pytest.approx([(d - c) / apart, (a - b) / apart])
    assert found.attacks[0] == pytest.approx([(d - b) / apart, (a - c) / apart])


def test_one_mixture_serves_all_conditions() -> None:
    """Each model is perfect in one condition and useless in the other: every mixture has the
    mean."""
    here, there = np.array([[1.0], [0.0]]), np.array([[0.0], [1.0]])
    assert solve([here, there]).value == pytest.approx(0.5)
    assert np.mean([solve([game]).value for game in (here, there)]) == pytest.approx(1.0)


def test_intervals_are_those_of_means_over_all_games_drawn_anew() -> None:
    """One model under one attack, so that its score alone is a mean: its interval has the width of
    the normal one."""
    rng, count = np.random.default_rng(0), 400
    chosen, measured = rng.random((2, 1, 1, count))
    (alone,) = equilibrium([Payoffs(HERE, ("a",), chosen, measured)], resamples=400)["alone"]
    half = 1.96 * measured.std() / np.sqrt(count)
    assert alone.value == pytest.approx(measured.mean())
    assert (alone.low, alone.high) == pytest.approx(
        (measured.mean() - half, measured.mean() + half), abs=half / 4
    )


@given(games=st.lists(SCORES, min_size=1, max_size=3))
def test_neither_side_gains_by_leaving_the_equilibrium(games: list[np.ndarray]) -> None:
    found = solve(games)
    assert found.models.sum() == pytest.approx(1)
    assert all(mixture.sum() == pytest.approx(1) for mixture in found.attacks)
    assert responded(found.models, games, games) == pytest.approx(found.value, abs=1e-7)
    best = np.mean(
        [game @ mixture for game, mixture in zip(games, found.attacks, strict=True)], axis=0
    ).max()
    assert best == pytest.approx(found.value, abs=1e-7)


def scores(
    model: str, attack: str, method: str, value: float, condition: Condition = HERE
) -> AttackScores:
    games = np.full((2, 3), value)
    measured = {"utility": games, "blind": 0 * games}
    return AttackScores(
        model, condition, attack, method, False, attack, games, measured, games, games, np.zeros(1)
    )


def test_attacks_that_some_model_has_not_met_are_no_strategies() -> None:
    rows = [scores(m, "lies", "scripted", 0.5) for m in ("a", "b")]
    rows += [
        scores(m, "evolution", "evolution", 0.1) for m in ("a", "b")
    ]  # two attacks of one name
    rows += [
        scores("a", "ring", "scripted", 0.1),
        scores("a", "nobody", "nobody", 1.0, Condition("market", "honest", 0.0)),
    ]
    longer = np.pad(
        rows[0].chosen, ((0, 0), (0, 2)), constant_values=np.nan
    )  # the worst attack has further games
    rows[0] = rows[0]._replace(chosen=longer, score=np.full((2, 5), 0.5))
    (found,) = payoffs(rows, ["a", "b"])
    assert (found.condition, found.attacks, found.chosen.shape) == (HERE, ("lies",), (2, 1, 6))
    with refuses(ValueError, "2", "market", "30"):
        payoffs(rows[2:], ["a", "b"])
    with refuses(ValueError):
        payoffs(rows[-1:], ["a"])


def test_intervals_hold_the_truth_of_a_game_with_noise() -> None:
    rng = np.random.default_rng(0)
    truth = np.array([[0.9, 0.2], [0.1, 0.6]])
    games = [
        Payoffs(
            where,
            ("x", "y"),
            *(truth[..., None] + rng.normal(0, 0.1, (2, 2, 200)) for _ in range(2)),
        )
        for where in (HERE, THERE)
    ]
    found = equilibrium(games, resamples=100)
    value, first = 0.52 / 1.2, 0.5 / 1.2
    (mixture,), (gain,), alone = found["mixture"], found["gain"], found["alone"]
    assert mixture.low <= value <= mixture.high
    assert found["weight"][0].low <= first <= found["weight"][0].high
    assert gain.low > 0
    assert gain.value == pytest.approx(mixture.value - max(x.value for x in alone), abs=0.02)
    assert equilibrium(games, resamples=100) == found
    assert found["exploitability"][0].value == pytest.approx(mixture.value - alone[0].value)


def test_an_interval_is_as_wide_as_the_noise_of_all_games_makes_it() -> None:
    """Each condition has games of its own, so the mean over two of them has the error of one over
    the root of two."""
    rng, n = np.random.default_rng(1), 300
    noise = rng.normal(0, 0.1, (2, 2, n))
    noise = (noise - noise.mean(axis=-1, keepdims=True)) / noise.std(axis=-1, keepdims=True) * 0.1
    for conditions in (1, 2):
        games = []
        for k in range(conditions):
            measured = np.stack([0.8 + noise[k, 0], 0.1 + noise[k, 1]])[:, None]
            games.append(Payoffs((HERE, THERE)[k], ("x",), measured, measured))
        found, half = equilibrium(games, resamples=600), 1.96 * 0.1 / n**0.5 / conditions**0.5
        for interval in (*found["alone"], *found["mixture"]):
            assert (interval.high - interval.low) / 2 == pytest.approx(half, rel=0.15)


def test_the_page_says_what_the_table_has() -> None:
    lines = (DOCS / "equilibrium" / "equilibrium.md").read_text(encoding="utf-8").splitlines()
    facts = {}
    for line in lines[lines.index("| defender | skill |") + 2 :][:4]:
        what, numbers = line.strip("| ").split(" | ")
        facts[what.partition(",")[0]] = [float(x.strip("(),")) for x in numbers.split()]
    mixture, gain, informed, mixed = facts.values()
    assert gain == [0, 0, 0]
    assert informed[0] > mixture[0]
    assert abs(mixed[0] - informed[0]) < 0.01
    rows = csv_rows(DOCS / "equilibrium" / "equilibrium.csv")
    assert [row["model"] for row in rows if float(row["weight"]) > 0.01] == ["first-hand"]
    assert all(
        line.endswith("100% |")
        for line in lines[lines.index("| condition | the attacker's mixture |") + 2 :][:16]
    )


def test_the_study_of_a_played_suite(tmp_path):
    suite = small(models=["mean", "median", "constant"], methods=["scripted"])
    benchmark(suite=suite, out=tmp_path / "played", workers=0, progress=False)
    results = ["--results", str(tmp_path / "played/results.sqlite"), "--resamples", "20"]
    run("studies.equilibrium", [*results, "--out", str(tmp_path / "out")])
    rows = csv_rows(tmp_path / "out/equilibrium.csv")
    assert {row["model"] for row in rows} == {"mean", "median", "constant"}
    assert sum(float(row["weight"]) for row in rows) == pytest.approx(1, abs=1e-5)
    assert [float(row["alone"]) for row in rows] == sorted(
        (float(row["alone"]) for row in rows), reverse=True
    )
    assert "| best mixture | " in (tmp_path / "out/equilibrium.md").read_text()
