"""The worst case, its intervals and the ranking, checked by hand and on games."""

import numpy as np
import pytest
from small_suites import small

from roletrust_env.benchmarking import verdict
from roletrust_env.benchmarking.caveats import caveats, late_gain
from roletrust_env.benchmarking.cells import play_cell
from roletrust_env.benchmarking.leaderboard import (
    Leaderboard,
    _places,
    leaderboard_rows,
    moved_rows,
    score_table,
)
from roletrust_env.benchmarking.schema import AttackResult, CellResult
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import Cell
from roletrust_env.benchmarking.worst_case import attack_scores, worst_cases
from roletrust_env.trust import Ratings, register_trust_model
from roletrust_env.trust.models.central.means import Mean

TRACKS = {"honest": {}, "raters": {"roles": ["SR"], "shares": [0.5]}}
SUITE = small(models=["mean", "median"], methods=["scripted", "white-box planner"], tracks=TRACKS)


def row(attack: str, chosen: list[float], utility: list[float], blind: float = 0.1) -> AttackResult:
    measured = {
        "utility": utility,
        "published": utility,
        "blind": [blind] * 2,
        "damage": [0.2, 0.4],
        "false_alarms": [0, 0],
        "auc": [1, None],
    }
    return AttackResult(attack, attack, 0, {"utility": chosen}, measured)


def stored(
    model: str, *rows: AttackResult, track: str = "raters", method: str = "scripted"
) -> StoredCell:
    cell = Cell(model, "market", track, 0.5 if track == "raters" else 0.0, method, 0)
    return StoredCell(cell, CellResult(rows, 1.0))


RATERS = {"raters": TRACKS["raters"]}
NAMES = [f"mean:lam={0.5 + k / 20}" for k in range(10)]

RUN = [
    stored("mean", row("nobody", [0.9, 0.9], [0.8, 1.0]), track="honest", method="nobody"),
    stored("mean", row("lies", [0.5, 0.7], [0.9, 0.7]), row("silence", [0.6, 0.7], [0.1, 0.1])),
    stored("mean", row("white-box planner", [0.0, 0.0], [0.3, 0.3]), method="white-box planner"),
    stored("median", row("nobody", [0.9, 0.9], [0.9, 0.9]), track="honest", method="nobody"),
    stored(
        "median",
        row("lies", [0.2, 0.2], [0.3, 0.5], blind=0.5),
        row("silence", [0.6, 0.7], [0.1, 0.1]),
    ),
]


def test_the_worst_is_chosen_in_some_games_and_measured_in_others() -> None:
    cases = {
        model: one.attack
        for (model, where), one in worst_cases(attack_scores(SUITE, RUN)).items()
        if where.track == "raters"
    }
    assert cases == {
        "mean": "lies",
        "median": "lies",
    }  # though silence did worse where it is measured


def test_each_seed_chooses_its_own_worst_case() -> None:
    """Lies are worse for the first seed and silence for the second one, though lies are worse for
    both together."""
    first = stored(
        "mean", row("lies", [0.1, 0.1], [0.2, 0.4]), row("silence", [0.9, 0.9], [0.9, 0.9])
    )
    second = stored(
        "mean", row("lies", [0.6, 0.6], [0.8, 0.8]), row("silence", [0.5, 0.5], [0.5, 0.7])
    )
    run = [first, second._replace(cell=second.cell._replace(seed=1))]
    (case,) = worst_cases(attack_scores(SUITE, run)).values()
    assert [one.attack for one in case.choices] == ["lies", "silence"]
    assert case.score == pytest.approx(np.array([[0.2, 0.4], [0.5, 0.7]]))
    assert case.attack == "lies"  # the first one of several
    (line,) = leaderboard_rows(SUITE, run, ["mean"], 2)
    assert line.worst.mean == pytest.approx(0.45)
    assert line.worst.half == pytest.approx(12.706 * 0.15, abs=1e-3)  # Student's t of two seeds
    assert (line.tier, line.holds) == (1, 1.0)


def test_an_attack_without_a_score_is_never_the_worst_case() -> None:
    nothing = row("nothing", [None, None], [0.9, 0.7])  # type: ignore[list-item]
    found = worst_cases(
        attack_scores(SUITE, [stored("mean", nothing, row("lies", [0.5, 0.7], [0.9, 0.7]))])
    )
    assert [one.attack for one in found.values()] == ["lies"]


