"""The page on the first leaderboard agrees with the tables of both suites."""

import csv
import re
from pathlib import Path

from scipy.stats import spearmanr

DOCS = Path(__file__).parents[1] / "docs"
PAGE = (DOCS / "leaderboards" / "first.md").read_text(encoding="utf-8")


def rows(name: str) -> dict[str, dict[str, str]]:
    with (DOCS / name).open(encoding="utf-8") as file:
        return {row["model"]: row for row in csv.DictReader(file)}


FIRST, SECOND = rows("leaderboards/standard.csv"), rows("leaderboard.csv")


def test_the_places_are_those_of_the_tables() -> None:
    expected = [
        f"| `{name}` | {FIRST[name]['rank']} | {row['rank']} "
        f"| {float(FIRST[name]['worst']):.3f} | {float(row['worst']):.3f} |"
        for name, row in SECOND.items()
    ]
    assert [line for line in PAGE.splitlines() if line.startswith("| `")] == expected


def test_the_rank_correlation_is_that_of_the_tables() -> None:
    names = [name for name in SECOND if name != "constant"]
    found = spearmanr(*([float(table[name]["worst"]) for name in names] for table in (FIRST, SECOND)))
    assert re.findall(r"of the two columns is ([\d.]+)", PAGE) == [f"{found.statistic:.2f}"]


def test_the_sentences_on_single_models_are_true() -> None:
    places = {name: (FIRST[name]["rank"], SECOND[name]["rank"]) for name in ("wary-role-trust", "median")}
    assert places == {"wary-role-trust": ("1", "3"), "median": ("20", "1")}
    between = [name for name, row in FIRST.items() if 0.8795 <= float(row["worst"]) < 0.9625]
    assert len(between) == 20
