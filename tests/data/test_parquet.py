"""Ratings from Parquet files: the same logs as from CSV, and the same refusals."""

import datetime
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_cases import BAD, GOOD
from refusals import refuses

from roletrust_baselines.logs.folders import find_logs
from roletrust_env.data.columns import Columns
from roletrust_env.data.log import read_ratings

arrow = pytest.importorskip(
    "pyarrow", reason="Parquet needs pyarrow: pip install 'roletrust-env[data]'"
)
parquet = pytest.importorskip("pyarrow.parquet")

TIMED = Columns(time="time")


def written(
    folder: Path, columns: dict[str, Any], name: str = "log.parquet", **options: Any
) -> Path:
    parquet.write_table(arrow.table(columns), folder / name, **options)
    return folder / name


def table(csv: str, numbers: bool = True) -> dict[str, list[Any]]:
    """The columns of a CSV text, with numbers as numbers."""
    header, *rows = (line.split(",") for line in csv.strip().split("\n"))
    columns: dict[str, list[Any]] = {
        name: [row[n] for row in rows] for n, name in enumerate(header)
    }
    return {
        name: [float(text) if text else None for text in texts]
        if numbers and name in ("rating", "time")
        else texts
        for name, texts in columns.items()
    }


@pytest.mark.parametrize("numbers", [True, False])
def test_it_is_the_log_of_the_csv_file(tmp_path: Path, numbers: bool) -> None:
    (tmp_path / "log.csv").write_text(GOOD)
    for columns in (TIMED, Columns("1", "2", "3", "4")):
        found = read_ratings(written(tmp_path, table(GOOD, numbers)), columns, scale=(1, 5))
        wanted = read_ratings(tmp_path / "log.csv", TIMED, scale=(1, 5))
        for one, other in zip(found, wanted, strict=True):
            assert np.array_equal(one, other)


def test_many_blocks_and_row_groups_whole_names_and_dates(tmp_path: Path) -> None:
    rng, many = np.random.default_rng(0), 120_000
    days = rng.integers(0, 1000, many)
    columns = {
        "who": arrow.array(rng.integers(0, 500, many)),
        "stars": arrow.array(rng.integers(1, 6, many), arrow.int8()),
        "shop": arrow.array([f"s{n}" for n in rng.integers(0, 9, many)]).dictionary_encode(),
        "day": arrow.array(
            [datetime.date(2020, 1, 1) + datetime.timedelta(int(day)) for day in days]
        ),
    }
    seen: list[int] = []
    path = written(tmp_path, columns, row_group_size=7_000)
    wanted = Columns("who", "shop", "stars", "day")
    log = read_ratings(path, wanted, scale=(1, 5), repeats=True, advance=seen.append)
    assert seen[-1] == many
    order = np.argsort(days, kind="stable")
    assert [log.rater_names[at] for at in log.raters[:50]] == [
        str(one) for one in columns["who"].take(order[:50])
    ]
    assert np.array_equal(log.values, (columns["stars"].to_numpy()[order] - 1) / 4)
    assert log.times is not None
    assert np.array_equal(np.diff(log.times), np.diff(days[order]) * 86400)
    assert log.times[0] == 1577836800 + days.min() * 86400
    stamped = {**columns, "day": columns["day"].cast(arrow.timestamp("ms", tz="UTC"))}
    again = read_ratings(written(tmp_path, stamped), wanted, scale=(1, 5), repeats=True)
    assert np.array_equal(again.times, log.times)


FILES = [
    case
    for case in BAD
    if isinstance(BAD[case][0], str) and "quote" not in case and "row" not in case
]


@pytest.mark.parametrize(
    "case", [case for case in FILES if case not in ("nothing", "no number", "bad time")]
)
def test_bad_rows_get_the_line_that_they_get_in_csv(tmp_path: Path, case: str) -> None:
    content, words = BAD[case]
    assert isinstance(content, str)
    numbers = "date" not in case and "now" not in case
    # a CSV file counts its header
    words = [word - 1 if isinstance(word, int) else word for word in words]
    with refuses(ValueError, "log.parquet", *words):
        read_ratings(written(tmp_path, table(content, numbers)), TIMED, scale=(1, 5))


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"rating": ["1", "good", "3"]}, ("2", "rating", "good")),
        ({"time": ["1", "2", "soon"]}, ("3", "time", "soon")),
        ({"time": arrow.array([1, None, 3], arrow.timestamp("s"))}, ("2", "time", "nan")),
        ({"ratee": ["x", None, "y"]}, ("2", "ratee")),
        ({"time": [True, False, True]}, ("time", "bool")),
        (
            {"ratee": [Decimal(7), Decimal("7.5"), Decimal(8)]},
            ("2", "ratee", "7.5"),
        ),
        (
            {"ratee": [0.5, 1.5, 2.5]},
            ("1", "ratee", "0.5"),
        ),
        ({"rating": [[1], [2], [3]]}, ("rating",)),
    ],
)
def test_columns_of_other_types_are_refused(
    tmp_path: Path, changed: dict[str, Any], words: tuple[str, ...]
) -> None:
    with refuses(ValueError, *words):
        read_ratings(written(tmp_path, {**table(GOOD), **changed}), TIMED, scale=(1, 5))


def test_damaged_files_are_refused(tmp_path: Path) -> None:
    plain = {
        "use_dictionary": False,
        "compression": "none",
        "write_statistics": False,
        "write_page_checksum": True,
    }
    whole = written(tmp_path, table(GOOD), **plain).read_bytes()
    flipped = bytearray(whole)
    flipped[whole.index(np.float64(5).tobytes()) + 6] ^= 1
    cut = tmp_path / "cut.parquet"
    for content in (
        whole[:10],
        whole[: len(whole) // 2],
        whole[:-3],
        b"",
        GOOD.encode(),
        bytes(flipped),
    ):
        cut.write_bytes(content)
        with refuses(ValueError, "cut.parquet"):
            read_ratings(cut, TIMED, scale=(1, 5))
    with pytest.raises(FileNotFoundError):
        read_ratings(tmp_path / "none.parquet")
    with refuses(ValueError, "4", "9"):
        read_ratings(tmp_path / "log.parquet", Columns("1", "2", "9"))
    cut.unlink()
    (tmp_path / "log.csv").write_bytes(whole)
    with refuses(ValueError, "CSV"):
        read_ratings(tmp_path / "log.csv")


def test_a_folder_of_parquet_files_is_found(tmp_path: Path) -> None:
    written(tmp_path, table(GOOD), "my_network.parquet")
    assert [found.path.name for found in find_logs(tmp_path)] == ["my_network.parquet"]
