"""Files that hold the same log in many dialects, and how tests write and read them."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from roletrust_env.data.columns import Columns
from roletrust_env.data.log import RatingLog, read_ratings

ROWS = [
    ("ann", "Café", 5, 1706702400),
    ("bob", "Café", 1, 1706702460),
    ("ann", "寿司", 3, 1706788800),
]
DAYS = ["2024-01-31T12:00:00", "2024-01-31T12:01:00", "2024-02-01T12:00:00"]
OTHER_DATES = {
    "day-first": ["31.01.2024 12:00", "31.01.2024 12:01", "1.2.2024 12:00"],
    "month-first": ["1/31/2024 12:00 PM", "1/31/2024 12:01pm", "2/1/2024 12:00 PM"],
    "slashes": ["31/01/2024, 12:00:00", "31/01/2024, 12:01:00", "01/02/2024, 12:00:00"],
    "names": ["Jan 31, 2024 12:00", "January 31, 2024 12:01:00.0", "Feb. 1, 2024 12:00"],
    "mail": [
        "Wed, 31 Jan 2024 13:00:00 +0100",
        "31 jan 2024 12:01:00 GMT",
        "Thu, 01 Feb 2024 06:30:00 -0530",
    ],
}
TIMED = Columns(time="time")


def text(
    separator: str = ",",
    header: str = "rater,ratee,rating,time",
    rows: list[Any] = ROWS,
    end: str = "\n",
) -> str:
    """Return the rows as a text; without a header if that is empty."""
    lines = [separator.join(map(str, row)) for row in rows]
    return "".join(
        line + end for line in [*([header.replace(",", separator)] if header else []), *lines]
    )


def with_times(times: list[Any]) -> list[tuple[Any, ...]]:
    return [(*row[:3], time) for row, time in zip(ROWS, times, strict=True)]


def texts() -> Iterator[tuple[str, bytes]]:
    """Yield names and contents of files that hold the same log."""
    for name, separator in (
        ("a.csv", ","),
        ("b.tsv", "\t"),
        ("c.csv", ";"),
        ("d.dat", "::"),
        ("e", "|"),
        ("f.txt", " "),
    ):
        yield name, text(separator).encode()
        yield f"no-header-{name}", text(separator, "").encode()
    yield "blanks.txt", text("  \t ").replace("ann", "  ann").encode()
    for encoding in ("utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32"):
        yield f"{encoding}.csv", text("\t").encode(encoding)
    yield "crlf.csv", text(end="\r\n").encode()
    yield "cr.csv", text(end="\r").encode()
    yield "no-end.csv", text().rstrip().encode()
    yield "blank-lines.csv", ("\n" + text().replace("\n", "\n\n  \n,,,\n,,,,,\n") + "\n\n").encode()
    yield (
        "comments.csv",
        ("# made by hand\n\n" + text() + "# the, end, of, it\n# it's \"all\n").encode(),
    )
    yield "comments-inside.csv", text().replace("bob", "# a pause\nbob").encode()
    yield "sep.csv", ("sep=;\n" + text(";")).encode()
    yield "konect", ("% sym weighted x\n" + text(" ", "")).encode()
    yield (
        "utc.csv",
        text(rows=with_times([day.replace("T", " ") + " UTC" for day in DAYS])).encode(),
    )
    yield (
        "header-in-comment.tsv",
        ("% sym weighted\n# Rater\tRatee\tRating\tTime\n" + text("\t", "")).encode(),
    )
    yield "blanks-after-commas.csv", text(", ").encode()
    yield "quotes.csv", text('", "').replace("\n", '"\n"').rstrip('"').encode().join([b'"', b""])
    yield "padded.csv", text().replace("ann", " ann\t").replace("Café", "Café\u00a0").encode()
    yield "names.csv", text(header="User ID,item_id,stars,timestamp").encode()
    yield "graph.csv", text(header="Source,Target,Weight,Date").encode()
    yield (
        "books.csv",
        text('";"', "User-ID,ISBN,Book-Rating,Review Time")
        .replace("\n", '"\n"')
        .join('""')[:-2]
        .encode("utf-16"),
    )
    yield (
        "more.csv",
        text(header='"from",to,score,time').replace("\n", ',"two\nlines, ""quoted"""\n').encode(),
    )
    yield (
        "extra.csv",
        text(
            header=",rater,ratee,rating,time", rows=[(n, *row) for n, row in enumerate(ROWS)]
        ).encode(),
    )
    yield (
        "decimal-commas.csv",
        text(";", rows=[(a, b, f"{c},0", d) for a, b, c, d in ROWS]).encode(),
    )
    for unit, more in (("ms", 3), ("us", 6), ("ns", 9)):
        yield (
            f"{unit}.csv",
            text(rows=with_times([f"{row[3]}{'0' * more}" for row in ROWS])).encode(),
        )
    yield "dates.csv", text(rows=with_times(DAYS)).encode()
    yield (
        "zone.csv",
        text(
            rows=with_times(
                [day.replace("T", " ").replace("12:", "14:") + "+02:00" for day in DAYS]
            )
        ).encode(),
    )
    names = "rater", "ratee", "rating", "time"
    lines = [json.dumps(dict(zip(names, row, strict=True))) for row in ROWS]
    yield "lines.jsonl", "\n".join(lines).encode()
    yield "mixed.jsonl", "\n".join([lines[0].replace("5,", '"5",'), *lines[1:]]).encode()
    yield "lines.ndjson", "\n\n".join(lines).encode()
    dated = [
        json.dumps(dict(zip(("user", "item", "score", "date"), row, strict=True)))
        for row in with_times(DAYS)
    ]
    yield "dated.jsonl", "\n".join(dated).encode()
    yield "array.json", b"\xef\xbb\xbf\n [" + ", \n".join(lines).encode() + b"]\n"
    yield "accents.csv", text().replace("Café,5", "Cafe\u0301,5").encode()
    for name, times in OTHER_DATES.items():
        yield f"{name}.tsv", text("\t", rows=with_times(times)).encode()


def write(folder: Path, content: str | bytes, name: str = "log.csv") -> Path:
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder / name


def read_with_notes(path: Path, columns: Columns = TIMED, **options: Any) -> tuple[RatingLog, str]:
    lines: list[str] = []
    log = read_ratings(path, columns, tell=lines.append, **options)
    return log, "\n".join(lines)
