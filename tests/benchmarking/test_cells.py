"""The closed loop: worlds, settings, cells and the leaderboard."""

from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError
from small_suites import small

from roletrust_env.benchmarking.cells import play_cell
from roletrust_env.benchmarking.cost import estimate_seconds
from roletrust_env.benchmarking.leaderboard import Leaderboard
from roletrust_env.benchmarking.play import CellPlay
from roletrust_env.benchmarking.run import InProcess, play_suite, selected_suite
from roletrust_env.benchmarking.suite import Cell, Suite
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_env.benchmarking.worlds import SPREAD, compromise, expected_spread
from roletrust_env.evaluation.agreed import AgreedScripts
from roletrust_env.evaluation.attackers import read_record, record_of
from roletrust_env.evaluation.received import RANGES, SCORES
from roletrust_env.world.roster import Roster


def test_worlds_depend_on_seed_use_and_number_alone() -> None:
    suite = small()
    again = small()
    more = small(worlds={**suite.worlds.model_dump(), "measured": 5})
    other = small(worlds={**suite.worlds.model_dump(), "seed": 1})
    worlds = suite.worlds.worlds("measured")
    assert worlds == again.worlds.worlds("measured") == more.worlds.worlds("measured")[:3]
    assert worlds != other.worlds.worlds("measured")
    assert not set(map(str, worlds)) & set(map(str, suite.worlds.worlds("selection")))


def test_worlds_of_the_suite_have_the_stated_spread() -> None:
    suite = load_suite("standard")
    assert isinstance(suite, Suite)
    worlds = [*suite.worlds.worlds("measured"), *suite.worlds.worlds("selection")]
    assert len(worlds) == 42
    assert min(map(expected_spread, worlds)) >= SPREAD


def test_the_expected_spread_is_that_of_drawn_abilities() -> None:
    world = small().worlds.worlds("measured")[0]
    world = world.change(access={**world.access.model_dump(), "providers": 2})
    providers = sum(group.count for group in world.agents if group.role == "SP")
    drawn = np.sort(np.random.default_rng(0).random((40_000, providers)), axis=1)
    spread = drawn[:, -2:].mean() - drawn.mean()
    assert expected_spread(world) == pytest.approx(spread, abs=0.003)


@pytest.mark.parametrize(("share", "reserve"), [(0.2, 0), (0.3, 0), (0.3, 3)])
def test_the_compromised_share_is_that_of_identities_and_spread_over_groups(
    share: float, reserve: int
) -> None:
    suite = load_suite("standard")
    assert isinstance(suite, Suite)
    for world in suite.worlds.worlds("selection"):
        attacked = compromise(world, ("SR", "SP"), share, reserve)
        roster = Roster.of(attacked.scenario)
        for names in (roster.rater_names, roster.provider_names):
            bad = [name for name in names if roster.owners[name] in attacked.compromised]
            owners = {roster.owners[name] for name in bad}
            assert len(bad) == len(owners) * (1 + reserve)
            # rounded to a whole number of agents
            assert abs(len(bad) - share * len(names)) <= (1 + reserve) / 2 + 1e-9
        assert [group.count for group in world.agents if group.role == "SR"] == [
            sum(group.count for group in attacked.scenario.agents if group.role == "SR")
        ]


def test_too_few_agents_are_refused() -> None:
    world = small().worlds.worlds("measured")[0]
    with pytest.raises(ValueError, match="SP"):
        compromise(world, ("SP",), 0.99)


def test_open_reports_and_own_rules_change_the_world() -> None:
    suite = small()
    own = suite.world(Cell("block", "own", "raters-open", "scripts"), "measured", 0).scenario
    common = suite.world(Cell("block", "common", "raters", "scripts"), "measured", 0).scenario
    assert own.access.by == "model"  # type: ignore[union-attr]
    assert own.access.explore == 0  # type: ignore[union-attr]
    assert own.ratings.open in range(1, 5)
    assert common.ratings.open is None
    assert own.agents == common.agents


def test_models_that_listen_to_nobody_are_immune_to_lies() -> None:
    suite = small()
    for setting in ("raters", "raters-open"):
        rows = play_cell(suite, Cell("own-experience", "common", setting, "scripts")).rows
        assert [row.attack for row in rows] == ["honest", "bad-mouthing", "rank-lies"]
        for row in rows:
            assert row.chosen["skill"] == pytest.approx(rows[0].chosen["skill"])


def test_only_the_worst_attack_of_a_cell_is_measured() -> None:
    suite = small()
    for method in ("scripts", "search"):
        cell = Cell("mean", "common", "coalition", method)
        rows = play_cell(suite, cell).rows
        means = [np.mean(row.chosen["skill"]) for row in rows]  # type: ignore[arg-type]
        assert [k for k, row in enumerate(rows) if row.measured] == [np.argmin(means)]


def test_a_search_spends_its_budget_and_repeats_by_its_seed() -> None:
    suite = small()
    cell = Cell("mean", "common", "coalition", "search")
    rows = play_cell(suite, cell).rows
    cycles = sum(world.max_cycles for world in suite.worlds.worlds("selection"))
    for row in rows:
        # on-off with each kind of lies and a ring, then two generations of eight
        assert [played for played, _ in row.progress] == [3 * cycles, 11 * cycles, 19 * cycles]
        skills = [skill for _, skill in row.progress]
        assert skills == sorted(skills, reverse=True)
        assert row.rounds == 19 * cycles
        again = CellPlay(suite, cell).measure("selection", [read_record(row.record)])
        assert again.scores["skill"][:, 0] == pytest.approx(row.chosen["skill"])
    assert rows[0].attack != rows[1].attack
    assert [row._replace(by_round=()) for row in play_cell(suite, cell).rows] == [
        row._replace(by_round=()) for row in rows
    ]


