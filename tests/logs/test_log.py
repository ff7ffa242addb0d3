"""Logs of ratings from the files and frames that people have; what is ambiguous or damaged is
refused in one line."""

import bz2
import gzip
import json
import lzma
import sqlite3
import zipfile
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as arrow
import pytest
from pyarrow import feather, parquet
from refusals import refuses

from roletrust_env.logs import Log, Reading, read

HEAD = "rater,ratee,rating,time\n"
GOOD = HEAD + "a,x,1,10\nb,x,5,20\na,y,3,30\n"
COLUMNS: dict[str, list[Any]] = {
    "rater": ["a", "b", "a"],
    "ratee": ["x", "x", "y"],
    "rating": [1, 5, 3],
    "time": [10, 20, 30],
}
SECOND = 10**9


def written(folder: Path, content: str | bytes, name: str = "log.csv") -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def is_good(log: Log) -> bool:
    """Whether a log is that of `GOOD`."""
    assert log.times is not None
    return (
        (list(log.rater_names), list(log.ratee_names)) == (["a", "b"], ["x", "y"])
        and log.raters.tolist() == [0, 1, 0]
        and log.ratees.tolist() == [0, 0, 1]
        and log.values.tolist() == [0, 1, 0.5]
        and log.times.tolist() == [10 * SECOND, 20 * SECOND, 30 * SECOND]
    )


def sqlite_file(path: Path) -> None:
    with sqlite3.connect(path) as file:
        file.execute("CREATE TABLE r (rater TEXT, ratee TEXT, rating REAL, time INTEGER)")
        file.executemany("INSERT INTO r VALUES (?, ?, ?, ?)", zip(*COLUMNS.values(), strict=True))
    file.close()


