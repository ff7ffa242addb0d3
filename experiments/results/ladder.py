"""The rows of a ladder: what the rungs found, and how near it comes to the top."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from agents.ladder.rungs import Finding
from experiments.results.confidence import over_games

HEADER = ("rung", "score", "half_95", "share", "objective", "cost", "rounds", "seconds", "attack")


class Row(NamedTuple):
    """A rung of the ladder: what it found, its mean score with half the 95% interval, and its share of the top."""

    finding: Finding
    score: float
    half: float
    share: float


def ranked(found: Sequence[Finding]) -> list[Row]:
    """The findings with their share: 0 is honest play, the first; 1 the exact optimum, or the best without one."""
    means = {finding.name: float(finding.scores.mean()) for finding in found}
    foot, top = means[found[0].name], means.get("exact", max(means.values()))
    rows = []
    for finding in found:
        score, half, _ = over_games(finding.scores)
        share = (float(score) - foot) / (top - foot) if top > foot else float("nan")
        # Games that luck has no part in differ by the rounding of their sums only.
        rows.append(Row(finding, float(score), float(half) if half > 1e-12 else 0.0, share))
    return rows


def compared(rows: Sequence[Row]) -> tuple[Row, Row]:
    """The best scripted attack, and the best of all."""
    scripted = [row for row in rows if row.finding.name.startswith("scripted")]
    return max(scripted, key=lambda row: row.score), max(rows, key=lambda row: row.score)


def cells(row: Row) -> tuple[Any, ...]:
    """A row as `HEADER` has it."""
    found = row.finding
    parts = (row.score, row.half, row.share, float(found.objective.mean()), float(found.cost.mean()))
    return (found.name, *parts, found.rounds, found.seconds, found.words)


def plain(cells: Sequence[Any]) -> list[Any]:
    """NaN is no JSON."""
    return [None if isinstance(cell, float) and np.isnan(cell) else cell for cell in cells]
