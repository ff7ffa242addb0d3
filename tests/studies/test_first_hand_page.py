"""The page on first-hand trust agrees with its tables, and its suite has seeds of its own."""

from pathlib import Path

import pytest
from csv_files import csv_rows

from roletrust_env.benchmarking.suite_files import load_suite, suites
from studies import SUITES

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "first-hand.md").read_text(encoding="utf-8")


def rows(name: str) -> list[dict[str, str]]:
    return csv_rows(DOCS / "first-hand" / name)


BOARD = {row["model"]: row for row in rows("leaderboard.csv")}


def table(first: str) -> list[str]:
    return PAGE.partition(f"| {first} |")[2].partition("\n\n")[0].splitlines()[2:]


def test_the_table_is_the_leaderboard_of_its_suite() -> None:
    assert sorted(BOARD) == sorted(load_suite(SUITES / "first-hand.toml").model_names)
    assert table("model | worst-case skill | clean skill | published | false alarms") == [
        f"| `{name}` | "
        + " | ".join(f"{float(row[n]):.3f} ± {float(row[n + '_half_95']):.3f}" for n in ("worst", "clean", "published"))
        + f" | {float(row['false_alarms']):.3f} |"
        for name, row in BOARD.items()
    ]


def test_the_table_of_conditions_is_that_of_the_report() -> None:
    found: dict[str, dict[str, str]] = {}
    for row in rows("worst_cases.csv"):
        if float(row["share"]):
            where = f"{row['scenario']}, {row['track']} {float(row['share']):.0%}"
            found.setdefault(where, {})[row["model"]] = f"{float(row['score']):.3f} ± {float(row['score_half_95']):.3f}"
    assert table("condition | " + " | ".join(f"`{name}`" for name in BOARD)) == [
        f"| {where} | {' | '.join(of[name] for name in BOARD)} |" for where, of in found.items()
    ]


def test_what_the_page_says_of_the_parts_is_in_the_tables() -> None:
    tiers = {name: int(row["tier"]) for name, row in BOARD.items()}
    parts = ("repeats=4", "patience=8", "repeats=4,patience=8")
    assert {tiers[name] for name in ("first-hand", *(f"first-hand:{part}" for part in parts))} == {1}
    assert 1 < tiers["own-experience"] < tiers["first-hand:power=0"]
    worst, clean = ({name: float(row[which]) for name, row in BOARD.items()} for which in ("worst", "clean"))
    assert worst["first-hand"] > max(worst[f"first-hand:{part}"] for part in (*parts, "power=6"))
    assert clean["first-hand"] < clean["first-hand:power=6"]
    lost = {name: float(row["alike"]) - float(row["worst"]) for name, row in BOARD.items()}
    assert max(lost[f"first-hand:{part}"] for part in parts) < lost["first-hand"]


def test_its_number_in_the_leaderboard_stands_beside_those_of_others() -> None:
    board = {row["model"]: row for row in csv_rows(DOCS / "leaderboards" / "standard" / "leaderboard.csv")}
    section = " ".join(PAGE.partition("## In the leaderboard")[2].partition("## ")[0].split())
    for name in ("first-hand", "travos", "own-experience", "leave-one-out", "wary-role-trust"):
        assert f"{float(board[name]['worst']):.3f} ± {float(board[name]['worst_half_95']):.3f}" in section
    assert [name for name, row in board.items() if row["tier"] == "1"] == ["first-hand"]
    central = [name for name, row in board.items() if row["worst"] == row["published"]]
    assert [name for name in central if "seeds" not in name][:2] == ["leave-one-out", "wary-role-trust"]


def test_no_other_suite_has_its_seeds() -> None:
    own = {*load_suite(SUITES / "first-hand.toml").seeds}
    assert not own & {*range(100), *(s for name in suites() for s in load_suite(name).seeds)}
