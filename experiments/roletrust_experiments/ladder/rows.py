"""The rows of a ladder: what the rungs found in all runs, how near it comes to the top, and who beat whom."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.evaluation.search import MeasuredSearch
from roletrust_env.metrics.confidence import over_games

HEADER = ("rung", "run", "score", "half_95", "objective", "cost", "rounds", "seconds", "attack")
"""Of a table with a line for every run of every rung."""


class Row(NamedTuple):
    """A rung of the ladder.

    Attributes:
        name: of the rung.
        runs: what it found in each run; every rung searches and is measured with the same seed in the same run.
        score: mean over the runs.
        half: half its 95% confidence interval: over the runs, or over the games of a single one.
        share: of the way from honest play to the top.
    """

    name: str
    runs: tuple[MeasuredSearch, ...]
    score: float
    half: float
    share: float

    @property
    def scores(self) -> list[float]:
        """The mean score of each run."""
        return [float(run.scores.mean()) for run in self.runs]

    @property
    def best(self) -> int:
        """The run that scored best."""
        return int(np.argmax(self.scores))


def ranked(found: Sequence[Sequence[MeasuredSearch]]) -> list[Row]:
    """The rungs, each with its runs, and their share: 0 is honest play, the first, and 1 the top, see `top`."""
    rows = []
    for runs in found:
        means = np.array([run.scores.mean() for run in runs])
        score, half, _ = over_games(means if len(runs) > 1 else runs[0].scores)
        # Games that luck has no part in differ by the rounding of their sums only.
        rows.append(Row(runs[0].name, tuple(runs), float(score), float(half) if half > 1e-12 else 0.0, np.nan))
    foot, highest = rows[0].score, top(rows)[0]
    if highest <= foot:
        return rows
    return [row._replace(share=(row.score - foot) / (highest - foot)) for row in rows]


def top(rows: Sequence[Row]) -> tuple[float, str]:
    """The score whose share is 1, and what it is: the exact optimum, a bound, or the best that was found."""
    for row in rows:
        bound = row.runs[0].bound
        if bound is not None:
            return bound, "the exact optimum" if row.name == "exact" else "a bound that is proven"
    return max(row.score for row in rows), "the best that was found"


def compared(rows: Sequence[Row]) -> tuple[Row, Row]:
    """The best scripted attack, and the best of all."""
    scripted = [row for row in rows if row.name.startswith("scripted")]
    return max(scripted, key=lambda row: row.score), max(rows, key=lambda row: row.score)


def wins(rows: Sequence[Row]) -> list[list[int]]:
    """In how many runs each rung scored more than each other one."""
    scores = np.array([row.scores for row in rows])
    counts: list[list[int]] = (scores[:, None] > scores[None]).sum(axis=2).tolist()
    return counts


def lines(rows: Sequence[Row], seed: int) -> list[tuple[Any, ...]]:
    """The runs as `HEADER` has them, the first of which has this seed."""
    table = []
    for row in rows:
        for run, found in enumerate(row.runs, start=seed):
            score, half, _ = over_games(found.scores)
            parts = (float(score), float(half), float(found.objective.mean()), float(found.cost.mean()))
            table.append((row.name, run, *parts, found.rounds, found.seconds, found.description))
    return table


def summary(rows: Sequence[Row], seed: int) -> list[dict[str, Any]]:
    """The rungs as plain data, with their runs, the first of which has this seed, and with whom they beat how often."""
    rungs: list[dict[str, Any]] = []
    for row, beaten in zip(rows, wins(rows), strict=True):
        share = None if np.isnan(row.share) else row.share  # NaN is no JSON
        runs = [dict(zip(HEADER[1:], line[1:], strict=True)) for line in lines([row], seed)]
        above = {other.name: count for other, count in zip(rows, beaten, strict=True) if other is not row}
        rung = {"rung": row.name, "score": row.score, "half_95": row.half, "share": share}
        rungs.append({**rung, "runs_above": above, "runs": runs})
    return rungs
