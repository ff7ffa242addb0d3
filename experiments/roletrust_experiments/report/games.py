"""The utility of every game of a run in one compressed file, from which anybody can compute the
leaderboard.
"""

import csv
import gzip
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import Cell
from roletrust_env.storage.files import replacing

_CHOSEN = ("utility", "blind")
_MEASURED = ("utility", "blind", "published")


def write_games(path: Path, cells: Iterable[StoredCell]) -> None:
    """Write a row for each attack, with the utilities of its games to four digits in one field
    each.

    `chosen_utility` and `chosen_blind` are those of the games for choosing the worst case, and
    `utility`, `blind` and `published` those of the games for measuring, see
    `roletrust_env.evaluation.measurement.MEASURED`. Utilities of a field are in the order of the
    games, with a space between them, and `nan` where they are undefined.

    Args:
        path: Path of the file, which ends in `.csv.gz`.
        cells: Cells with their results.
    """
    names = [*(f"chosen_{name}" for name in _CHOSEN), *_MEASURED]
    with (
        replacing(path) as temporary,
        temporary.open("wb") as raw,
        # Without the time and the name of the file, equal results give equal bytes.
        gzip.GzipFile(filename="", fileobj=raw, mode="wb", mtime=0) as file,
        io.TextIOWrapper(file, encoding="utf-8", newline="") as text,
    ):
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow((*Cell._fields, "attack", "words", "rounds", *names))
        for cell, result in cells:
            for row in result.rows:
                chosen = (_field(row.chosen[name]) for name in _CHOSEN)
                measured = (_field(row.measured.get(name, ())) for name in _MEASURED)
                writer.writerow((*cell, row.attack, row.words, row.rounds, *chosen, *measured))


def _field(values: Sequence[float | None]) -> str:
    return " ".join("nan" if value is None else f"{value:.4f}" for value in values)