def zip_file(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("log.csv", GOOD)


def parquet_folder(path: Path) -> None:
    table = arrow.table(COLUMNS)
    for part in (0, 1):
        folder = path / f"part={part}"
        folder.mkdir(parents=True)
        parquet.write_table(table.slice(2 * part, 2 - part), folder / "data.parquet")


JSON_LINES = "".join(
    json.dumps(dict(zip(COLUMNS, row, strict=True))) + "\n"
    for row in zip(*COLUMNS.values(), strict=True)
)

FILES: dict[str, Any] = {
    "log.csv": GOOD,
    "log.tsv": GOOD.replace(",", "\t"),
    "log.txt": GOOD.replace(",", "|"),
    "blanks.txt": GOOD.replace(",", " "),
    "semicolon.csv": GOOD.replace(",", ";"),
    "windows.csv": GOOD.replace("\n", "\r\n"),
    "mark.csv": b"\xef\xbb\xbf" + GOOD.encode(),
    "utf-16.csv": GOOD.encode("utf-16"),
    "comment.csv": "# a comment\n\n" + GOOD,
    "no-end.csv": GOOD.rstrip(),
    "quotes.csv": GOOD.replace("a,x,1", '"a","x","1"'),
    "white-space.csv": GOOD.replace("a,", "a ,"),
    "more-columns.csv": GOOD.replace("\n", ",more\n"),
    "decimals.csv": GOOD.replace(",5,", ",5.0,").replace(",20\n", ",20.0\n"),
    "log.csv.gz": gzip.compress(GOOD.encode()),
    "log.csv.xz": lzma.compress(GOOD.encode()),
    "log.csv.bz2": bz2.compress(GOOD.encode()),
    "log.zip": zip_file,
    "log.jsonl": JSON_LINES,
    "log.json": json.dumps(
        [dict(zip(COLUMNS, row, strict=True)) for row in zip(*COLUMNS.values(), strict=True)]
    ),
    "utf-16.jsonl": JSON_LINES.encode("utf-16"),
    "log.parquet": lambda path: parquet.write_table(arrow.table(COLUMNS), path),
    "parts": parquet_folder,
    "log.feather": lambda path: feather.write_feather(arrow.table(COLUMNS), path),
    "log.sqlite": sqlite_file,
}


@pytest.mark.parametrize("name", FILES)
def test_read_files(tmp_path: Path, name: str) -> None:
    content, path = FILES[name], tmp_path / name
    if callable(content):
        content(path)
    else:
        written(tmp_path, content, name)
    assert is_good(read(path, scale=(1, 5)))


@pytest.mark.parametrize(
    "frame",
    [
        COLUMNS,
        pd.DataFrame(COLUMNS),
        pd.DataFrame(COLUMNS).astype({"rater": "category"}),
        arrow.table(COLUMNS),
        pd.DataFrame({**COLUMNS, "time": pd.to_datetime(COLUMNS["time"], unit="s", utc=True)}),
        arrow.table({**COLUMNS, "time": arrow.array(COLUMNS["time"], arrow.timestamp("s"))}),
        arrow.table(COLUMNS).to_reader(),
    ],
    ids=["columns", "pandas", "categories", "arrow", "zone", "dates", "reader"],
)
def test_read_frames(frame: Any) -> None:
    assert is_good(read(frame, scale=(1, 5)))


def test_read_workbooks(tmp_path: Path) -> None:
    path = written(tmp_path, b"PK no workbook", "log.xlsx")
    try:
        import openpyxl
    except ImportError:
        with refuses(ValueError, "openpyxl"):
            read(path)
        return
    with refuses(ValueError, "log.xlsx"):
        read(path)
    book = openpyxl.Workbook()
    for row in (list(COLUMNS), *zip(*COLUMNS.values(), strict=True)):
        book.active.append(row)
    book.save(path)
    assert is_good(read(path, scale=(1, 5)))
    book.create_sheet("more")
    book.save(path)
    with refuses(ValueError, "more", "table"):
        read(path, scale=(1, 5))
    assert is_good(read(path, scale=(1, 5), reading=Reading(table="Sheet")))


def test_read_polars() -> None:
    polars = pytest.importorskip("polars")
    assert is_good(read(polars.DataFrame(COLUMNS), scale=(1, 5)))


def test_read_duckdb() -> None:
    duckdb = pytest.importorskip("duckdb")
    frame = pd.DataFrame(COLUMNS)  # noqa: F841 - duckdb reads it by its name
    assert is_good(read(duckdb.sql("SELECT * FROM frame"), scale=(1, 5)))


FORMS: dict[str, tuple[str | bytes, dict[str, Any], list[float]]] = {
    "no header": (
        "6,2,4,1289241911.72836\n6,5,2,1289241941.53378\n",
        {
            **{"rater": "1", "ratee": "2", "rating": "3", "time": "4"},
            **{"scale": (-10, 10), "header": False},
        },
        [0.7, 0.6],
    ),
    "decimal comma": (
        "user;item;rating\na;x;0,5\nb;x;0,25\n",
        {"decimal": ","},
        [0.5, 0.25],
    ),
    "labels beside numbers": (
        HEAD + "a,x,Yes,1\nb,x,no,2\nc,x,0.5,3\n",
        {"labels": {"yes": 1, "no": 0}},
        [1, 0, 0.5],
    ),
    "missing": (
        HEAD + "a,x,NA,1\nb,x,,2\nc,x,0.5,3\n,x,0.5,3\n",
        {"missing": ("NA", "")},
        [0.5],
    ),
    "latin-1": (HEAD.encode() + b"\xe9,x,0.5,1\n", {"encoding": "latin-1"}, [0.5]),
    "named columns": (
        "who,whom,how,user\na,x,1,7\n",
        {"rater": "who", "ratee": "whom", "rating": "how"},
        [1],
    ),
    "its own name before an alias": (HEAD.replace("\n", ",user\n") + "a,x,1,2,b\n", {}, [1]),
    "repeats": (HEAD + "a,x,1,2\na,x,1,2\n", {"repeats": True}, [1, 1]),
}


@pytest.mark.parametrize("form", FORMS)
def test_read_stated_forms(tmp_path: Path, form: str) -> None:
    content, options, values = FORMS[form]
    columns = {name: options[name] for name in ("rater", "ratee", "rating", "time", "scale")
               if name in options}  # fmt: skip
    reading = Reading(**{name: value for name, value in options.items() if name not in columns})
    log = read(written(tmp_path, content), **columns, reading=reading)
    assert log.values == pytest.approx(values)


TIMES: dict[str, tuple[list[str], dict[str, Any], list[int]]] = {
    "seconds": (["1706702400", "1706702401"], {}, [0, SECOND]),
    "decimals": (["1706702400", "1706702400.728361"], {}, [0, 728_361_000]),
    "milliseconds": (["1706702400000", "1706702400001"], {"time_unit": "ms"}, [0, 10**6]),
    "nanoseconds": (["1706702400000000000", "1706702400000000001"], {"time_unit": "ns"}, [0, 1]),
    "dates": (["2024-01-31T12:00:00", "2024-01-31 12:00:00.5"], {}, [0, SECOND // 2]),
    "zones": (["2024-01-31T12:00:00Z", "2024-01-31 14:00:01+02:00"], {}, [0, SECOND]),
    "a form": (
        ["31.01.2024 12", "31.01.2024 13"],
        {"time_format": "%d.%m.%Y %H"},
        [0, 3600 * SECOND],
    ),
}


@pytest.mark.parametrize("name", TIMES)
def test_times_are_whole_nanoseconds(tmp_path: Path, name: str) -> None:
    texts, options, wanted = TIMES[name]
    lines = "".join(f"{rater},x,1,{text}\n" for rater, text in zip("ab", texts, strict=True))
    log = read(written(tmp_path, HEAD + lines), reading=Reading(**options))
    assert log.times is not None
    assert (log.times - 1_706_702_400 * SECOND).tolist() == wanted


def test_ratings_are_in_the_order_of_time(tmp_path: Path) -> None:
    log = read(written(tmp_path, HEAD + "a,x,1,30\nb,y,0,10\nc,x,0.5,20\n"))
    assert log.values.tolist() == [0, 0.5, 1]
    assert [log.rater_names[place] for place in log.raters] == ["b", "c", "a"]


REFUSED: dict[str, tuple[str | bytes, dict[str, Any], tuple[Any, ...]]] = {
    "no header": ("6,2,4,1289241911\n6,5,2,1289241941\n", {}, ("rater", "1289241911")),
    "no header of a shop": ("i1,u1,5,1289241911\n", {}, ("rater", "i1")),
    "a weight and a rating": ("user,item,weight,user_rating\na,x,1,2\n", {}, ("rating", "weight")),
    "two users": ("user,user_id,item,rating\na,b,x,1\n", {}, ("user", "user_id")),
    "two colons": ("user::item::category::rating\na::x::c::1\n", {}, ("::",)),
    "two decimal marks": (HEAD.replace(",", ";") + "a;x;1.5;1\nb;x;2,5;2\n", {}, ("2,5", 3)),
    "another decimal mark": (HEAD.replace(",", ";") + "a;x;1.5;1\n", {"decimal": ","}, ("1.5",)),
    "a mark in the middle": (GOOD + "\ufeffc,x,1,40\n", {}, ("\\ufeffc", 5)),
    "one column": ("rater\na\n", {}, ("rater",)),
    "NaN": (GOOD + "c,x,nan,40\n", {}, (5, "nan")),
    "infinite": (GOOD + "c,x,inf,40\n", {}, (5, "inf")),
    "no number": (GOOD + "c,x,good,40\n", {}, (5, "good")),
    "no rating": (GOOD + "c,x,,40\n", {}, (5,)),
    "no name": (GOOD + ",x,5,40\n", {}, (5, "rater")),
    "a long name": (GOOD + f"{'c' * 10_001},x,5,40\n", {}, (5, "10,001", "10,000")),
    "off the scale": (GOOD + "c,x,6,40\n", {"scale": (1, 5)}, (5, "6")),
    "below the scale": (GOOD + "c,x,-1,40\n", {"scale": (1, 5)}, (5, "-1")),
    "bad time": (GOOD + "c,x,5,soon\n", {}, (5, "soon")),
    "no time": (GOOD + "c,x,5,\n", {}, (5,)),
    "a date after numbers": (GOOD + "c,x,5,2024-01-31\n", {}, (5, "2024-01-31")),
    "milliseconds": (HEAD + "a,x,1,1706659200000\n", {}, ("1706659200000", "time_unit")),
    "a date in another form": (HEAD + "a,x,1,31.01.2024\n", {}, ("31.01.2024", "time_format")),
    "a date without a zone": (
        HEAD + "a,x,1,2024-01-31T00:00Z\nb,x,1,2024-01-31T00:00\n",
        {},
        (3, "2024-01-31T00:00"),
    ),
    "short row": (GOOD + "c,x\n", {}, (5, "4", "2")),
    "long row": (GOOD + "c,x,5,40,50\n", {}, (5, "4", "5")),
    "repeat": (GOOD + "b,x,5,20\n", {}, (5, 3)),
    "rates itself": (GOOD + "x,x,5,40\n", {"same_agents": True}, (5, "x")),
    "no such column": (GOOD, {"rater": "ratr"}, ("ratr", "rater")),
    "a column twice": (GOOD, {"rater": "ratee"}, ("twice",)),
    "nothing": ("", {}, ("log.csv",)),
    "no ratings": (HEAD, {}, ("log.csv",)),
    "a picture": (b"\x89PNG\r\n\x1a\n\x00\xff\xfe", {}, ("log.csv",)),
    "not UTF-8": (GOOD.encode() + b"\xe9,x,1,40\n", {}, (5, "0xe9", "encoding")),
    "a date that does not exist": (
        HEAD + "a,x,1,31.02.2024\n",
        {"time_format": "%d.%m.%Y"},
        (2, "31.02.2024"),
    ),
    "decimal commas as columns": (
        "ann;shop;4,5;0,5\nbob;bar;3,5;0.5\n",
        {"header": False, "decimal": ",", "columns": ("1", "2", "4")},
        ("0.5", 2),
    ),
    "a line break in a name": ('"note\nmore",rater,ratee,rating\nx,a,b,1\n', {}, ("line break",)),
    "a NUL in a name": (GOOD + "c\0,x,1,40\n" + "d,x,1,50\n", {}, ("log.csv",)),
    "an unknown encoding": (GOOD, {"encoding": "klingon"}, ("klingon",)),
}


@pytest.mark.parametrize("case", REFUSED)
def test_read_refuses(tmp_path: Path, case: str) -> None:
    content, options, words = REFUSED[case]
    options = dict(options)
    sides = dict(zip(("rater", "ratee", "rating"), options.pop("columns", ()), strict=False))
    own = {name: options[name] for name in ("scale", "same_agents", "rater") if name in options}
    reading = Reading(**{name: value for name, value in options.items() if name not in own})
    own |= sides
    with refuses(ValueError, "log.csv", *words):
        read(written(tmp_path, content), **{"scale": (1, 5), **own}, reading=reading)


@pytest.mark.parametrize("cut", [10, 40, -5])
@pytest.mark.parametrize("name", ["log.csv.gz", "log.csv.xz", "log.zip", "log.parquet", "log.json"])
def test_truncated_files_are_refused(tmp_path: Path, name: str, cut: int) -> None:
    content, path = FILES[name], tmp_path / name
    if callable(content):
        content(path)
        content = path.read_bytes()
    data = content.encode() if isinstance(content, str) else content
    with refuses(ValueError, name):
        read(written(tmp_path, data[:cut], name), scale=(1, 5))


@pytest.mark.parametrize("column", ["rater", "rating", "time"])
def test_nulls_are_refused(column: str) -> None:
    for value in (None, float("nan")):
        frame = pd.DataFrame({**COLUMNS, column: [*COLUMNS[column][:2], value]})
        with refuses(ValueError, "row 3", column):
            read(frame, scale=(1, 5))
    texts = {**COLUMNS, "rating": ["5", None, "1"]}
    with refuses(ValueError, "row 2", "None"):
        read(texts, scale=(1, 5))


MIXED: dict[str, tuple[dict[str, Any], tuple[Any, ...]]] = {
    "dates and numbers": ({"time": [datetime(2024, 1, 31), 45323]}, ("time",)),
    "dates and times of day": ({"time": [date(2024, 1, 1), datetime(2024, 1, 1, 23)]}, ("time",)),
    "zones": ({"time": [datetime(2024, 1, 1), datetime(2024, 1, 1, tzinfo=UTC)]}, ("time",)),
    "numbers and booleans": ({"rating": [0.5, True]}, ("rating",)),
    "booleans": ({"rating": [True, False]}, ("rating", "true")),
    "objects": ({"rater": [{"id": 1}, "c"]}, ("rater",)),
    "letters": ({"rater": "ab"}, ("rater",)),
}


@pytest.mark.parametrize("case", MIXED)
def test_mixed_columns_are_refused(case: str) -> None:
    change, words = MIXED[case]
    with refuses(ValueError, *words):
        read({"rater": ["a", "b"], "ratee": ["x", "y"], "rating": [0.5, 1.0], **change})


def test_missing_and_labels_are_the_same_for_numbers_and_texts(tmp_path: Path) -> None:
    for rating in ([5, -9], ["5", "-9"]):
        frame = {"rater": ["a", "b"], "ratee": ["x", "x"], "rating": rating}
        assert len(read(frame, scale=(1, 5), reading=Reading(missing=("-9",))).values) == 1
    for rating in ([True, False], ["true", "false"]):
        frame = {"rater": ["a", "b"], "ratee": ["x", "x"], "rating": rating}
        reading = Reading(labels={"true": 5, "false": 1})
        assert read(frame, scale=(1, 5), reading=reading).values.tolist() == [1, 0]


def test_files_of_a_folder_have_the_same_columns(tmp_path: Path) -> None:
    parquet.write_table(arrow.table(COLUMNS), tmp_path / "a.parquet")
    parquet.write_table(arrow.table(COLUMNS).drop_columns(["time"]), tmp_path / "b.parquet")
    with refuses(ValueError, "b.parquet", "a.parquet"):
        read(tmp_path, scale=(1, 5))


def test_numbers_count_to_the_microsecond_in_every_form(tmp_path: Path) -> None:
    text = written(tmp_path, HEAD + "a,x,1,1289241911.728361234\n")
    number = {"rater": ["a"], "ratee": ["x"], "rating": [1], "time": [1289241911.728361234]}
    times = [read(source).times for source in (text, number)]
    assert [each.tolist() for each in times if each is not None] == [[1289241911728361000]] * 2


@pytest.mark.parametrize(
    "content",
    ["null", '{"rater":1}\nnull\n', "[" * 100_000, '{"a":' * 100_000, "[1, 2]", '{"rater": NaN}'],
    ids=["null", "null in a line", "deep array", "deep object", "numbers", "NaN"],
)
def test_other_json_is_refused(tmp_path: Path, content: str) -> None:
    for name in ("log.json", "log.jsonl"):
        with refuses(ValueError, name):
            read(written(tmp_path, content, name))


@pytest.mark.parametrize("source", [None, 7, [1, 2], np.zeros((2, 3))], ids=str)
def test_other_objects_are_refused(source: Any) -> None:
    with refuses(ValueError, type(source).__name__):
        read(source)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"decimal": ";"}, ("decimal", ";")),
        ({"time_unit": "h"}, ("time_unit", "h")),
        ({"header": "maybe"}, ("header", "maybe")),
        ({"separator": ""}, ("separator",)),
        ({"missing": "NA"}, ("missing", "NA")),
        ({"missing": None}, ("missing", "None")),
        ({"time_format": "%H:%M"}, ("time_format", "%H:%M")),
        ({"labels": {1: 2}}, ("labels",)),
        ({"labels": {"yes": float("nan")}}, ("yes", "nan")),
    ],
)
def test_readings_are_checked(options: dict[str, Any], words: tuple[Any, ...]) -> None:
    with refuses(ValueError, *words):
        Reading(**options)


