"""Files as people have them are read without an option, or with the one that the message names."""

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dialect_files import (
    ROWS,
    TIMED,
    read_with_notes,
    text,
    texts,
    with_times,
    write,
)
from refusals import refuses

from roletrust_env.data.columns import Columns
from roletrust_env.data.dialect import Dialect, find_encoding, find_separator, look
from roletrust_env.data.log import RatingLog, read_ratings
from roletrust_env.data.units import find_unit

arrow = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")


def check(log: RatingLog) -> None:
    assert log.rater_names == ["ann", "bob"]
    assert log.ratee_names == ["Café", "寿司"]
    assert log.values.tolist() == [1, 0, 0.5]
    assert log.raters.tolist() == [0, 1, 0]
    assert log.ratees.tolist() == [0, 0, 1]
    assert log.times is not None
    assert log.times.tolist() == [row[3] for row in ROWS]


def test_forty_texts_are_one_log(tmp_path: Path) -> None:
    files = dict(texts())
    assert len(files) >= 40
    for name, content in files.items():
        for path, written in (
            (tmp_path / name, content),
            (tmp_path / f"{name}.gz", gzip.compress(content)),
        ):
            path.write_bytes(written)
            try:
                check(read_ratings(path, TIMED, scale=(1, 5)))
            except (ValueError, AssertionError) as error:
                raise AssertionError(f"{path.name}: {content!r}") from error


def test_names_of_any_type_are_the_same(tmp_path: Path) -> None:
    """And a name of a text that looks like a date or a number stays as it is."""
    whole = [1, 20, 1]
    for kind in (
        "int8",
        "uint64",
        "float32",
        "float64",
        "string",
        "large_string",
        "string_view",
        "binary",
    ):
        names = (
            [str(one) for one in whole]
            if "string" in kind
            else [b"1", b"20", b"1"]
            if kind == "binary"
            else whole
        )
        column = arrow.array(names, getattr(arrow, kind)())
        for one in (column, column.dictionary_encode()) if kind != "string_view" else (column,):
            for end in (".parquet", ".pq"):
                parquet.write_table(
                    arrow.table({"rater": one, "ratee": one, "rating": [1, 0, 1]}),
                    tmp_path / f"a{end}",
                )
                assert read_ratings(tmp_path / f"a{end}").rater_names == ["1", "20"], kind
    parquet.write_table(
        arrow.table(
            {
                "rater": [b"\xff\x00", b"x "],
                "ratee": arrow.array([7, 2**60]).cast(arrow.decimal128(20, 0)),
                "rating": [True, False],
            }
        ),
        tmp_path / "b.pq",
    )
    log = read_ratings(tmp_path / "b.pq")
    assert (log.rater_names, log.ratee_names) == (["0xff00", "x"], ["7", str(2**60)])
    for line in (
        '{"rater": "2024-01-31", "ratee": 1.0, "rating": 1}',
        '{"args": {"rater": "2024-01-31", "ratee": 1, "rating": 1}}',
    ):
        log = read_ratings(write(tmp_path, line, "c.jsonl"))
        assert (log.rater_names, log.ratee_names) == (["2024-01-31"], ["1"])
    columns = {"rater": [1.0, None, float("nan")], "ratee": [1, 2, 3], "rating": [1, 0, 1]}
    parquet.write_table(arrow.table(columns), tmp_path / "e.pq")
    with refuses(ValueError, "2", "rater"):
        read_ratings(tmp_path / "e.pq")
    assert read_ratings(tmp_path / "e.pq", missing=True).rater_names == ["1"]
    for wrong, words in (
        ([0.5], ("1", "ratee", "0.5")),
        ([2.0**60], ("1", "ratee", "1.152921504606847e+18")),
    ):
        parquet.write_table(
            arrow.table({"rater": ["a"], "ratee": wrong, "rating": [1]}), tmp_path / "d.pq"
        )
        with refuses(ValueError, *words):
            read_ratings(tmp_path / "d.pq")


