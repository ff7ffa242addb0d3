"""The rows of a ladder: the results of each rung in all runs, their shares, and comparisons of rungs."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.evaluation.search import MeasuredSearch
from roletrust_env.metrics.confidence import over_games

HEADER = ("rung", "run", "score", "half_95", "objective", "cost", "rounds", "seconds", "attack")
"""Header of a table with a line for every run of every rung."""


class Row(NamedTuple):
    """A rung of the ladder.

    Attributes:
        name: Name of the rung.
        runs: Result of each run; all rungs have the same seed in the same run.
        score: Mean score over the runs.
        half: Half the 95% confidence interval, over the runs or over the games of a single run.
        share: Position between honest play, 0, and the top, 1.
    """

    name: str
    runs: tuple[MeasuredSearch, ...]
    score: float
    half: float
    share: float

    @property
    def scores(self) -> list[float]:
        """Mean score of each run."""
        return [float(run.scores.mean()) for run in self.runs]

    @property
    def best(self) -> int:
        """Index of the run with the best score."""
        return int(np.argmax(self.scores))


def ranked(found: Sequence[Sequence[MeasuredSearch]]) -> list[Row]:
    """Return the rungs with their runs and shares: 0 is honest play, the first rung, and 1 is the top, see `top`."""
    rows = []
    for runs in found:
        means = np.array([run.scores.mean() for run in runs])
        score, half, _ = over_games(means if len(runs) > 1 else runs[0].scores)
        # Games without randomness differ only by rounding.
        rows.append(Row(runs[0].name, tuple(runs), float(score), float(half) if half > 1e-12 else 0.0, np.nan))
    foot, highest = rows[0].score, top(rows)[0]
    if highest <= foot:
        return rows
    return [row._replace(share=(row.score - foot) / (highest - foot)) for row in rows]


def top(rows: Sequence[Row]) -> tuple[float, str]:
    """Return the score with share 1, and its meaning: the exact optimum, a bound, or the best score found."""
    for row in rows:
        bound = row.runs[0].bound
        if bound is not None:
            return bound, "the exact optimum" if row.name == "exact" else "a bound that is proven"
    return max(row.score for row in rows), "the best that was found"


def compared(rows: Sequence[Row]) -> tuple[Row, Row]:
    """Return the best scripted attack, and the best attack of all."""
    scripted = [row for row in rows if row.name.startswith("scripted")]
    return max(scripted, key=lambda row: row.score), max(rows, key=lambda row: row.score)


def wins(rows: Sequence[Row]) -> list[list[int]]:
    """Return the number of runs in which each rung scored more than each other rung."""
    scores = np.array([row.scores for row in rows])
    counts: list[list[int]] = (scores[:, None] > scores[None]).sum(axis=2).tolist()
    return counts


def lines(rows: Sequence[Row], seed: int) -> list[tuple[Any, ...]]:
    """Return the runs as lines under `HEADER`. The first run has the given seed."""
    table = []
    for row in rows:
        for run, found in enumerate(row.runs, start=seed):
            score, half, _ = over_games(found.scores)
            parts = (float(score), float(half), float(found.objective.mean()), float(found.cost.mean()))
            table.append((row.name, run, *parts, found.rounds, found.seconds, found.description))
    return table


def summary(rows: Sequence[Row], seed: int) -> list[dict[str, Any]]:
    """Return the rungs as plain data, with their runs and comparisons. The first run has the given seed."""
    rungs: list[dict[str, Any]] = []
    for row, beaten in zip(rows, wins(rows), strict=True):
        share = None if np.isnan(row.share) else row.share  # NaN is no JSON
        runs = [dict(zip(HEADER[1:], line[1:], strict=True)) for line in lines([row], seed)]
        above = {other.name: count for other, count in zip(rows, beaten, strict=True) if other is not row}
        rung = {"rung": row.name, "score": row.score, "half_95": row.half, "share": share}
        rungs.append({**rung, "runs_above": above, "runs": runs})
    return rungs