def test_a_rank_without_an_attack_has_no_probability() -> None:
    honest = [one for one in RUN if one.cell.track == "honest"]
    rows = leaderboard_rows(SUITE, honest, ["mean", "median"], 1)
    assert [one.missing for one in rows] == [0, 0]
    assert all(np.isnan(one.holds) for one in rows)


def test_the_leaderboard_by_hand() -> None:
    first, second = leaderboard_rows(SUITE, RUN, ["mean", "median"], 3)
    assert (first.rank, first.model, first.missing) == (1, "mean", 0)
    assert first.clean.mean == pytest.approx(0.9)
    assert first.worst.mean == pytest.approx(0.8)  # mean of 0.9 and 0.7, without the planner
    assert first.worst.half == pytest.approx(12.706 * 0.1, abs=1e-3)  # Student's t of two games
    assert first.open_worst.mean == pytest.approx(0.3)
    assert first.damage.mean == pytest.approx(0.3)
    assert first.detection.mean == 1  # only of the game in which it is defined
    assert (first.tier, second.tier) == (1, None)  # an incomplete model is not judged
    assert second.worst.mean == pytest.approx(0.5)  # 0.4 by trust, but 0.5 by a blind choice
    assert second.missing == 1  # the planner has not attacked it


def test_models_that_lack_cells_are_last_whichever_number_they_lack() -> None:
    places = _places(np.zeros((4, 1, 2)), (0.1, 0.5, 0.9, 0.5), (1, 1, 1, 1), (0, 1, 2, 3))
    assert (places.ranks, list(places.tiers)) == ({0: 1, 2: 2, 1: 3, 3: 3}, [0])


def test_attacks_that_serve_all_raters_alike_have_a_column_of_their_own() -> None:
    """The model that is best against all attacks is not the best one against these."""
    discrimination = row("discrimination", [0.2, 0.2], [0.3, 0.5])._replace(treats=True)
    lies = row("lies", [0.5, 0.5], [0.8, 0.8])
    run = [
        stored("mean", lies, discrimination),
        stored("median", lies._replace(attack="more lies"), lies),
    ]
    run[1].result.rows[0].chosen["utility"] = [0.4, 0.4]
    run[1] = run[1]._replace(result=CellResult((row("lies", [0.4, 0.4], [0.5, 0.7]),), 1.0))
    board = Leaderboard.of(SUITE, run)
    assert [
        (one.model, one.worst.mean, one.alike.mean, one.rank, one.alike_rank) for one in board.rows
    ] == [
        ("median", pytest.approx(0.6), pytest.approx(0.6), 1, 2),
        ("mean", pytest.approx(0.4), pytest.approx(0.8), 2, 1),
    ]
    assert "| alike |" in board.to_markdown()
    assert "0.800 (1, tier -)" in board.to_markdown().replace(
        " ± 0.000", ""
    )  # the planner has not attacked
    moved = moved_rows(board.rows, board.attacks)
    assert [one.loss for one in moved] == pytest.approx([0.0, 0.4])
    assert (moved[1].condition, moved[1].attack) == ("market, raters 50%", "discrimination")
    assert moved[1].condition_loss == pytest.approx(0.4)
    assert "alike" not in Leaderboard.of(SUITE, RUN).columns


def test_conditions_count_alike_however_many_games_they_have() -> None:
    """Four games of a condition count as two of another one, each the mean of two."""
    tracks = TRACKS | {"providers": {"roles": ["SP"], "shares": [0.5], "games": 4}}
    suite = small(models=["mean"], games=2, tracks=tracks)
    more = row("on-off", [0.5] * 4, [0.2, 0.4, 0.6, 0.8])._replace(by_round=[])
    for name in ("blind", "damage", "auc", "false_alarms"):
        more.measured[name] = [0.1] * 4
    run = [stored("mean", row("lies", [0.5, 0.7], [0.9, 0.7])), stored("mean", more)]
    run[1] = run[1]._replace(cell=Cell("mean", "market", "providers", 0.5, "scripted", 0))
    cases = list(worst_cases(attack_scores(suite, run)).values())
    assert score_table(cases, ["mean"]) == pytest.approx(
        np.array([[[(0.9 + 0.3) / 2, (0.7 + 0.7) / 2]]])
    )