def test_names_are_trimmed_and_the_joined_are_told(tmp_path: Path) -> None:
    path = write(tmp_path, "rater,ratee,rating\nann,x,1\nann ,x,1\n\u00a0ann, x,1\nAnn,x,1\n")
    log, lines = read_with_notes(path, Columns(), same_agents=True)
    assert log.rater_names == ["ann", "Ann", "x"]
    assert log.raters.tolist() == [0, 0, 0, 1]
    assert "form of Unicode: 3." in lines


def test_letters_of_windows_are_not_those_of_latin_1(tmp_path: Path) -> None:
    for name, encoding, word in (
        ("ann\u2019s Café", "cp1252", "cp1252"),
        ("José", "latin-1", "latin-1"),
    ):
        log, lines = read_with_notes(
            write(tmp_path, f"rater,ratee,rating\n{name},x,1\n".encode(encoding)), Columns()
        )
        assert (log.rater_names, word in lines) == ([name], True)
    assert read_ratings(write(tmp_path, b"rater,ratee,rating\na\x81\x92,x,1\n")).rater_names == [
        "a\x81\x92"
    ]


def test_names_of_whole_floats_are_whole_numbers_if_all_of_the_column_are(tmp_path: Path) -> None:
    log, lines = read_with_notes(
        write(tmp_path, "rater,ratee,rating\n3,x1,1\n3.0,x,1\n-1.0,x.0,0\n"), Columns()
    )
    assert (log.rater_names, log.raters.tolist(), log.ratee_names) == (
        ["3", "-1"],
        [0, 0, 1],
        ["x1", "x", "x.0"],
    )
    assert "without their .0: 2." in lines
    for other in ("3.5", "03.0", "a"):
        log, lines = read_with_notes(
            write(tmp_path, f"rater,ratee,rating\n3,x,1\n3.0,x,1\n{other},x,0\n"), Columns()
        )
        assert (log.rater_names, ".0" in lines) == (["3", "3.0", other], False)


def test_what_the_beginning_of_a_text_shows() -> None:
    assert (
        find_separator(["ann;bob;1,5", "cec;dan;2,5"]) == ";"
    )  # three columns, where the comma makes two
    assert find_encoding("ann,bob,1".encode("utf-16-le")) == "utf-16-le"
    with refuses(ValueError, "text"):
        find_encoding(b"\0\0\0\xff" * 20)  # zeros on both sides
    assert look("1,2,3\n4,5,6\n", Dialect()).header is None


def test_a_whole_column_decides_the_form_of_dates(tmp_path: Path) -> None:
    def dated(*times: str, **options: Any) -> tuple[list[float], str]:
        log, lines = read_with_notes(
            write(tmp_path, text(";", rows=with_times([*times, *times[-1:] * (3 - len(times))]))),
            **options,
        )
        return [] if log.times is None else log.times.tolist(), lines

    def seconds(date: str) -> float:
        return float(np.datetime64(date, "s").astype(np.int64))

    scale: Any = {"scale": (1, 5)}
    assert (
        "times are dates without a time zone, the month first"
        in dated("01/02/2024", "01/03/2024", "01/31/2024", **scale)[1]
    )
    for time_format, first in (("%d/%m/%Y", "2024-04-03"), ("%m/%d/%Y", "2024-03-04")):
        with refuses(ValueError, "03/04/2024", time_format):
            dated("03/04/2024", "05/05/2024", **scale)
        assert dated("03/04/2024", "05/05/2024", dialect=Dialect(time_format=time_format), **scale)[
            0
        ][0] == seconds(first)
    assert dated("03.04.2024", **scale)[0][0] == seconds("2024-04-03")
    assert dated("03/03/2024", "05/05/2024", **scale)[0] == [
        seconds(f"2024-{day}") for day in ("03-03", "05-05", "05-05")
    ]
    for times, words in (
        (
            ("31.01.2024", "31.02.2024"),
            ("3", "31.02.2024"),
        ),
        (("31/01/2024", "01/31/2024"), ("3", "01/31/2024")),
        (("31.01.2024 24:00",), ("2", "31.01.2024 24:00")),
        (("31.01.2024 0:30 AM",), ("2", "31.01.2024 0:30 AM")),
        (("31.01.2024 12:00:60",), ("2", "31.01.2024 12:00:60")),
        (
            ("31 Jan 2024 12:00 +0100", "31 Jan 2024 12:00"),
            ("3", "31 Jan 2024 12:00"),
        ),
        (("31 Jam 2024",), ("2", "31 Jam 2024")),
        (
            ("31.01.24",),
            ("2", "31.01.24", "--time-format"),
        ),
    ):
        with refuses(ValueError, *words):
            dated(*times, **scale)
    with refuses(ValueError, "2", "--time-format"):
        dated("31.01.2024", dialect=Dialect(time_format="%d"), **scale)


