"""Worlds that the file of a suite draws."""

from pathlib import Path
from typing import Any

import pytest
from refusals import refuses

from roletrust_env import Scenario
from roletrust_env.benchmarking.suite_files import load_suite, reproduction_command
from roletrust_env.benchmarking.worlds import WorldRow, draw_worlds

TABLE: dict[str, Any] = {
    "preset": "market",
    "number": 3,
    "shares": {"raters": [{"low": 0.1, "high": 0.3}]},
    "set": {
        "max_cycles": {"low": 7, "high": 9},
        "agents": [
            {
                "role": "SR",
                "count": 4,
                "bias": {"choices": [0.0, [{"low": -0.2, "high": 0.0}, 0.1]]},
            },
            {"role": "SP", "count": {"low": 3, "high": 5}, "ability": [0.3, 1.0]},
        ],
    },
}
PINNED = [(8, 0.122, 0.0), (8, 0.298, [-0.091, 0.1]), (8, 0.175, [-0.061, 0.1])]
FILE = """
tracks = { raters = { roles = ["SR"], shares = [0.2] } }
worlds = { drawn = { preset = "market", number = 2, set = { max_cycles = { low = 7, high = 900 } } } }
"""  # noqa: E501


def rounds(worlds: dict[str, Any]) -> list[int]:
    return [world["set"]["max_cycles"] for world in worlds.values()]


def test_worlds_are_the_same_everywhere_and_in_their_ranges() -> None:
    found = draw_worlds({"drawn": TABLE})
    assert list(found) == ["drawn-1", "drawn-2", "drawn-3"]
    assert [
        (
            world["set"]["max_cycles"],
            world["shares"]["raters"][0],
            world["set"]["agents"][0]["bias"],
        )
        for world in found.values()
    ] == PINNED
    many = draw_worlds({"drawn": TABLE | {"number": 100}}).values()
    assert {world["set"]["max_cycles"] for world in many} == {7, 8, 9}
    assert {type(world["set"]["agents"][0]["bias"]) for world in many} == {float, list}
    assert all(0.1 <= world["shares"]["raters"][0] <= 0.3 for world in many)
    assert all(world["set"]["agents"][1]["ability"] == [0.3, 1.0] for world in many)


def test_more_worlds_and_further_draws_leave_the_others_as_they_are() -> None:
    found = draw_worlds({"drawn": TABLE})
    more = draw_worlds(
        {"drawn": TABLE | {"number": 9}, "others": TABLE}, scenarios={"mine": {"preset": "market"}}
    )
    assert {name: more[name] for name in found} == found
    assert rounds({name: more[name] for name in found}) == rounds(found)
    further = TABLE | {"set": TABLE["set"] | {"ratings": {"lost": {"low": 0.1, "high": 0.9}}}}
    assert [world["shares"] for world in draw_worlds({"drawn": further}).values()] == [
        world["shares"] for world in found.values()
    ]
    seeds = [str(draw_worlds({"drawn": TABLE}, seed)) for seed in range(3)]
    assert len(set(seeds)) == 3
    assert seeds[0] == str(found)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"number": 0}, ("drawn", "0")),
        ({"color": 1}, ("color",)),
        (
            {"set": {"max_cycles": {"low": 9, "high": 7}}},
            ("low", "9", "7"),
        ),
        ({"set": {"max_cycles": {"low": 1, "high": 10**400}}}, ("high", "10000000000000000000")),
        ({"set": {"continuation": {"low": float("nan"), "high": 1}}}, ("low", "nan")),
        ({"set": {"max_cycles": {"low": "few", "high": 7}}}, ("low", "few")),
        (
            {"set": {"max_cycles": {"choices": []}}},
            ("drawn-1", "max_cycles", "choices"),
        ),
    ],
)
def test_a_wrong_table_is_one_clear_error(change: dict[str, Any], words: tuple[str, ...]) -> None:
    with refuses(ValueError, *words):
        draw_worlds({"drawn": TABLE | change})


def test_a_draw_lies_between_its_ends_however_close_they_are() -> None:
    for low, high in ((0.0001, 0.0004), (0.9996, 0.9999)):
        worlds = draw_worlds(
            {"drawn": TABLE | {"set": {"continuation": {"low": low, "high": high}}}}
        )
        assert all(low <= world["set"]["continuation"] <= high for world in worlds.values())


def test_a_row_shows_how_abilities_change() -> None:
    groups = [{"ability": 0.5}, {"ability": [0.2, 0.9], "drift": 0.01}]
    agents = [{"role": "SR"}, *({"role": "SP"} | group for group in groups)]
    row = WorldRow.of("drifting", Scenario.model_validate({"agents": agents}))
    assert row.ability == "0.5, 0.2 to 0.9, drift 0, 0.01"


def test_a_file_shows_its_worlds_and_draws_others_by_another_seed(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(FILE)
    suite, other = load_suite(path), load_suite(path, 7)
    assert [WorldRow.of(*one).scenario for one in suite.worlds.items()] == ["drawn-1", "drawn-2"]
    assert suite.scenarios != other.scenarios
    assert suite.conditions == other.conditions  # known attacks of the one play in the other
    assert (suite.name, other.name) == ("mine", "mine, worlds 7")
    assert (
        reproduction_command(other, path)
        == f"roletrust benchmark --suite mine.toml --worlds 7 --out {tmp_path}"
    )
    with refuses(ValueError, "quick"):
        load_suite("quick", 7)
    for text, words in (
        (FILE + '[scenarios.drawn-1]\npreset = "market"\n', ("drawn-1",)),
        (
            FILE.replace("max_cycles = {", "cycles = {"),
            ("drawn-1", "cycles"),
        ),
        ("worlds = 3\n", ("worlds", "scenarios")),
    ):
        path.write_text(text)
        with refuses(ValueError, *words):
            load_suite(path)