def test_names_are_joined_by_white_space_and_form(tmp_path: Path) -> None:
    lines = "caf\u00e9,x,1,1\ncafe\u0301 ,x,0,2\n"
    assert list(read(written(tmp_path, HEAD + lines)).rater_names) == ["caf\u00e9"]
    members = read({"rater": [1.0, 2.0], "ratee": [2, 3], "rating": [1, 0]}, same_agents=True)
    assert list(members.rater_names) == ["1", "2", "3"]
    assert members.rater_names is members.ratee_names


def test_numbers_that_are_dates_are_refused(tmp_path: Path) -> None:
    """As texts and as numbers; with their form they are read."""
    days = [20240131, 20240201]
    columns = {"rater": ["a", "b"], "ratee": ["x", "x"], "rating": [1.0, 0.5]}
    path = tmp_path / "log.csv"
    path.write_text("rater,ratee,rating,time\na,x,1,20240131\nb,x,0.5,20240201\n")
    for source in (path, columns | {"time": days}):
        with refuses(ValueError, "20240131", "%Y%m%d"):
            read(source)
        times = read(source, reading=Reading(time_format="%Y%m%d")).times
        assert times is not None
        assert times.view("datetime64[ns]").astype("datetime64[D]").astype(str).tolist() == [
            "2024-01-31",
            "2024-02-01",
        ]
    assert read(columns | {"time": [20240131, 20249999]}).times is not None


def test_a_title_and_the_line_of_a_spreadsheet_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    for skip, head in ((1, "Export of May\n"), (2, "Shop,\n\n"), (0, "sep=,\n")):
        path.write_text(f"{head}rater,ratee,rating\na,x,1\nb,x,9\n")
        with refuses(ValueError, f"row {4 + head.count(chr(10)) - 1}", "9"):
            read(path, reading=Reading(skip=skip))
        log = read(path, scale=(0, 9), reading=Reading(skip=skip))
        assert list(log.rater_names) == ["a", "b"]
    for skip in (-1, True, 1.5):
        with refuses(ValueError, "skip", str(skip)):
            Reading(skip=skip)  # type: ignore[arg-type]
