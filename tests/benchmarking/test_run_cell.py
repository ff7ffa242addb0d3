"""The result of a cell depends on the cell alone."""

import random

import numpy as np
import pytest
from benchmark_cases import results, tiny
from refusals import refuses

from roletrust_baselines.search import RandomSearch
from roletrust_env import make_attacker
from roletrust_env.benchmarking.cells import play_cell
from roletrust_env.benchmarking.entrants import temporary_registration
from roletrust_env.benchmarking.pool import play_safely
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.search import SearchResult
from roletrust_env.trust.models.personal.travos import Travos


def play_all(suite):
    return results((cell, play_cell(suite, cell)) for cell in suite.cells())


@pytest.fixture(scope="module")
def expected():
    return play_all(tiny())


def test_a_cell_is_the_same_in_any_order(expected):
    suite = tiny()
    shuffled = random.Random(0).sample(suite.cells(), len(suite.cells()))
    assert results((cell, play_cell(suite, cell)) for cell in shuffled) == expected


def test_a_cell_does_not_depend_on_the_other_cells_of_its_suite(expected):
    small = tiny(models=["role-trust"], tracks={"raters": {"roles": ["SR"], "shares": [0.5]}})
    assert play_all(small).items() <= expected.items()


def test_the_worst_case_is_chosen_in_other_games_than_it_is_measured_in(expected):
    for key, result in expected.items():
        assert not result.failed
        for row in result.rows:
            assert len(row.chosen["utility"]) == len(row.measured["utility"]) == 3
            assert row.chosen["utility"] != row.measured["utility"], key


def test_a_record_plays_in_place_of_the_search():
    suite = tiny(models=["mean"], methods=["random search"], budget=2000)
    cell = suite.cells()[1]
    (row,) = play_cell(suite, cell).rows
    (again,) = play_cell(suite, cell, row.record).rows
    assert again == row._replace(words="as recorded", rounds=0)
    (other,) = play_cell(suite, cell._replace(seed=9)).rows
    (theirs,) = play_cell(suite, cell, other.record).rows
    assert theirs.measured != row.measured


def test_another_seed_gives_other_numbers(expected):
    assert not results(
        (cell, play_cell(tiny(seeds=[7]), cell)) for cell in tiny(seeds=[7]).cells()
    ).items() & (expected.items())


def test_all_rounds_are_counted():
    suite = tiny(models=["mean"], methods=["scripted"])
    honest, attacked, _ = (play_cell(suite, cell) for cell in suite.cells())
    assert honest.env_steps == 5 * 2 * 3  # rounds x two kinds of games x games
    assert attacked.env_steps == 5 * 2 * 3 * (len(attacked.rows) + 1)  # and the honest twin


def test_a_faulty_model_is_a_one_line_error():
    for model, words in {
        "Raising": "RuntimeError: two lines",
        "Leaving": "SystemExit: 3",
        "NotANumber": "nan",
        "TooMuch": r"[0, 1]",
        "NoSuchModel": "NoSuchModel",
    }.items():
        suite = tiny(models=[f"benchmark_cases:{model}"])
        result = play_safely(suite, suite.cells()[1])
        assert words in result.failed
        assert "\n" not in result.failed
        assert not result.rows


def test_a_faulty_attacker_does_not_affect_others(expected):
    for attack, words in {
        "WildRater": "[0, 1]",
        "NanRater": "NaN",
        "BrokenRater": "ZeroDivisionError",
    }.items():
        suite = tiny(models=["mean"], attacks=["bad-mouthing", f"benchmark_cases:{attack}"])
        cell = suite.cells()[1]
        result = play_safely(suite, cell)
        assert words in result.failed
        assert f"attack benchmark_cases:{attack}: " in result.failed
        assert "\n" not in result.failed
        assert [row.attack for row in result.rows] == ["bad-mouthing"]
        assert result.rows[0] in expected[cell.key].rows  # the same as without the faulty attacker


def test_consumers_are_the_public_or_the_honest_raters():
    """What a judge thinks is no concern of the public; with a central model, both go by the
    published trust."""

    def utility(model, consumers):
        suite = tiny(models=[model], consumers=consumers, games=8, methods=["scripted"])
        cell = next(one for one in suite.cells() if one.track == "raters")
        return [value for row in play_cell(suite, cell).rows for value in row.measured["utility"]]

    assert utility("mean", "raters") == pytest.approx(utility("mean", "public"), abs=1e-12)
    assert utility("travos", "raters") != pytest.approx(utility("travos", "public"), abs=1e-3)


