"""The pages on leaderboards agree with the tables of all suites."""

import csv
import re
from pathlib import Path

import pytest
from scipy.stats import spearmanr

from roletrust_env.benchmarking.known_attacks import read_known_attacks

BOARDS = Path(__file__).parents[1] / "docs" / "leaderboards"
CURRENT = (BOARDS.parent / "robustness.md").read_text(encoding="utf-8")
FIRST, SECOND, THIRD, FOURTH = (
    (BOARDS / f"{name}.md").read_text(encoding="utf-8") for name in ("first", "second", "third", "fourth")
)

Rows = dict[str, dict[str, str]]


def rows(name: str) -> Rows:
    with (BOARDS / name).open(encoding="utf-8") as file:
        return {row["model"]: row for row in csv.DictReader(file)}


def worst_cases(name: str) -> list[dict[str, str]]:
    """The conditions with an attack."""
    with (BOARDS / name).open(encoding="utf-8") as file:
        return [row for row in csv.DictReader(file) if row["attack"] != "nobody"]


def scores(rows: list[dict[str, str]]) -> dict[tuple[str, ...], float]:
    return {(row["model"], row["scenario"], row["track"], row["share"]): float(row["score"]) for row in rows}


ONE, TWO, THREE = rows("standard.csv"), rows("standard-2.csv"), rows("standard-3.csv")
FOUR, FIVE = rows("standard-4.csv"), rows("standard-5/leaderboard.csv")


def table(page: str) -> list[str]:
    return [line for line in page.splitlines() if line.startswith("| `")]


def test_the_order_of_models_with_one_trust_hardly_changed() -> None:
    names = [name for name, row in THREE.items() if row["published"] == row["worst"] and name != "constant"]
    found = spearmanr(*([float(board[name]["worst"]) for name in names] for board in (TWO, THREE)))
    assert f"it is {found.statistic:.2f}" in SECOND


def skill(row: dict[str, str]) -> str:
    return f"{float(row['score']):.2f} ± {float(row['score_half_95']):.2f}"


def test_the_best_models_of_each_condition_are_those_of_the_table() -> None:
    rows = worst_cases("standard-5/worst_cases.csv")
    expected = []
    for where in dict.fromkeys((row["scenario"], row["track"], row["share"]) for row in rows):
        here = {row["model"]: row for row in rows if (row["scenario"], row["track"], row["share"]) == where}
        control = here.pop("own-experience")
        best = max(here.values(), key=lambda row: float(row["score"]))
        name = f"{where[0]}, {where[1]} {float(where[2]):.0%}"
        expected.append(f"| {name} | {skill(control)} | `{best['model']}` | {skill(best)} |")
    lines = CURRENT.partition("| condition |")[2].partition("\n\n")[0].splitlines()
    assert sorted(lines[2:]) == sorted(expected)


def worst(row: dict[str, str]) -> str:
    return f"{float(row['worst']):.3f}"


def test_the_places_in_the_first_two_are_those_of_the_tables() -> None:
    assert table(FIRST) == [
        f"| `{name}` | {ONE[name]['rank']} | {row['rank']} | {worst(ONE[name])} | {worst(row)} |"
        for name, row in TWO.items()
    ]


def test_the_places_in_the_second_and_third_are_those_of_the_tables() -> None:
    before = {name: (f" {row['rank']} ", f" {worst(row)} ") for name, row in TWO.items()}
    old = [before.get(name, (" ", " ")) for name in THREE]  # one model is new
    assert table(SECOND) == [
        f"| `{name}` |{place}| {row['tier']} | {row['rank']} |{score}| {worst(row)} |"
        for (name, row), (place, score) in zip(THREE.items(), old, strict=True)
    ]


SUCCESSIVE = [(THIRD, THREE, FOUR), (FOURTH, FOUR, FIVE)]  # pages on suites with the same conditions


@pytest.mark.parametrize(("page", "old", "new"), SUCCESSIVE)
def test_the_places_in_later_suites_are_those_of_the_tables(page: str, old: Rows, new: Rows) -> None:
    absent = dict.fromkeys(("tier", "rank", "worst"), "")
    expected = []
    for name, row in new.items():
        pair = (old.get(name, absent), row)  # some models are new
        cells = [f"`{name}`", *(one["tier"] for one in pair), *(one["rank"] for one in pair)]
        expected.append([*cells, *(one["worst"] and worst(one) for one in pair)])
    assert [[cell.strip() for cell in line.strip("|").split("|")] for line in table(page)] == expected


@pytest.mark.parametrize(("page", "old", "new"), [(FIRST, ONE, TWO), (SECOND, TWO, THREE), *SUCCESSIVE])
def test_the_rank_correlation_is_that_of_the_tables(page: str, old: Rows, new: Rows) -> None:
    names = [name for name in new if name != "constant" and name in old]
    found = spearmanr(*([float(board[name]["worst"]) for name in names] for board in (old, new)))
    assert re.findall(r"of the\w* two columns is (-?[\d.]+\d)", " ".join(page.split())) == [f"{found.statistic:.2f}"]


