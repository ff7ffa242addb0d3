"""Suites as data, and their cells."""

import hashlib
import sys
from pathlib import Path
from types import ModuleType

import pytest
from refusals import refuses
from small_suites import MARKET, TRACKS, small

from roletrust_env import attackers, make_attacker
from roletrust_env.benchmarking import Leaderboard, benchmark, suite_files
from roletrust_env.benchmarking.cells import objective, play_cell
from roletrust_env.benchmarking.known_attacks import read_known_attacks
from roletrust_env.benchmarking.submission import self_contained
from roletrust_env.benchmarking.suite import Cell, Track, attacked_scenario
from roletrust_env.benchmarking.suite_files import load_suite, suites
from roletrust_env.evaluation import Budget, SearchResult, register_search_method
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.measurement import TaskArguments
from roletrust_env.trust import trust_models


def test_the_suites_of_the_project_can_be_played() -> None:
    for name in suites():
        suite = load_suite(name)
        assert suite.description
        every = suite.cells()
        assert len({cell.key for cell in every}) == len(every)
        for cell in every if suite.kind == "robustness" else ():
            if cell.model == every[0].model and cell.seed == every[0].seed:
                attacked_scenario(suite, cell)


def test_all_registered_models_and_attacks_are_in_the_suites() -> None:
    suite = load_suite("quick")
    assert suite.model_names == list(trust_models())
    assert set(attackers()) - set(suite.attack_names) == {"learned"}  # it needs a file


def test_every_attack_is_played_on_a_track_of_the_quick_suite() -> None:
    suite = load_suite("quick").model_copy(update={"games": 2, "methods": ("scripted",)})
    played = [
        row.attack
        for cell in suite.cells()
        if cell.model == "mean"
        for row in play_cell(suite, cell).rows
    ]
    assert set(suite.attack_names) <= set(played)


def test_the_share_determines_the_compromised_agents() -> None:
    suite = small()
    one, half = (
        attacked_scenario(suite, Cell("mean", "market", "raters", share, "scripted", 0))
        for share in (0.25, 0.5)
    )
    assert one.compromised == ("sr_3",)
    assert half.compromised == ("sr_2", "sr_3")
    both = attacked_scenario(suite, Cell("mean", "market", "identities", 0.3, "scripted", 0))
    assert both.compromised == ("sr_3", "sp_2")
    assert [(g.role, g.count, g.reserve) for g in both.scenario.agents] == [
        ("SR", 3, 0),
        ("SP", 2, 0),
        ("SR", 1, 2),
        ("SP", 1, 2),
    ]


@pytest.mark.parametrize(
    ("agents", "reserve", "share"), [(10, 3, 0.3), (6, 3, 0.3), (20, 2, 0.4), (100, 1, 0.25)]
)
def test_a_share_of_identities_is_that_of_all_identities(
    agents: int, reserve: int, share: float
) -> None:
    track = Track(roles=("SR",), shares=(share,), reserve=reserve, counted="identities")

    def part(number: int) -> float:
        return number * (1 + reserve) / (agents + number * reserve)

    nearest = min(range(1, agents), key=lambda number: abs(part(number) - share))
    assert track.compromised(share, agents) == nearest
    assert track.model_copy(update={"counted": "agents"}).compromised(share, agents) == max(
        1, round(share * agents)
    )


def test_a_scenario_may_have_some_of_the_tracks_and_budgets_of_its_own() -> None:
    square = {
        **MARKET,
        "shares": {"honest": [], "raters": [0.25]},
        "budgets": {"random search": 70},
    }
    suite = small(
        scenarios={"square": square, "market": MARKET},
        methods=["scripted", "random search"],
        budget=90,
    )
    found = [
        cell[1:5] for cell in suite.cells() if cell.model == "mean" and cell.scenario == "square"
    ]
    assert found == [
        ("square", "honest", 0.0, "nobody"),
        ("square", "raters", 0.25, "scripted"),
        ("square", "raters", 0.25, "random search"),
    ]
    assert [where for where in suite.conditions if where[0] == "square"] == [
        ("square", "raters", 0.25)
    ]
    assert len(suite.conditions) == 1 + 4
    assert {cell.scenario: suite.budget_of(cell) for cell in suite.cells()} == {
        "square": 70,
        "market": 90,
    }
    tracks = {
        name: {**track, "budgets": {"random search": 80}}
        for name, track in TRACKS.items()
        if name != "honest"
    }
    suite = small(scenarios=suite.scenarios, tracks={**TRACKS, **tracks}, methods=["random search"])
    assert {one.scenario: suite.budget_of(one) for one in suite.cells() if one.share} == {
        "square": 70,
        "market": 80,
    }