def test_nanoseconds_are_exact(tmp_path: Path) -> None:
    """Times 1 ns apart are no repeat and in their order, in texts, numbers and dates."""
    stamps = [1706702400_000000001 - n for n in range(3)]
    dates = [
        "2024-01-31T12:00:00.000000001",
        "2024-01-31T12:00:00",
        "2024-01-31T11:59:59.999999999",
    ]
    seconds = ["1706702400.000000001", "1706702400", "1706702399.999999999"]
    micro = ["1706702400000000.001", "1706702400000000", "1706702399999999.999"]
    milli = ["1706702400000.000001", "1706702400000", "1706702399999.999999"]
    columns = {"rater": ["a"] * 3, "ratee": ["x"] * 3, "rating": [1, 1, 1]}
    for times in (
        stamps,
        arrow.array(stamps).cast(arrow.timestamp("ns", "UTC")),
        dates,
        seconds,
        micro,
        milli,
    ):
        for rating in ([1, 1, 1], [1, 0.5, 0]):
            parquet.write_table(
                arrow.table({**columns, "rating": rating, "time": times}), tmp_path / "a.pq"
            )
            log = read_ratings(tmp_path / "a.pq", TIMED)
            assert log.values.tolist() == rating[::-1]
            assert log.times is not None
            assert log.times.tolist() == pytest.approx([1706702400] * 3, abs=1e-6)
        texts = [str(time) for time in times]
        lines = [f"a,x,1,{time}" for time in (dates if "-" in texts[0] else texts)]
        path = write(tmp_path, "\n".join(["rater,ratee,rating,time", *lines, lines[1]]))
        with refuses(ValueError, "row", "5", "3"):
            read_ratings(path, TIMED)
    for times in (stamps, seconds, micro, milli):  # as numbers of JSON
        rows = [f'{{"rater": "a", "ratee": "x", "rating": 1, "time": {time}}}' for time in times]
        for name, content in (("a.jsonl", "\n".join(rows)), ("a.json", f"[{','.join(rows)}]")):
            assert len(read_ratings(write(tmp_path, content, name), TIMED).values) == 3


def test_labels_missing_values_and_overrides(tmp_path: Path) -> None:
    path = write(tmp_path, "rater,ratee,rating,time\na,x,Yes,5\n,,,\nb,x,no,NA\nc,x,,7\nb,x,no,\n")
    with refuses(ValueError, "2", "Yes", "--labels"):
        read_ratings(write(tmp_path, "rater,ratee,rating\na,x,Yes\n", "yes.csv"))
    with refuses(ValueError, "5", "yes", "--missing"):
        read_ratings(path, labels={"yes": 1, "no": 0})
    log, lines = read_with_notes(path, TIMED, labels={"yes": 1, "no": 0}, missing=True)
    assert (log.rater_names, log.values.tolist()) == (["a"], [1])
    assert "blank rows: 1, rows with a missing value left out: 3." in lines
    path = write(tmp_path, "1|2,5|1\n3|2|0\n")
    assert read_ratings(
        path, Columns("1", "2", "3"), dialect=Dialect("bar", header=True)
    ).rater_names == ["3"]
    path = write(tmp_path, "a,x,yes\nb,x,no\n")
    assert len(read_ratings(path, labels={"yes": 1, "no": 0}).values) == 2
    for wrong, words in (
        (Dialect(encoding="none"), ("encoding", "none")),
        (Dialect(unit="h"), ("unit", "h")),
    ):
        with refuses(ValueError, *words):
            read_ratings(path, dialect=wrong, labels={"yes": 1, "no": 0})


