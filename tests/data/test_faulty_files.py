"""Faulty and hostile files: the error names the row, the column and what is allowed."""

from pathlib import Path

import pytest
from dialect_files import TIMED, write
from refusals import refuses

from roletrust_env.data.dialect import Dialect
from roletrust_env.data.log import read_ratings

arrow = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")


def test_faults_name_the_row_the_column_and_what_is_allowed(tmp_path: Path) -> None:
    start = "rater,ratee,rating,time\n\n# a note\n"
    for content, words in (
        (start + "a,x,1,2\n\nb,x,good,3\n", ("6", "good")),
        (
            start.encode() + b"a,x,1,2\n" * 200_000 + b"Jos\xe9,x,1,3\n",
            ("200004", "UTF-8", "latin-1"),
        ),
        (start.encode() + "é,x,1,2\n".encode() + b"\xe9,x,1,3\n", ("5", "UTF-8")),
        (
            start + 'a,x,"1,234.5",2\n',
            ("row", "4", "1,234.5"),
        ),
        (start + "a,x,1,2\nb,x,1_0,3\n", ("5", "1_0")),
        (
            start + "a,x,1,2\nb,x,5,3\n",
            ("row", "5", "--scale 1 5"),
        ),
        (start + '"a\nb",x,1,2\n"c,x,1,2\n', ("row", "5")),
        (
            "user,source,item,rating,time\na,b,x,1,2\n",
            ("1", "user", "source"),
        ),
        (
            "rater,ratee,mark\na,x,1\n",
            ("1", "time", "--time"),
        ),
        ("a,x,1\n", ("time", "3", "--time")),
    ):
        with refuses(ValueError, *words):
            read_ratings(write(tmp_path, content), TIMED, repeats=True)
    for content, words in (
        (
            '{"rater": 1, "ratee": 2, "rating": 1}\n{"rater": \n',
            ("2", "JSON"),
        ),
        (
            '{"rater": 1, "ratee": "a", "rating": 1}\n{"rater": "b", "ratee\n',
            ("2", "JSON"),
        ),
        ('[{"rater": 1}]', ("ratee",)),
        ('[{"rater": 1}, 5]', ("2", "JSON")),
        ('[{"rater": 1}', ("log.jsonl", "JSON")),
        ('{"rater": 1, "rating": 1}\n', ("ratee",)),
        ('[{"rater": 1, "rater": 2, "ratee": 1, "rating": 1}]', ("rater",)),
    ):
        with refuses(ValueError, *words):
            read_ratings(write(tmp_path, content, "log.jsonl"))


def test_hostile_files_are_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also those at which pyarrow's parser would end the process; brackets in texts do not
    count."""
    row = '{"rater": "a[{\\\\", "ratee": "\\"[", "rating": 1}\n'
    assert len(read_ratings(write(tmp_path, row * 300, "LOG.JSONL"), repeats=True).values) == 300
    monkeypatch.setattr("roletrust_env.data.tables._LONGEST", 30_000)
    monkeypatch.setattr("roletrust_env.data.tables._BYTES", 30_000)
    for name, content, words in (
        ("log.jsonl", row + '{"rater": ' + "[" * 10_000, ("100", "0")),
        (
            "log.jsonl",
            row + '{"rater": ' + '{"a": ' * 400 + "1" + "}" * 401,
            ("100",),
        ),
        (
            "log.json",
            f'[{{"rater": {"[" * 200 + "]" * 200}, "ratee": 1, "rating": 1}}]',
            ("100",),
        ),
        (
            "log.jsonl",
            row.encode() + b'{"rater": "Jos\xe9"}\n',
            ("2", "UTF-8", "JSON"),
        ),
        (
            "log.csv",
            f"rater,ratee,rating\na,{'b' * 20_000},1\n",
            ("2", "ratee", "20,000"),
        ),
        ("log.jsonl", f"null\n{row}", ("row", "1")),
        ("log.json", "[null, 5]", ("row", "1")),
        (
            "log.csv",
            "rater,ratee,rating\na,b,1\n" + "b" * 40_000,
            ("30,000",),
        ),
    ):
        with refuses(ValueError, name, *words):
            read_ratings(write(tmp_path, content, name))
    event = (
        '"args": {"agentId": 1, "clientAddress": "0xab", "feedbackIndex": 1, "value": 1, '
        '"valueDecimals": 0}}\n'
    )
    gone = f'{{"event": "NewFeedback", {event}{{"event": "FeedbackRevoked", {event}'
    with refuses(ValueError, "log.jsonl"):
        read_ratings(write(tmp_path, gone, "log.jsonl"))
    latin = arrow.array([b"Jos\xe9"]).view(arrow.string())
    parquet.write_table(
        arrow.table({"rater": latin, "ratee": ["b"], "rating": [1]}), tmp_path / "log.parquet"
    )
    with refuses(ValueError, "log.parquet", "UTF8"):
        read_ratings(tmp_path / "log.parquet")
    with refuses(ValueError, "log.csv"):
        read_ratings(
            write(tmp_path, "rater,ratee,rating\na+2AA-,b,1\n"), dialect=Dialect(encoding="utf-7")
        )
    with refuses(ValueError, "-1e+308", "1e+308"):
        read_ratings(write(tmp_path, "a,b,1\n"), scale=(-1e308, 1e308))
