"""Pages on suites that only studies play agree with their leaderboards, and these suites have seeds
of their own."""

import re
from collections.abc import Iterable
from pathlib import Path

import pytest
from csv_files import csv_rows

from roletrust_env.benchmarking.suite_files import load_suite, suites
from studies import SUITES

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[2] / "docs"
BOARDS = {
    "development": ("better-model", "better-model.csv", ("worst", "clean")),
    "leave-one-out": ("leave-one-out", "leave-one-out.csv", ("worst", "clean", "published")),
    "first-hand": ("first-hand", "first-hand/leaderboard.csv", ("worst", "clean", "published")),
}
MEASURES = [
    ("next rating", "r"),
    ("next rating", "rmse"),
    ("rater forward", "trust"),
    ("attack", "sink, 3 hijacked"),
    ("attack", "lift, honest"),
]


def page(name: str) -> str:
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


def table(text: str, after: str) -> list[str]:
    """The rows of the table behind some text, which is the start of its header or stands before
    it."""
    behind = re.split(r"\n\|[ :|-]+\|\n", text.partition(after)[2], maxsplit=1)[1]
    return behind.partition("\n\n")[0].splitlines()


def estimates(row: dict[str, str], columns: Iterable[str]) -> list[str]:
    return [f"{float(row[name]):.3f} ± {float(row[f'{name}_half_95']):.3f}" for name in columns]


def board(name: str) -> dict[str, dict[str, str]]:
    return {row["model"]: row for row in csv_rows(DOCS / name)}


STANDARD = board("leaderboards/standard/leaderboard.csv")
FIRST_HAND = board("first-hand/leaderboard.csv")


@pytest.mark.parametrize("suite", BOARDS)
def test_the_table_is_the_leaderboard_of_its_suite(suite: str) -> None:
    name, file, columns = BOARDS[suite]
    rows = board(file)
    assert sorted(rows) == sorted(load_suite(SUITES / f"{suite}.toml").model_names)
    assert [line.replace("`", "") for line in table(page(name), "| model | worst-case ")] == [
        f"| {model} | {' | '.join(estimates(row, columns))} | {float(row['false_alarms']):.3f} |"
        for model, row in rows.items()
    ]


@pytest.mark.parametrize("suite", BOARDS)
def test_no_other_suite_has_its_seeds(suite: str) -> None:
    others = {seed for name in suites() for seed in load_suite(name).seeds}
    assert not {*others, *range(100)} & {*load_suite(SUITES / f"{suite}.toml").seeds}


def test_wary_role_trust_has_the_numbers_of_the_leaderboard() -> None:
    section = " ".join(page("better-model").partition("## In the suite standard")[2].split())
    section = section.partition(" Some variants")[0]
    selected = [STANDARD[model] for model in ("wary-role-trust", "role-trust", "qor")]
    numbers = [
        text
        for name in ("worst", "false_alarms")
        for row in selected
        for text in estimates(row, [name])
    ]
    assert re.findall(r"-?0\.\d{3} ± 0\.\d{3}", section) == numbers
    assert f"all {len(STANDARD)} models" in section


def test_the_conditions_of_first_hand_are_those_of_the_report() -> None:
    found: dict[str, dict[str, str]] = {}
    for row in csv_rows(DOCS / "first-hand" / "worst_cases.csv"):
        if float(row["share"]):
            where = f"{row['scenario']}, {row['track']} {float(row['share']):.0%}"
            (found.setdefault(where, {})[row["model"]],) = estimates(row, ["score"])
    assert table(
        page("first-hand"), "| condition | " + " | ".join(f"`{name}`" for name in FIRST_HAND)
    ) == [
        f"| {where} | {' | '.join(of[name] for name in FIRST_HAND)} |"
        for where, of in found.items()
    ]


def test_what_the_page_says_of_the_parts_of_first_hand_is_in_the_tables() -> None:
    tiers = {name: int(row["tier"]) for name, row in FIRST_HAND.items()}
    parts = ("repeats=4", "patience=8", "repeats=4,patience=8")
    assert {tiers[name] for name in ("first-hand", *(f"first-hand:{part}" for part in parts))} == {
        1
    }
    assert 1 < tiers["own-experience"] < tiers["first-hand:power=0"]
    worst, clean = (
        {name: float(row[which]) for name, row in FIRST_HAND.items()}
        for which in ("worst", "clean")
    )
    assert worst["first-hand"] > max(worst[f"first-hand:{part}"] for part in (*parts, "power=6"))
    assert clean["first-hand"] < clean["first-hand:power=6"]
    lost = {name: float(row["alike"]) - float(row["worst"]) for name, row in FIRST_HAND.items()}
    assert max(lost[f"first-hand:{part}"] for part in parts) < lost["first-hand"]


def test_first_hand_stands_beside_others_with_the_numbers_of_the_leaderboard() -> None:
    section = " ".join(
        page("first-hand").partition("## In the leaderboard")[2].partition("## ")[0].split()
    )
    for name in ("first-hand", "travos", "own-experience", "leave-one-out", "wary-role-trust"):
        assert estimates(STANDARD[name], ["worst"])[0] in section
    assert [name for name, row in STANDARD.items() if row["tier"] == "1"] == ["first-hand"]
    central = [name for name, row in STANDARD.items() if row["worst"] == row["published"]]
    assert [name for name in central if "seeds" not in name][:2] == [
        "leave-one-out",
        "wary-role-trust",
    ]


def real(days: int) -> dict[str, list[str]]:
    found: dict[str, dict[tuple[str, str], float]] = {}
    for row in csv_rows(DOCS / f"leave-one-out-{days}.csv"):
        if row["value"]:
            found.setdefault(row["model"], {})[row["protocol"], row["measure"]] = float(
                row["value"]
            )
    return {
        model: [f"{of[m]:.3f}" if m in of else "-" for m in MEASURES] for model, of in found.items()
    }


@pytest.mark.parametrize("days", [30, 7])
def test_the_tables_of_real_ratings_are_those_of_the_files(days: int) -> None:
    part = table(page("leave-one-out"), f"With rounds of {days} days:")
    assert part == [f"| `{model}` | {' | '.join(values)} |" for model, values in real(days).items()]


def test_the_targets_are_met_or_missed_as_the_page_says() -> None:
    ours = [[float(x) for x in real(days)["leave-one-out"]] for days in (30, 7)]
    limits = [(0.38, 1), (0.153, -1), (0.59, 1), (0.46, 1), (0.5, -1)]
    lines = table(page("leave-one-out"), "| target | 30 days | 7 days |")
    for k, (line, (limit, sign)) in enumerate(zip(lines, limits, strict=True)):
        verdicts = [
            f"{one[k]:.3f}, {'met' if sign * (one[k] - limit) >= 0 else 'missed'}" for one in ours
        ]
        assert [part.strip() for part in line.strip("|").split("|")][1:] == verdicts
    for of in (real(30), real(7)):
        assert of["leave-one-out"][0] >= max(row[0] for name, row in of.items() if ":" not in name)
