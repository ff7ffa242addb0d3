"""The page on leave-one-out trust agrees with its tables, and its suite has a seed of its own."""

from pathlib import Path

import pytest
from csv_files import csv_rows

from roletrust_env.benchmarking.suite_files import load_suite, suites
from studies import SUITES

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "leave-one-out.md").read_text(encoding="utf-8")
MEASURES = [
    ("next rating", "r"),
    ("next rating", "rmse"),
    ("rater forward", "trust"),
    ("attack", "sink, 3 hijacked"),
    ("attack", "lift, honest"),
]


def rows(name: str) -> list[dict[str, str]]:
    return csv_rows(DOCS / name)


def real(days: int) -> dict[str, list[str]]:
    found: dict[str, dict[tuple[str, str], float]] = {}
    for row in rows(f"leave-one-out-{days}.csv"):
        if row["value"]:
            found.setdefault(row["model"], {})[row["protocol"], row["measure"]] = float(row["value"])
    return {model: [f"{of[m]:.3f}" if m in of else "-" for m in MEASURES] for model, of in found.items()}


def table(first: str) -> list[str]:
    return PAGE.partition(f"| {first} |")[2].partition("\n\n")[0].splitlines()[2:]


def test_the_table_is_the_leaderboard_of_its_suite() -> None:
    board = rows("leave-one-out.csv")
    assert sorted(row["model"] for row in board) == sorted(load_suite(SUITES / "leave-one-out.toml").model_names)
    lines = [
        f"| `{row['model']}` | "
        + " | ".join(f"{float(row[n]):.3f} ± {float(row[n + '_half_95']):.3f}" for n in ("worst", "clean", "published"))
        + f" | {float(row['false_alarms']):.3f} |"
        for row in board
    ]
    assert table("model | worst-case skill | clean skill | published | false alarms") == lines


@pytest.mark.parametrize("days", [30, 7])
def test_the_tables_of_real_ratings_are_those_of_the_files(days: int) -> None:
    part = PAGE.partition(f"With rounds of {days} days:\n\n")[2].partition("\n\n")[0].splitlines()[2:]
    assert part == [f"| `{model}` | {' | '.join(values)} |" for model, values in real(days).items()]


def test_the_targets_are_met_or_missed_as_the_page_says() -> None:
    ours = [[float(x) for x in real(days)["leave-one-out"]] for days in (30, 7)]
    limits = [(0.38, 1), (0.153, -1), (0.59, 1), (0.46, 1), (0.5, -1)]
    for k, (line, (limit, sign)) in enumerate(zip(table("target | 30 days | 7 days"), limits, strict=True)):
        verdicts = [f"{one[k]:.3f}, {'met' if sign * (one[k] - limit) >= 0 else 'missed'}" for one in ours]
        assert [part.strip() for part in line.strip("|").split("|")][1:] == verdicts
    for of in (real(30), real(7)):
        assert of["leave-one-out"][0] >= max(row[0] for name, row in of.items() if ":" not in name)


def test_no_other_suite_has_its_seed() -> None:
    seeds = {seed for name in suites() for seed in load_suite(name).seeds}
    assert not {*seeds, *range(10)} & {*load_suite(SUITES / "leave-one-out.toml").seeds}
