"""The page on wary role-trust agrees with its leaderboard of the development suite."""

import re
from pathlib import Path

import pytest
from csv_files import csv_rows

from roletrust_env.benchmarking.suite_files import load_suite, suites
from studies import SUITES

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[2] / "docs"


def test_the_table_is_the_leaderboard_of_the_development_suite() -> None:
    rows = csv_rows(DOCS / "better-model.csv")
    assert sorted(row["model"] for row in rows) == sorted(load_suite(SUITES / "development.toml").model_names)
    expected = [
        f"| {row['model']} | {float(row['worst']):.3f} ± {float(row['worst_half_95']):.3f} "
        f"| {float(row['clean']):.3f} ± {float(row['clean_half_95']):.3f} | {float(row['false_alarms']):.3f} |"
        for row in rows
    ]
    page = (DOCS / "better-model.md").read_text(encoding="utf-8")
    assert [line for line in page.splitlines() if line.startswith("| ")][2:] == expected  # below the header


def test_no_other_suite_has_its_seeds() -> None:
    seeds = {seed for name in suites() for seed in load_suite(name).seeds}
    assert not {*seeds, *range(10)} & {*load_suite(SUITES / "development.toml").seeds}


def test_the_page_agrees_with_the_leaderboard() -> None:
    page = (DOCS / "better-model.md").read_text(encoding="utf-8")
    section = page.partition("## In the suite standard")[2].partition("\n\nSome variants")[0]
    rows = {row["model"]: row for row in csv_rows(DOCS / "leaderboards" / "standard" / "leaderboard.csv")}
    numbers = re.findall(r"-?0\.\d{3} ± 0\.\d{3}", " ".join(section.split()))
    selected = [rows[model] for model in ("wary-role-trust", "role-trust", "qor")]
    assert numbers == [
        f"{float(row[name]):.3f} ± {float(row[name + '_half_95']):.3f}"
        for name in ("worst", "false_alarms")
        for row in selected
    ]
    assert f"all {len(rows)} models" in " ".join(section.split())