class WithoutJudges(Travos):
    """Travos for consumers who see published trust only."""

    judge_trust = property()  # as if it were not there: to read it is an AttributeError


def test_published_trust_is_worth_what_it_is_worth_to_consumers_without_a_view_of_their_own():
    def measured(model):
        with temporary_registration({"one": model}):
            suite = tiny(models=["one"], consumers="raters", games=8, methods=["scripted"])
            (cell, *_) = [one for one in suite.cells() if one.share == 0.5]
            return play_cell(suite, cell).rows

    for row, other in zip(measured(Travos()), measured(WithoutJudges()), strict=True):
        assert row.attack == other.attack
        assert row.measured["published"] == other.measured["utility"] == other.measured["published"]
        assert row.measured["published"] != pytest.approx(row.measured["utility"], abs=1e-3)


def test_a_model_cannot_know_liars_by_their_place():
    def utility(places, model="benchmark_cases:FirstRaters"):
        suite = tiny(
            models=[model], places=places, games=20, methods=["scripted"], attacks=["complementary"]
        )
        cell = next(one for one in suite.cells() if one.share == 0.5)
        return np.mean(play_cell(suite, cell).rows[0].measured["utility"])

    assert utility("last") > utility("random") + 0.02
    assert utility("random", "mean") == utility("last", "mean")


def test_a_track_measures_its_worst_attacks_in_more_games():
    """The worst of all, and the worst that serves all raters alike, in games that are those of no
    other attack."""
    tracks = {"providers": {"roles": ["SP"], "shares": [0.3], "games": 9}}
    names = ["discrimination:share=0.7", "on-off:bad=0.9", "camouflage:start=90"]
    few, many = ({"providers": tracks["providers"] | {"games": games}} for games in (None, 9))
    plain, found = (
        play_cell(suite, suite.cells()[0])
        for suite in (
            tiny(models=["mean"], methods=["scripted"], attacks=names, tracks=one)
            for one in (few, many)
        )
    )
    assert [len(row.measured["utility"]) for row in plain.rows] == [3, 3, 3]
    assert {row.attack: len(row.measured["utility"]) for row in found.rows} == {
        "discrimination:share=0.7": 9,
        "on-off:bad=0.9": 9,
        "camouflage:start=90": 3,
    }
    for row, before in zip(found.rows, plain.rows, strict=True):
        assert row.chosen == before.chosen
        assert (row.measured == before.measured) == (row.attack == "camouflage:start=90")
        assert not set(before.measured["utility"]) & set(row.measured["utility"][3:])
    assert found.env_steps == plain.env_steps + 5 * 9 * 3  # and the honest twin
    with refuses(ValueError, "providers", "8", "3"):
        tiny(tracks={"providers": tracks["providers"] | {"games": 8}})


def test_an_attack_treats_raters_differently_if_it_did_so_in_its_games():
    tracks = {"providers": {"roles": ["SP"], "shares": [0.3]}}
    suite = tiny(
        models=["mean"],
        methods=["scripted"],
        attacks=["discrimination", "on-off", "rotation:groups=1"],
        tracks=tracks,
    )
    (cell,) = suite.cells()
    treats = {row.attack: row.treats for row in play_cell(suite, cell).rows}
    assert treats == {
        "discrimination": True,
        "on-off": False,
        "rotation:groups=1": False,
    }  # one group is everybody


def lies(arguments, budget, seed):
    """Find lies that depend on the seed."""
    lie = make_attacker("bad-mouthing", level=0.1 * seed)
    return SearchResult(
        Scripted(dict.fromkeys(arguments["compromised"], lie)), 0, "lies", progress=((1, 0.5),)
    )


def test_starts_of_a_search_compare_in_games_that_they_have_in_common(monkeypatch):
    monkeypatch.setattr(RandomSearch, "search", lambda self, *given: lies(*given))
    suite = tiny(models=["mean"], seeds=[0, 1])
    found = {cell: play_cell(suite, cell).rows for cell in suite.cells() if cell.share == 0.5}
    (first,), (second,) = (rows for cell, rows in found.items() if cell.method == "random search")
    assert first.common != second.common
    assert first.measured["blind"] != second.measured["blind"]
    monkeypatch.setattr(RandomSearch, "search", lambda self, *given: lies(*given[:2], 0))
    cell = next(cell for cell in found if cell.method == "random search" and cell.seed == 1)
    (same,) = play_cell(suite, cell).rows
    assert same.common == first.common
    assert not any(
        row.common for cell, rows in found.items() if cell.method == "scripted" for row in rows
    )
    (alone,) = play_cell(tiny(models=["mean"], seeds=[1]), cell).rows
    assert alone == same._replace(common=())
