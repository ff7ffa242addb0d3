"""Logs of ratings: every kind of bad file is one line with the row."""

import gzip
import sys
from pathlib import Path

import numpy as np
import pytest
from log_cases import BAD, GOOD, HEADER
from refusals import refuses

from roletrust_env.data.columns import Columns
from roletrust_env.data.log import read_ratings
from roletrust_env.data.log_rounds import log_rounds

TIMED = Columns(time="time")


def written(folder: Path, content: str | bytes, name: str = "log.csv") -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize("packed", [False, True])
def test_a_log_is_read(tmp_path: Path, packed: bool) -> None:
    path = (
        written(tmp_path, gzip.compress(GOOD.encode()), "log.csv.gz")
        if packed
        else written(tmp_path, GOOD)
    )
    log = read_ratings(path, TIMED, scale=(1, 5))
    assert (log.rater_names, log.ratee_names) == (["a", "b"], ["x", "y"])
    assert log.raters.tolist() == [0, 1, 0]
    assert log.ratees.tolist() == [0, 0, 1]
    assert log.values.tolist() == [0, 1, 0.5]
    assert log.times is not None
    assert log.times.tolist() == [10, 20, 30]
    assert log.was_sorted
    assert log_rounds(log, every=15).tolist() == [0, 0, 1]


def test_columns_by_number_dates_and_any_order(tmp_path: Path) -> None:
    path = written(
        tmp_path, '\ufeff2024-02-01,0.5,"b, c",q\n2024-01-01,1,d,q\n2024-01-01T00:00:01,0,d,q\n'
    )
    log = read_ratings(path, Columns("3", "4", "2", "1"))
    assert not log.was_sorted
    assert log.values.tolist() == [1, 0, 0.5]
    assert log.rater_names == ["b, c", "d"]
    assert log.times is not None
    assert np.diff(log.times).tolist() == [1, 31 * 86400 - 1]


def test_a_log_of_many_blocks_counts_its_rows(tmp_path: Path) -> None:
    lines = [f"r{n % 700},p{n % 13},0.5\n" for n in range(120_000)]
    lines[110_000] = "r1,p1,none\n"
    seen: list[int] = []
    with refuses(ValueError, "110002", "none"):
        read_ratings(
            written(tmp_path, "rater,ratee,rating\n" + "".join(lines)), advance=seen.append
        )
    assert seen == [50_000, 100_000]


def test_parts_of_seconds_count(tmp_path: Path) -> None:
    log = read_ratings(
        written(tmp_path, HEADER + "a,x,1,2024-01-31T12:00:00.25\nb,x,1,2024-01-31T12:00:01\n"),
        TIMED,
    )
    assert log.times is not None
    assert log.times.tolist() == [1706702400.25, 1706702401.0]


@pytest.mark.filterwarnings("error")
def test_dates_with_time_zones_are_in_utc(tmp_path: Path) -> None:
    lines = (
        "a,x,1,2024-01-31T12:00:00Z\nb,x,1,2024-01-31 "
        "14:00:01+0200\nc,x,1,2024-01-31T09:00:02-03:00\n"
    )
    log = read_ratings(written(tmp_path, HEADER + lines), TIMED)
    assert log.times is not None
    assert log.times.tolist() == [1706702400.0, 1706702401.0, 1706702402.0]


def test_times_are_of_one_kind_in_all_blocks(tmp_path: Path) -> None:
    for one, other, words in (
        ("2024-01-31", "1706659200", ("row", "50002", "1706659200")),
        ("1706659200", "2024-01-31", ("row", "50002", "2024-01-31")),
        (
            "2024-01-31",
            "2024-01-31T00:00Z",
            ("50002", "2024-01-31T00:00Z"),
        ),
        (
            "2024-01-31T00:00-03",
            "2024-01-31T00:00",
            ("2024-01-31T00:00",),
        ),
    ):
        lines = [f"r{n},p,0.5,{one}\n" for n in range(50_000)] + [f"r,p,0.5,{other}\n"]
        with refuses(ValueError, other, *words):
            read_ratings(written(tmp_path, "rater,ratee,rating,time\n" + "".join(lines)), TIMED)


@pytest.mark.parametrize("size", [1 << 20, 20])
def test_bad_files_get_one_line_with_the_row(
    tmp_path: Path, size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where few bytes of the file are parsed at a time."""
    monkeypatch.setattr("roletrust_env.data.tables._BYTES", size)
    for content, words in BAD.values():
        with refuses(ValueError, "log.csv", *words):
            read_ratings(written(tmp_path, content), TIMED, scale=(1, 5))


def test_any_line_ends_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = read_ratings(written(tmp_path, GOOD), TIMED, scale=(1, 5))
    for content in (GOOD.replace("\n", "\r\n"), GOOD.replace("\n", "\r"), GOOD.rstrip()):
        found = read_ratings(written(tmp_path, content), TIMED, scale=(1, 5))
        for one, other in zip(found, wanted, strict=True):
            assert np.array_equal(one, other)


@pytest.mark.parametrize("cut", [10, 40, -5])
def test_a_truncated_gzip_is_refused(tmp_path: Path, cut: int) -> None:
    path = written(tmp_path, gzip.compress((GOOD * 1).encode())[:cut], "log.csv.gz")
    with refuses(ValueError, "log.csv.gz"):
        read_ratings(path, TIMED, scale=(1, 5))
    with refuses(ValueError, "plain.csv.gz"):
        read_ratings(written(tmp_path, GOOD, "plain.csv.gz"), TIMED, scale=(1, 5))


def test_members_that_rate_themselves_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD + "x,x,5,40\n")
    with refuses(ValueError, "5", "x"):
        read_ratings(path, TIMED, scale=(1, 5), same_agents=True)
    assert read_ratings(path, TIMED, scale=(1, 5)).shape == (3, 2)


def test_repeats_may_be_allowed_and_rounds_must_make_sense(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD + "b,x,5,20\n")
    log = read_ratings(path, TIMED, scale=(1, 5), repeats=True)
    assert len(log.values) == 4
    untimed = read_ratings(path, scale=(1, 5))
    for which, every, words in (
        (log, 1e-9, ("20,000,000,000", "1,000,000")),
        (log, -1.0, ("-1", "0")),
        (untimed, 1.0, ("times",)),
    ):
        with refuses(ValueError, *words):
            log_rounds(which, every)


def test_without_pyarrow_it_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with refuses(ValueError, "pyarrow", "roletrust-env[data]"):
        read_ratings(written(tmp_path, GOOD))