def test_a_scenario_may_have_some_of_the_methods() -> None:
    square = {**MARKET, "methods": ["scripted"]}
    suite = small(
        scenarios={"square": square, "market": MARKET},
        methods=["scripted", "random search"],
        games=4,
    )
    found = {cell.scenario: cell.method for cell in suite.cells() if cell.method == "random search"}
    assert list(found) == ["market"]
    with refuses(ValueError, "methods", "market", "PPO"):
        small(scenarios={"market": {**MARKET, "methods": ["PPO"]}})


def test_a_suite_without_other_files_has_the_same_cells() -> None:
    for name in ("quick", "standard"):
        suite = load_suite(name).model_copy(update={"models": ("mean",)})
        alone = self_contained(suite, ["mean"])
        assert alone.cells() == suite.cells()
        assert all(alone.budget_of(cell) == suite.budget_of(cell) for cell in alone.cells())


@pytest.mark.parametrize(
    ("scenario", "words"),
    [
        ({"shares": {"liars": [0.3]}}, ("shares", "market", "liars")),
        ({"shares": {"raters": []}}, ("shares", "market")),
        ({"shares": {"honest": [0.3]}}, ("shares", "market")),
        ({"shares": {"raters": [1.5]}}, ("scenarios.market.shares.raters.0", "1.5")),
    ],
)
def test_a_scenario_with_tracks_or_budgets_that_do_not_exist_is_refused(
    scenario: dict, words: tuple[str, ...]
) -> None:
    with refuses(ValueError, *words):
        small(scenarios={"market": {**MARKET, **scenario}})


def test_identities_are_counted_where_there_are_some() -> None:
    with refuses(ValueError, "counted", "identities", "0"):
        small(tracks={"raters": {"roles": ["SR"], "shares": [0.3], "counted": "identities"}})


def test_one_agent_of_a_role_stays_honest() -> None:
    suite = small(tracks={"raters": {"roles": ["SR"], "shares": [0.95]}})
    with refuses(ValueError, "4", "SR", "market"):
        attacked_scenario(suite, suite.cells()[0])


def test_the_objective_of_the_planner_has_a_gradient() -> None:
    assert [
        objective("PPO", ["SP"]),
        objective("white-box planner", ["SP"]),
        objective("white-box planner", ["SR", "SP"]),
    ] == ["mislead", "exploit", "damage"]


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"games": 1}, ("games", "1")),
        ({"methods": ["a|b"]}, ("methods",)),
        ({"methods": ["nobody"]}, ("methods", "nobody")),
        ({"seeds": [0, 0]}, ("seeds",)),
        ({"scenarios": {}}, ("scenarios", "{}")),
        ({"scenarios": {"market": MARKET | {"preset": "nowhere"}}}, ("nowhere",)),
        ({"scenarios": {"market": {"preset": "market", "set": {"lamb": 1}}}}, ("lamb",)),
        (
            {"scenarios": {"market": MARKET | {"max_cycles": 3}}},
            ("max_cycles", "set"),
        ),
        ({"agents": []}, ("agents", "preset")),
        ({"scenarios": {"market": {"scenario": "market"}}}, ("preset",)),
        ({"tracks": {"raters": {"roles": ["SR"]}}}, ("roles",)),
        (
            {"tracks": {"raters": {"reserve": 1}}},
            ("reserve", "1"),
        ),
        (
            {"tracks": {"raters": {"games": 4}}},
            ("games", "4"),
        ),
        ({"scenarios": {"market": MARKET | {"methods": []}}}, ("methods",)),
        (
            {"scenarios": {"market": MARKET | {"methods": ["scripted"] * 2}}},
            ("methods",),
        ),
        ({"tracks": {"a|b": {}}}, ("tracks",)),
        ({"budgets": 1}, ("budgets", "1")),
        ({"seeds": ["0"]}, ("seeds.0", "0")),
    ],
)
def test_an_invalid_suite_is_refused(fields: dict, words: tuple[str, ...]) -> None:
    with refuses(ValueError, "small", *words):
        small(**fields)


def test_an_invalid_suite_file_is_refused(tmp_path: Path) -> None:
    for text, words in (
        ("= 1", ("1", "mine.toml")),
        ("games = 8", ("scenarios",)),
        ("games = 'all'", ("games",)),
    ):
        path = tmp_path / "mine.toml"
        path.write_text(text)
        with refuses(ValueError, *words):
            load_suite(path)
    with refuses(ValueError, "2", "none.toml"):
        load_suite(tmp_path / "none.toml")
    with refuses(ValueError, "brief"):
        load_suite("brief")