def test_a_name_may_begin_with_a_mark(tmp_path: Path) -> None:
    for content in ("#a,x,1\nb,x,0\n", "#a,x,1\n#b,x,0\n", "rater,ratee,rating\n#a,x,1\nb,x,0\n"):
        log, lines = read_with_notes(write(tmp_path, content), Columns())
        assert (log.rater_names[0], len(log.values)) == ("#a", 2)
        assert "comment" not in lines
    log, lines = read_with_notes(
        write(tmp_path, "# 1,2,1\n1,2,0\n" + "# more\n" * 300 + "3,4,1\n"), Columns()
    )
    assert (log.rater_names, lines.count("lines of comment: 301")) == (["1", "3"], 1)
    assert read_ratings(write(tmp_path, "# by hand\n" * 300 + "1,2,0\n")).rater_names == ["1"]


def test_the_unit_of_times_is_that_of_their_size() -> None:
    for time, unit in (
        (1e8, "s"),
        (9e10, "s"),
        (1e11, "ms"),
        (9e13, "ms"),
        (1e14, "us"),
        (9e16, "us"),
        (1e17, "ns"),
    ):
        assert find_unit(np.array([time])) == unit
    assert find_unit(np.array([3.0, 1e9])) is None


def test_what_may_be_wrong_is_told_with_its_number(tmp_path: Path) -> None:
    for times, options, message in (
        ([0, 1, 10_001], {"every": 1}, "9,999 of 10,002 rounds are empty"),
        ([0, 1, 2], {"every": 10}, "all 3 ratings are in one round"),
        (
            [1706702400000, 1706702400001, 1706702400002],
            {"dialect": Dialect(unit="s")},
            "the year 56053 to 56053",
        ),
        (
            [1706702400, 1706702401, 1706702402],
            {"dialect": Dialect(unit="ms")},
            "the year 1970 to 1970",
        ),
        ([1706702400, 1706702401, 1706702400000], {}, "the year 1970 to 2024"),
        ([0, 1, 1e300], {}, "the year 1970 to 3.16887e+283; another unit"),
        (
            [20240131, 20240201, 20231231],
            {},
            "times such as 20231231 may be dates; --time-format %Y%m%d reads them",
        ),
        (
            [1, 2, 3],
            {},
            "Warning: all 3 ratings are the same.\nWarning: all 3 ratings are by one rater, a.",
        ),
    ):
        content = "rater,ratee,rating,time\n" + "".join(f"a,x,1,{time}\n" for time in times)
        assert message in read_with_notes(write(tmp_path, content), **options)[1]
    for times in (
        "20240131 20240132",
        "20240131 20241301",
        "20240131 20240100",
        "20240131 20240131.5",
    ):
        content = "".join(f"a,{time},{n},{time}\n" for n, time in enumerate(times.split()))
        assert (
            "may be dates"
            not in read_with_notes(write(tmp_path, content), Columns("1", "2", "3", "4"))[1]
        )
    assert "Warning" not in read_with_notes(write(tmp_path, text()), scale=(1, 5), every=3600)[1]