def test_published_trust_has_a_column_of_its_own() -> None:
    raters = row("lies", [0.5, 0.7], [0.9, 0.7], blind=0.5)
    raters.measured["published"] = [0.3, 0.5]
    for score, worst, published in (("utility", 0.8, 0.5), ("skill", 0.6, -0.2)):
        suite = small(
            models=["mean"], methods=["scripted"], tracks=TRACKS, score=score, consumers="raters"
        )
        raters.chosen["blind"] = [0.5, 0.5]
        (line,) = leaderboard_rows(suite, [stored("mean", raters)], ["mean"], 1)
        assert (line.worst.mean, line.published.mean) == pytest.approx((worst, published))
    assert "published" in Leaderboard.of(suite, [stored("mean", raters)]).columns
    assert "published" not in Leaderboard.of(SUITE, RUN).columns


def on_blind(attack: str, utility: list[float], blind: float) -> AttackResult:
    return row(attack, [], utility, blind)._replace(
        chosen={"utility": utility, "blind": [blind] * 2}
    )


def test_on_the_scale_of_skill_the_worst_attack_leaves_least_above_a_blind_choice() -> None:
    milking = on_blind("milking", [0.4, 0.5], 0.2)  # little is on offer, but trust finds it
    steering = on_blind("steering", [0.5, 0.5], 0.6)
    suite = small(models=["mean"], methods=["scripted"], score="skill", tracks=TRACKS)
    honest = stored("mean", on_blind("nobody", [0.9, 0.9], 0.5), track="honest", method="nobody")
    (line,) = leaderboard_rows(suite, [honest, stored("mean", milking, steering)], ["mean"], 2)
    assert line.worst_attack == "steering"
    assert line.worst.mean == pytest.approx((0.5 - 0.6) / 0.4)  # no floor
    assert line.clean.mean == pytest.approx(0.8)
    (worst,) = worst_cases(attack_scores(SUITE, [stored("mean", milking, steering)])).values()
    assert worst.attack == "milking"
    assert Leaderboard.of(suite, [honest, stored("mean", milking, steering)]).legend.startswith(
        "- **score**: skill of choosing"
    )


def test_a_condition_in_which_all_providers_are_alike_has_no_skill() -> None:
    suite = small(models=["mean"], methods=["scripted"], score="skill", tracks=TRACKS)
    (line,) = leaderboard_rows(
        suite, [stored("mean", on_blind("lies", [1.0, 1.0], 1.0))], ["mean"], 1
    )
    assert np.isnan(line.worst.mean)


def test_a_rank_holds_as_often_as_new_games_confirm_it() -> None:
    sure = [
        stored("mean", row("a", [0.5] * 2, [0.9, 0.8])),
        stored("median", row("a", [0.5] * 2, [0.3, 0.2])),
    ]
    assert [line.holds for line in leaderboard_rows(SUITE, sure, ["mean", "median"], 1)] == [1, 1]
    even = [
        stored("mean", row("a", [0.5] * 2, [0.9, 0.2])),
        stored("median", row("a", [0.5] * 2, [0.3, 0.7])),
    ]
    assert (
        0.4 < leaderboard_rows(SUITE, even, ["mean", "median"], 1)[0].holds < 0.8
    )  # one of four resamples has the other order