@pytest.mark.parametrize(
    ("name", "method"),
    [("quick", "random search"), pytest.param("standard", "agreed CMA-ES", marks=pytest.mark.slow)],
)
def test_budgets_are_enough_for_the_searches_of_a_suite(name: str, method: str) -> None:
    suite = load_suite(name)
    result = play_cell(suite, Cell("mean", next(iter(suite.scenarios)), "raters", 0.3, method, 0))
    assert result.rows, result.unsuitable


def test_a_suite_extends_one_of_the_project_or_a_file_beside_it(tmp_path):
    """Only what it names differs; another base and a circle are refused."""
    path = tmp_path / "mine.toml"
    path.write_text('extends = "standard"\ndescription = "mine"\nbudget = 7\n')
    mine, standard = load_suite(path), load_suite("standard")
    assert (mine.name, mine.description, mine.budget) == ("mine", "mine", 7)
    assert (mine.scenarios, mine.tracks, mine.attacks) == (
        standard.scenarios,
        standard.tracks,
        standard.attacks,
    )
    second = tmp_path / "second.toml"
    second.write_text('extends = "mine.toml"\nseeds = [7]\n')
    again = load_suite(second)
    assert (again.name, tuple(again.seeds), again.budget) == ("second", (7,), 7)
    assert (again.known, again.methods) == (standard.known, standard.methods)
    path.write_text('extends = "second.toml"\n')
    with refuses(ValueError, "mine.toml"):
        load_suite(path)
    for base, words in (
        (
            "develop",
            ("standard",),
        ),
        ("none.toml", ()),
    ):
        path.write_text(f'extends = "{base}"\n')
        with refuses(ValueError, base, *words):
            load_suite(path)


def test_the_known_attacks_of_the_project_are_read_as_they_stand():
    """No two of a condition have one record or name, so that joining changes neither their names
    nor their order."""
    attacks = read_known_attacks(
        Path(suite_files.__file__).parent / "suites" / "standard-known.json"
    )
    assert load_suite("standard").known == attacks


def test_the_suite_of_the_leaderboard_is_frozen():
    """Version 1.2. Another digest is another suite, to be played and published anew."""
    digest = hashlib.sha256(load_suite("standard").model_dump_json().encode()).hexdigest()
    assert digest == "a4f12d76777369dfa5ab857fd3940ba99e6b593631e5753f18e75a8757f2d36e"


class OwnSearch:
    """Search method of another package: it lets every compromised agent bad-mouth."""

    name = "own search"

    def __init__(self, level: float = 0.0) -> None:
        self.level = level

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        budget.spend(10)
        lie = make_attacker("bad-mouthing", level=self.level)
        return SearchResult(
            Scripted(dict.fromkeys(arguments["compromised"], lie)),
            budget.spent,
            f"lies {self.level}",
        )


def test_a_registered_search_method_stands_in_a_suite(monkeypatch: pytest.MonkeyPatch) -> None:
    """By name with parameters, or as a class of a module; tables name it, and an unknown one is
    refused at once."""
    register_search_method("own", OwnSearch)
    plugin = ModuleType("own_searches")
    plugin.OwnSearch = OwnSearch  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "own_searches", plugin)
    methods = ["own:level=0.1", "own_searches:OwnSearch", "scripted"]
    tracks = {"honest": {}, "raters": TRACKS["raters"]}
    suite = small(
        models=["mean"], attacks=["on-off"], tracks=tracks, methods=methods, budget=100, games=4
    )
    board = benchmark(suite=suite, workers=0, progress=False)
    assert board.rows[0].missing == 0
    assert {one.method for one in board.attacks} == {
        "nobody",
        "own:level=0.1",
        "own_searches:OwnSearch",
    }
    assert board.rows[0].worst_attack == "own_searches:OwnSearch"
    assert f"{board.rows[0].worst_attack} (market, raters" in board.to_markdown()
    known = suite.model_copy(update={"white_box": ("own_searches:OwnSearch",)})
    assert Leaderboard.of(known, board.cells).rows[0].worst_attack == "own:level=0.1"
    for name, word in (
        ("owm", "own"),
        ("own_searches:Missing", "own_searches"),
        ("own_searches:sys", "own_searches"),
    ):
        with refuses(ValueError, name, word):
            benchmark(suite=small(methods=[name]), workers=0, progress=False)
    typo = small(scenarios={"market": {**MARKET, "budgets": {"PP": 100}}})
    with refuses(ValueError, "PP"):
        benchmark(suite=typo, workers=0, progress=False)
    assert "search method own:level=0.1" in suite.factories()  # the store compares its source
    for cell in suite.cells():  # known attacks say nothing of a search that cannot start from them
        assert suite.rules(cell)[5] == []