def test_a_text_of_several_lines_is_not_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(
        tmp_path, "rater,ratee,rating,words\n" + 'a,x,1,"one\ntwo, ""three""\n"\nb,y,0,"z"\n' * 9
    )
    for size in (7, 20, 50, 1000):
        monkeypatch.setattr("roletrust_env.data.tables._BYTES", size)
        assert len(read_ratings(path).values) == 18
    assert (
        len(
            read_ratings(
                write(tmp_path, "rater,ratee,rating,words\n" + 'a,x,1,6" pipe\n' * 9)
            ).values
        )
        == 9
    )


def test_the_shared_logs_need_no_option_but_the_scale() -> None:
    shared = Path(__file__).parents[2].parent / "shared" / "data"
    if not shared.is_dir():
        pytest.skip(f"there are no real logs in {shared}")
    path = shared / "bitcoin-otc" / "otc_network.csv.gz"
    with refuses(ValueError, "--scale", "-10", "10"):
        read_ratings(path)
    log = read_ratings(path, TIMED, scale=(-10, 10))
    assert (len(log.values), log.shape) == (35_592, (4814, 5858))
    log, lines = read_with_notes(shared / "crowd-product" / "answer.csv.gz", Columns())
    assert (len(log.values), log.shape) == (24_945, (176, 8315))
    assert (
        "rater in column 'worker', ratee in column 'question', rating in column 'answer'" in lines
    )


def test_feedback_events_are_ratings(tmp_path: Path) -> None:
    """With decimals; without what was taken back, other tags and other events; accounts under their
    funder."""
    given = {
        "eventName": "NewFeedback",
        "blockTimestamp": 1706702400,
        "valueDecimals": 2,
        "tag1": "starred",
    }
    events: list[dict[str, Any]] = [
        {**given, "agentId": "7", "clientAddress": "0xAb", "feedbackIndex": 1, "value": "8500"},
        {**given, "agentId": "7", "clientAddress": "0xaB", "feedbackIndex": 2, "value": "9000"},
        {
            **given,
            "agentId": "7",
            "clientAddress": "0xcd",
            "feedbackIndex": 1,
            "value": "5",
            "valueDecimals": 0,
        },
        {
            **given,
            "agentId": "8",
            "clientAddress": "0xef",
            "feedbackIndex": 1,
            "value": "1",
            "tag1": "reachable",
        },
        {
            "eventName": "FeedbackRevoked",
            "agentId": "7",
            "clientAddress": "0xab",
            "feedbackIndex": 1,
        },
    ]
    funded = [
        {**event, "funder": "0xF0" if event["clientAddress"] == "0xcd" else None}
        for event in events
    ]
    nested = [{"eventName": event.pop("eventName"), "args": event} for event in map(dict, funded)]
    for number, rows in enumerate((events, funded, nested)):
        path = write(tmp_path, "\n".join(map(json.dumps, rows)), "events.jsonl")
        log, lines = read_with_notes(
            path, Columns(time="blockTimestamp"), scale=(0, 100), repeats=True
        )
        assert log.rater_names == ["0xab", "0xf0" if number else "0xcd", "0xef"]
        assert log.ratee_names == ["7", "8"]
        assert log.values.tolist() == [0.9, 0.05, 0.0001]
        assert "feedback events of ERC-8004, revoked feedback left out: 1, 2 tags mixed" in lines
        assert read_ratings(path, scale=(0, 100), tag="starred").ratee_names == ["7"]
        assert len(read_ratings(path, scale=(0, 100), missing=True).values) == 3
    header = ["agentId", "clientAddress", "value", "valueDecimals", "isRevoked", "chainId"]
    lines = ["7,0xab,85,0,false,1", "7,0xab,1,0,true,1", "7,0xcd,850,1,,8453"]
    log = read_ratings(write(tmp_path, "\n".join([",".join(header), *lines])), scale=(0, 100))
    assert (log.ratee_names, log.values.tolist()) == (["1:7", "8453:7"], [0.85, 0.85])
    with refuses(ValueError, "4", "850", "scale"):
        read_ratings(
            write(tmp_path, "\n".join([",".join(header), *lines]).replace("850,1", "850,0")),
            scale=(0, 100),
        )