def test_holds_is_seen_as_often_as_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two runs of ten models, whose games have luck in common and luck of their own."""
    monkeypatch.setattr(verdict, "_RESAMPLES", 600)
    spread = 0.02
    random, said, seen = np.random.default_rng(0), [], []
    for _ in range(60):
        true = random.normal(0.8, spread, (10, 1))
        runs = [
            true + random.normal(0, 0.05, 40) + random.normal(0, 0.06, (10, 40)) for _ in range(2)
        ]
        first, second = (
            leaderboard_rows(
                small(models=NAMES, tracks=RATERS),
                [
                    stored(name, row("a", [0.5] * 2, list(games)))
                    for name, games in zip(NAMES, run, strict=True)
                ],
                NAMES,
                1,
            )
            for run in runs
        )
        ranks = {line.model: line.rank for line in second}
        said += [line.holds for line in first]
        seen += [line.rank == ranks[line.model] for line in first]
    assert np.mean(said) == pytest.approx(np.mean(seen), abs=0.05)


@pytest.fixture(scope="module")
def played() -> list[StoredCell]:
    suite = small(models=["constant", "mean", "role-trust"], games=16)
    return [StoredCell(cell, play_cell(suite, cell)) for cell in suite.cells()]


def test_a_model_that_ignores_ratings_is_last(played: list[StoredCell]) -> None:
    """It takes no damage, and a choice by its trust is a blind choice."""
    suite = small(models=["constant", "mean", "role-trust"], games=16)
    rows = leaderboard_rows(suite, played, suite.model_names, len(played) // 3)
    last = rows[-1]
    assert last.model == "constant"
    assert last.damage.mean == 0
    for one in attack_scores(suite, played):
        if one.model == "constant":
            assert one.measured["utility"] == pytest.approx(one.measured["blind"], abs=1e-12)
    assert rows[-2].worst.mean > last.worst.mean
    assert any(
        "constant: choosing by its trust is no better" in line
        for line in caveats(suite, played, attack_scores(suite, played), ["constant"])
    )


class FirstFive(Mean):
    """A mean of five raters, as compromised agents often are the last ones."""

    def update(self, state, ratings):  # type: ignore[no-untyped-def]
        rated = ratings.weights > 0
        first = (np.arange(len(rated)) < 5).reshape(-1, *[1] * (rated.ndim - 1))
        return super().update(state, Ratings(ratings.values, rated & first))


@pytest.mark.parametrize(
    ("raters", "places", "words"),
    [(5, "last", ""), (6, "last", "the last of their role"), (6, "random", "at random")],
)
def test_a_model_that_goes_by_places_is_named(raters: int, places: str, words: str) -> None:
    register_trust_model("first-five", FirstFive)
    groups = [{"role": "SR", "count": raters}, {"role": "SP", "count": 3}]
    stage = {"market": {"preset": "market", "set": {"max_cycles": 5, "agents": groups}}}
    suite = small(models=["first-five", "mean"], scenarios=stage, tracks=TRACKS, places=places)
    run = [stored(name, row("lies", [0.5] * 2, [0.5] * 2)) for name in suite.models]
    found = [
        line
        for line in caveats(suite, run, attack_scores(SUITE, run), suite.models)
        if "places" in line
    ]
    assert [line.startswith("first-five") and words in line for line in found] == [True] * bool(
        words
    )


class Moody(Mean):
    """Mean with random noise that is too small for the checks of a game."""

    def provider_trust(self, state: object) -> object:
        return super().provider_trust(state) * (1 - 1e-8 * np.random.default_rng().random())


def test_a_random_model_is_a_caveat() -> None:
    register_trust_model("moody", Moody)
    run = [stored(model, row("lies", [0.5] * 2, [0.5] * 2)) for model in ("moody", "mean")]
    lines = caveats(small(), run, attack_scores(SUITE, run), ["moody", "mean"])
    assert [line for line in lines if "random" in line] == [
        "moody: its trust is random, so other runs give other numbers"
    ]


def test_a_model_without_a_played_cell_is_not_run_for_a_caveat() -> None:
    class Bomb(Mean):
        def update(self, state: object, ratings: Ratings) -> object:
            raise SystemExit(3)

    register_trust_model("bomb", Bomb)
    failed = StoredCell(
        Cell("bomb", "market", "raters", 0.5, "scripted", 0), CellResult((), 1.0, failed="given up")
    )
    assert caveats(small(), [failed], [], ["bomb"]) == [
        "bomb, market, raters 0.5, scripted: given up"
    ]


def test_a_partly_failed_cell_is_a_caveat_and_missing() -> None:
    partly = RUN[1]._replace(result=RUN[1].result._replace(failed="attack noise: it broke"))
    line = leaderboard_rows(SUITE, [RUN[0], partly, RUN[2]], ["mean"], 3)[0]
    assert line.missing == 1
    assert line.worst.mean == pytest.approx(0.8)
    (line,) = caveats(SUITE, [partly], attack_scores(SUITE, [partly]), [])
    assert (
        line
        == "mean, market, raters 0.5, scripted: attack noise: it broke; its other 2 attacks count"
    )


def test_there_is_no_caveat_about_a_planner_outside_the_suite() -> None:
    run = [stored("median", row("lies", [0.5] * 2, [0.5] * 2))]
    jumps = "median: trust jumps, so the white-box planner could not attack it"
    for methods, expected in ((["scripted"], False), (["scripted", "white-box planner"], True)):
        assert (
            jumps in caveats(small(methods=methods), run, attack_scores(SUITE, run), ["median"])
        ) == expected


def test_a_search_that_never_beats_the_scripts_is_a_caveat() -> None:
    weak = [
        stored("mean", row("lies", [0.5] * 2, [0.5] * 2)),
        stored("mean", row("PPO", [0.6] * 2, [0.5] * 2), method="PPO"),
    ]
    assert any(
        "PPO never beat the scripts" in line
        for line in caveats(SUITE, weak, attack_scores(SUITE, weak), [])
    )
    strong = [weak[0], stored("mean", row("PPO", [0.4] * 2, [0.5] * 2), method="PPO")]
    assert not caveats(SUITE, strong, attack_scores(SUITE, strong), [])


def test_a_search_that_still_finds_worse_attacks_is_a_caveat() -> None:
    flat, rising = (
        ((10, 0.1), (50, 0.3), (90, 0.3), (100, 0.305)),
        ((10, 0.1), (50, 0.3), (60, 0.5), (100, 0.52)),
    )
    assert late_gain(rising) == pytest.approx(0.22)
    assert late_gain(((100, 0.5),)) == 0.0  # nothing to compare with
    one = row("evolution", [0.1, 0.1], [0.1, 0.1])
    calm, risen = (
        stored("mean", one._replace(progress=seen), method="evolution") for seen in (flat, rising)
    )
    assert not any("doubling" in line for line in caveats(SUITE, [calm], [], []))
    (line,) = caveats(SUITE, [calm, risen], [], [])
    assert (
        "evolution: the last doubling of its rounds gained more than 0.01 in 1 of 2 cells, at most "
        "0.220" in line
    )
    brief = stored(
        "mean", one._replace(progress=((10, 0.3), (50, 0.3), (90, 0.3))), method="evolution"
    )
    (line,) = caveats(SUITE, [calm, brief], [], [])
    assert "evolution: in 1 of 2 cells its course has fewer than 4 points, too few to say" in line


def test_unsuitable_searches_and_conditions_without_attacks_are_caveats() -> None:
    idle = StoredCell(
        Cell("mean", "market", "raters", 0.5, "random search", 0),
        CellResult((), 1.0, unsuitable="too few rounds"),
    )
    assert "random search attacked nothing: too few rounds" in caveats(
        SUITE, [RUN[1], idle], attack_scores(SUITE, [RUN[1]]), []
    )
    assert not any(
        "attacked nothing" in line for line in caveats(SUITE, RUN, attack_scores(SUITE, RUN), [])
    )
    (line,) = (
        line
        for line in caveats(SUITE, RUN[:1], attack_scores(SUITE, RUN[:1]), [])
        if "no attack" in line
    )
    assert (
        line
        == "raters 0.5: no attack was played there, so the worst case is that of the other conditions"  # noqa: E501
    )


def test_cells_that_fail_alike_are_one_line() -> None:
    bad = [
        StoredCell(
            Cell("mine", "market", "raters", share, "scripted", 0),
            CellResult((), 1.0, failed="NaN"),
        )
        for share in (0.1, 0.3, 0.5)
    ]
    assert caveats(SUITE, bad, [], []) == [
        "mine, market, raters 0.1, scripted and 2 more cells: NaN"
    ]


def test_models_that_tie_up_to_rounding_share_a_rank() -> None:
    names = ["mean", "median", "constant", "beta"]
    values = [0.8, 0.8 + 1e-13, 0.8 - 1e-6, 0.5]
    run = [
        stored(name, row("lies", [0.5] * 2, [value] * 2))
        for name, value in zip(names, values, strict=True)
    ]
    ranks = {line.model: (line.rank, line.holds) for line in leaderboard_rows(SUITE, run, names, 1)}
    assert ranks == {"mean": (1, 1.0), "median": (1, 1.0), "constant": (3, 1.0), "beta": (4, 1.0)}


def test_the_worst_attack_is_that_of_the_worst_condition() -> None:
    run = [
        stored("mean", row("lies", [0.5] * 2, [0.6] * 2)),
        StoredCell(
            Cell("mean", "market", "raters", 0.3, "scripted", 0),
            CellResult((row("silence", [0.4] * 2, [0.3] * 2),), 1.0),
        ),
    ]
    (line,) = leaderboard_rows(SUITE, run, ["mean"], 2)
    assert (line.worst_attack, line.worst_condition) == ("silence", "market, raters 30%")


def test_equal_providers_do_not_show_that_a_model_ignores_ratings() -> None:
    equal = [
        stored(
            "mean", row("nobody", [1.0] * 2, [1.0] * 2, blind=1.0), track="honest", method="nobody"
        )
    ]
    assert not any(
        "ignores ratings" in line
        for line in caveats(SUITE, equal, attack_scores(SUITE, equal), ["mean"])
    )
    unequal = [
        stored(
            "mean", row("nobody", [0.7] * 2, [0.7] * 2, blind=0.7), track="honest", method="nobody"
        )
    ]
    assert any(
        "ignores ratings" in line
        for line in caveats(SUITE, unequal, attack_scores(SUITE, unequal), ["mean"])
    )
