"""Suites as data, and their cells."""

from pathlib import Path

import pytest
from small_suites import MARKET, small

from roletrust_env import attackers
from roletrust_env.benchmark.cells import Cell, attacks, cells, models, objective, place
from roletrust_env.benchmark.run_cell import play_cell
from roletrust_env.benchmark.suite import load_suite, suites
from roletrust_env.benchmark.suite_types import suite_type
from roletrust_env.trust import trust_models


@pytest.mark.parametrize("name", suites())
def test_the_suites_that_come_with_the_project_can_be_played(name: str) -> None:
    suite = load_suite(name)
    assert suite.description
    found = suite_type(suite).cells(suite)
    assert len({cell.key for cell in found}) == len(found)
    for cell in found if suite.kind == "robustness" else ():
        if cell.model == found[0].model:
            place(suite, cell)


def test_all_that_is_registered_is_in_the_suites() -> None:
    suite = load_suite("quick")
    assert models(suite) == list(trust_models())
    assert set(attackers()) - set(attacks(suite)) == {"learned"}  # which needs a file


def test_every_attack_finds_a_track_of_the_quick_suite() -> None:
    suite = load_suite("quick").model_copy(update={"games": 2, "rungs": ("scripted",)})
    played = [row.attack for cell in cells(suite) if cell.model == "mean" for row in play_cell(suite, cell).rows]
    assert set(attacks(suite)) <= set(played)


def test_the_compromised_are_the_share_that_is_asked_for() -> None:
    suite = small()
    one, half = (place(suite, Cell("mean", "market", "raters", share, "scripted", 0)) for share in (0.25, 0.5))
    assert one.compromised == ("sr_3",)
    assert half.compromised == ("sr_2", "sr_3")
    both = place(suite, Cell("mean", "market", "identities", 0.3, "scripted", 0))
    assert both.compromised == ("sr_3", "sp_2")
    assert [(g.role, g.count, g.reserve) for g in both.scenario.agents] == [
        ("SR", 3, 0),
        ("SP", 2, 0),
        ("SR", 1, 2),
        ("SP", 1, 2),
    ]


def test_one_agent_of_a_role_stays_honest() -> None:
    suite = small(tracks={"raters": {"roles": ["SR"], "shares": [0.95]}})
    with pytest.raises(
        ValueError, match="compromises 4 of 4 agents with the role SR in scenario 'market'; one at least"
    ):
        place(suite, cells(suite)[0])


def test_the_planner_aims_at_what_has_a_gradient() -> None:
    assert [
        objective("PPO", ["SP"]),
        objective("white-box planner", ["SP"]),
        objective("white-box planner", ["SR", "SP"]),
    ] == [
        "mislead",
        "exploit",
        "damage",
    ]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"games": 1}, "games is 1"),
        ({"rungs": ["sorcery"]}, "rungs"),
        ({"seeds": [0, 0]}, "seeds has something twice"),
        ({"scenarios": {}}, "must each have one at least"),
        ({"scenarios": {"market": MARKET | {"preset": "nowhere"}}}, "unknown scenario 'nowhere'"),
        ({"scenarios": {"market": {"preset": "market", "set": {"lamb": 1}}}}, "lamb"),
        ({"tracks": {"raters": {"roles": ["SR"]}}}, "roles and shares go together"),
        ({"tracks": {"raters": {"reserve": 1}}}, "reserve is 1; it is for compromised agents"),
        ({"tracks": {"a|b": {}}}, "tracks"),
        ({"budgets": 1}, "budgets"),
    ],
)
def test_a_suite_that_cannot_be_played_is_refused(fields: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message) as found:
        small(**fields)
    assert str(found.value).startswith("small: ")


def test_a_file_that_is_no_suite_is_refused(tmp_path: Path) -> None:
    for text, message in (("= 1", "is no TOML"), ("games = 8", "scenarios"), ("games = 'all'", "games")):
        path = tmp_path / "mine.toml"
        path.write_text(text)
        with pytest.raises(ValueError, match=message):
            load_suite(path)
    with pytest.raises(ValueError, match="cannot be read"):
        load_suite(tmp_path / "none.toml")
    with pytest.raises(ValueError, match=r"unknown suite 'brief'. Known: .*quick"):
        load_suite("brief")


@pytest.mark.parametrize("name", ["quick", "standard"])
@pytest.mark.parametrize("rung", ["random search", "CMA-ES"])
def test_budgets_are_enough_for_the_searches_of_a_suite(name: str, rung: str) -> None:
    suite = load_suite(name)
    if rung in suite.rungs:
        for stage in suite.scenarios:
            done = play_cell(suite, Cell("mean", stage, "raters", 0.3, rung, 0))
            assert done.rows, done.unsuitable
