"""The page on real ratings agrees with its table."""

import csv
import re
from pathlib import Path

import pytest

from roletrust_env.logs.folders import KNOWN
from roletrust_env.logs.measures import Row, measure_tables
from roletrust_env.logs.models import LOG_MODELS
from roletrust_env.storage.markdown import markdown_table
from roletrust_experiments.commands.compare import HEADER

HOUSE = Path(__file__).parents[2]
PAGE = (HOUSE / "docs" / "real.md").read_text(encoding="utf-8")
TABLES = (HOUSE / "docs" / "real" / "real.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    def number(text: str) -> float:
        return float(text or "nan")

    with (HOUSE / "docs" / "real" / "real.csv").open(encoding="utf-8") as file:
        header, *lines = csv.reader(file)
    assert tuple(header) == HEADER
    return [
        (log, sha256, number(every), protocol, model, what, *map(number, values))  # type: ignore[misc]
        for log, sha256, every, protocol, model, what, *values in lines
    ]


def test_the_tables_are_those_of_the_numbers(rows: list[Row]) -> None:
    for title, headings, lines in measure_tables(rows):
        assert f"## {title}\n\n{markdown_table(headings, lines, names=1)}" in TABLES


def test_they_are_of_the_known_logs(rows: list[Row]) -> None:
    assert {row[1]: row[0] for row in rows} == KNOWN
    assert set(LOG_MODELS) <= {row[4] for row in rows}
    assert {row[2] for row in rows} == {2_592_000}


def test_every_number_of_the_text_is_in_the_tables() -> None:
    found = re.findall(r"\d\.\d{3}(?: \(.*?\))?", PAGE)
    assert found
    assert not [one for one in found if one not in TABLES]