@pytest.mark.parametrize(
    ("page", "old", "new"),
    [
        (THIRD, "standard-3-worst_cases.csv", "standard-4-worst_cases.csv"),
        (FOURTH, "standard-4-worst_cases.csv", "standard-5/worst_cases.csv"),
    ],
)
def test_a_page_counts_the_conditions_that_moved(page: str, old: str, new: str) -> None:
    before, after = (scores(worst_cases(name)) for name in (old, new))
    moved = [after[key] - before[key] for key in before]
    lower, higher = (sum(sign * change > 0.02 for change in moved) for sign in (-1, 1))
    words = " ".join(page.split())
    assert f"In {lower} of the {len(moved)} conditions of all models, the worst case is more than 0.02 lower" in words
    assert f"and in {higher} more than 0.02 higher" in words


def test_the_sentences_on_single_models_are_true() -> None:
    places = {name: (ONE[name]["rank"], TWO[name]["rank"]) for name in ("wary-role-trust", "median")}
    assert places == {"wary-role-trust": ("1", "3"), "median": ("20", "1")}
    moved = {name: (TWO[name]["rank"], THREE[name]["rank"]) for name in ("travos", "median")}
    assert moved == {"travos": ("20", "1"), "median": ("1", "12")}
    assert THREE["own-experience"]["tier"] == "1"
    central = [name for name, row in FIVE.items() if row["published"] == row["worst"]]
    assert central[:2] == ["leave-one-out", "wary-role-trust"]
    assert FIVE["wary-role-trust"]["rank"] == "9"
    assert [row["worst_condition"] for row in FIVE.values()].count("market, identities 30%") == 15
    assert list(FIVE)[:6] == ["first-hand", "travos", "own-experience", "subjective-logic", "fire", "yu-singh"]
    assert [row["tier"] for row in FIVE.values()][:4] == ["1", "2", "2", "3"]
    assert len(FIVE) == 25
    between = [name for name, row in ONE.items() if 0.8795 <= float(row["worst"]) < 0.9625]
    assert len(between) == 20
    assert [row["worst_condition"] for row in TWO.values()].count("crowd, identities 30%") == 20


def test_the_sentence_on_searches_is_that_of_the_report() -> None:
    report = (BOARDS / "standard-5" / "report.html").read_text(encoding="utf-8")
    assert re.findall(r"In (\d+ of \d+) cells", CURRENT) == re.findall(r"more than 0\.01 in (\d+ of \d+) cells", report)


def test_no_score_depends_on_places_by_more_than_its_interval() -> None:
    table = (BOARDS / "places.md").read_text(encoding="utf-8").partition("\n\n")[0].splitlines()[2:]
    still = sum(line.count(" 0.00000 ±") == 2 for line in table)
    page = (BOARDS.parent / "how" / "headline.md").read_text(encoding="utf-8")
    assert f"and {still} of {len(table)} models do not move at all" in " ".join(page.split())
    for line in table:
        cells = [tuple(map(float, cell.split(" ± "))) for cell in line.strip("| ").split(" | ")[1:]]
        for (_, noise), (change, half) in (cells[:2], cells[2:]):
            assert abs(change) <= half < noise, line


def test_the_fourth_page_counts_the_attacks_of_longer_searches() -> None:
    suites = BOARDS.parents[1] / "roletrust_env" / "benchmarking" / "suites"
    older = {(*one.condition, one.name) for one in read_known_attacks(suites / "standard-4-known.json")}
    rows = worst_cases("standard-5/worst_cases.csv")
    known = [
        (row["scenario"], row["track"], float(row["share"]), row["attack"]) for row in rows if row["method"] == "known"
    ]
    later = sum(one not in older for one in known)
    counts = f"{later} of {len(rows)} conditions of all models, and an older known one in {len(known) - later}"
    assert f"the worst attack is one of these 96 in {counts}" in " ".join(FOURTH.split())
    assert len(read_known_attacks(suites / "standard-5-known.json")) == 96
    found, tried = scores(rows), worst_cases("standard-5-swap-ends.csv")
    assert {row["attack"] for row in tried} == {"swap-ends"}
    gains = [found[where] - score for where, score in scores(tried).items()]
    conditions = f"{sum(gain > 0 for gain in gains)} of the {len(gains)} conditions in which it plays"
    assert f"lower than the worst case in {conditions}, at most by {max(gains):.3f}" in " ".join(FOURTH.split())


def test_reruns_keep_what_is_promised_within_five_points() -> None:
    lines = [line.strip("| ").split(" | ") for line in (BOARDS / "reruns.md").read_text(encoding="utf-8").splitlines()]
    kept = {cells[0]: float(cells[2]) - float(cells[1]) for cells in lines if len(cells) == 4 and cells[1][0].isdigit()}
    assert abs(kept["means are within the interval of their difference"]) <= 0.05
    assert abs(kept["ranks are the same, all"]) <= 0.05
    assert min(kept, key=lambda name: kept[name]) == "ranks are the same, holds from 0.4 to 0.6"