def test_a_search_finds_a_worse_attack_than_honest_play() -> None:
    suite = small()
    honest = play_cell(suite, Cell("mean", "common", "raters-open", "scripts")).rows[0]
    found = play_cell(suite, Cell("mean", "common", "raters-open", "search")).rows
    for row in found:
        gap = np.mean(honest.chosen["skill"]) - np.mean(row.chosen["skill"])  # type: ignore[arg-type]
        assert gap > 0.1


def test_attacks_side_by_side_play_as_alone() -> None:
    suite = small()
    play = CellPlay(suite, Cell("mean", "common", "coalition", "scripts"))
    attacks = [AgreedScripts(("rank-lies", "on-off")), AgreedScripts(("milking-ring",))]
    together = play.measure("measured", attacks).scores
    alone = [play.measure("measured", [attack]).scores for attack in attacks]
    for name in RANGES:
        for k in range(2):
            assert together[name][:, k] == pytest.approx(alone[k][name][:, 0], nan_ok=True)


def test_scores_lie_in_their_ranges_and_are_none_where_undefined() -> None:
    suite = small()
    clean = play_cell(suite, Cell("mean", "common", "clean", "honest")).rows[0].measured
    silent = play_cell(suite, Cell("mean", "common", "silent", "honest")).rows[0].measured
    coalition = play_cell(suite, Cell("mean", "common", "coalition", "scripts")).rows
    assert coalition
    assert clean["attacker_share"] == clean["silent_skill"] == [None] * 3
    assert None not in silent["silent_skill"]
    for row in coalition:
        for name, values in row.measured.items():
            known = np.array([value for value in values if value is not None])
            assert len(known) == (0 if name == "silent_skill" else 3)
            assert ((known >= SCORES[name].low) & (known <= SCORES[name].high)).all()


def test_the_leaderboard_takes_the_attack_that_is_worst_in_the_selection(tmp_path: Path) -> None:
    suite = small()
    stored = play_suite(suite, InProcess(), out=tmp_path)
    assert not any(result.failed for _, result in stored)
    board = Leaderboard.of(suite, stored)
    for (model, rule, setting), case in board.worst_cases.items():
        rows = [
            row
            for cell, result in stored
            if (cell.model, cell.rule, cell.setting) == (model, rule, setting)
            for row in result.rows
        ]
        means = {row.attack: np.mean(row.chosen["skill"]) for row in rows}  # type: ignore[arg-type]
        assert means[case.attack] == min(means.values())
    solo = {(row.model, row.rule) for row in board.rows if row.estimates["gain"].mean == 0}
    assert {("own-experience", "common"), ("solo-threshold", "own")} <= solo
    for rule in ("common", "own"):
        ranks = [row.rank for row in board.rows if row.rule == rule]
        assert ranks == sorted(ranks)
    # Finished cells are read, not played again.
    again = Leaderboard.of(suite, play_suite(suite, InProcess(), out=tmp_path))
    assert list(map(repr, again.rows)) == list(map(repr, board.rows))


def test_agreed_scripts_survive_their_record() -> None:
    attack = AgreedScripts(("rank-lies", "on-off"), (0.25, 0.5, 1.0))
    assert read_record(record_of(attack)) == attack


@pytest.mark.parametrize(
    "change",
    [
        {"settings": {"clean": {}}},
        {"settings": {"raters": {"roles": ["SR"]}}},
        {"settings": {"raters": {"roles": ["SR"], "share": 0.3, "silent": 0.5}}},
        {"methods": ["replayed"]},
        {"games": 0},
        {"own": ["fire"]},
        {"solo": {"common": "block"}},
        {"usual": {"SR": "bad-mouthing"}},
        {"reports": {"low": 5}},
        {"reports": {"low": 0, "high": 1}},
    ],
)
def test_wrong_suites_are_refused(change: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        small(**change)


def test_an_attack_that_fits_no_setting_is_refused() -> None:
    suite = small(settings={"clean": {}, "raters": {"roles": ["SR"], "share": 0.3}})
    with pytest.raises(ValueError, match="on-off"):
        selected_suite(suite, ["mean"], ["bad-mouthing", "on-off"])
    fitting = selected_suite(suite, ["mean"], ["bad-mouthing"])
    assert fitting.attacks == ("bad-mouthing",)


def test_a_search_without_an_attack_for_the_setting_is_unsuitable() -> None:
    suite = small(attacks=["bad-mouthing"])
    result = play_cell(suite, Cell("mean", "common", "identities", "search"))
    assert result.rows == ()
    assert result.unsuitable


def test_the_time_of_each_cell_is_estimated_by_any_choice_rule() -> None:
    suite = small()
    seconds = estimate_seconds(suite, suite.cells())
    assert seconds.keys() == {cell.key for cell in suite.cells()}
    assert all(0 < value < 100 for value in seconds.values())


def test_a_choice_rule_of_another_package_is_played(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "their_models.py").write_text(
        "from roletrust_env.trust.models.personal.block import Block\n"
        "class Theirs(Block):\n    pass\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    suite = selected_suite(small(), ["their_models:Theirs"])
    assert "their_models:Theirs" in suite.own
    for isolated in (False, True):
        cell = Cell("their_models:Theirs", "own", "raters", "scripts")
        result = play_cell(suite, cell, isolated=isolated)
        assert not result.failed
        assert next(row.attack for row in result.rows) == "honest"
