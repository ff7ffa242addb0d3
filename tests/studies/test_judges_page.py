"""The page on trust in judges has the numbers of its files."""

import re
from pathlib import Path

import pytest
from csv_files import csv_rows

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "judges.md").read_text(encoding="utf-8")
ROWS = {path.stem: csv_rows(path) for path in sorted((DOCS / "judges").glob("*.csv"))}


def triples(text: str) -> set[tuple[str, ...]]:
    return set(re.findall(r"(\d\.\d{3})\s\((\d\.\d{3}),\s(\d\.\d{3})\)", text))


def test_every_interval_is_in_a_file() -> None:
    found = triples(PAGE)
    assert len(found) > 15
    known = {
        tuple(f"{float(row[name]):.3f}" for name in ("value", "low", "high"))
        for rows in ROWS.values()
        for row in rows
        if row["low"]
    }
    assert found <= known, found - known


@pytest.mark.parametrize(
    ("words", "file", "where"),
    [
        ("the majority is right in 0.628", "all", ("all", "all", "majority", "5", "0", "accuracy")),
        ("make it 0.846", "all", ("all", "all", "first-hand", "5", "0", "accuracy")),
        (
            "leave-one-out 0.436",
            "all",
            ("adversarial", "adversarial", "leave-one-out", "0", "0", "accuracy"),
        ),
        (
            "Dawid-Skene 0.266",
            "all",
            ("adversarial", "adversarial", "dawid-skene", "0", "0", "accuracy"),
        ),
        (
            "first-hand has 0.823",
            "all",
            ("adversarial", "adversarial", "first-hand", "5", "0", "accuracy"),
        ),
        (
            "yu-singh is right in 0.805",
            "all",
            ("adversarial", "other", "yu-singh", "20", "0", "accuracy"),
        ),
        (
            "and labels alone in 0.659",
            "all",
            ("adversarial", "other", "labels-only", "20", "0", "accuracy"),
        ),
        ("first-hand has 0.961", "all", ("natural", "other", "first-hand", "20", "0", "accuracy")),
        ("the majority to 0.418", "bought", ("all", "all", "majority", "0", "10", "attacked")),
        ("first-hand keeps 0.739", "bought", ("all", "all", "first-hand", "10", "10", "attacked")),
    ],
)
def test_sentences_are_about_what_they_say(words: str, file: str, where: tuple[str, ...]) -> None:
    columns = ("scored", "labelled", "method", "labels", "bought", "measure")
    (row,) = (row for row in ROWS[file] if tuple(row[name] for name in columns) == where)
    assert words in " ".join(PAGE.split())
    assert words.endswith(f"{float(row['value']):.3f}")


def test_without_labels_dawid_skene_ranks_judges_in_reverse() -> None:
    (row,) = (
        row
        for row in ROWS["all"]
        if (row["scored"], row["labelled"], row["method"], row["labels"], row["measure"])
        == ("adversarial", "adversarial", "dawid-skene", "0", "spearman")
    )
    assert float(row["high"]) < -0.9


def test_the_readme_says_the_same() -> None:
    readme = " ".join((DOCS.parent / "README.md").read_text(encoding="utf-8").split())
    values = {
        (row["method"], row["labels"], row["bought"], row["measure"]): f"{float(row['value']):.3f}"
        for row in [*ROWS["all"], *ROWS["bought"]]
        if (row["scored"], row["labelled"]) == ("all", "all") and row["value"]
    }
    majority, ours = (
        values["majority", "0", "0", "accuracy"],
        values["first-hand", "5", "0", "accuracy"],
    )
    assert f"the majority is right in {majority} of the items" in readme
    assert f"make it {ours}" in readme
    assert values["first-hand", "10", "10", "attacked"] > majority


def test_no_worst_bribe_is_honest_on_the_first_items() -> None:
    bribes = {row["bribe"] for row in ROWS["bought"] if row["bribe"]}
    assert len(bribes) > 5
    assert not any("of the items" in bribe for bribe in bribes)
