"""Reruns of a benchmark: what a run promises of another one with other seeds, against what other runs show.

A suite with many seeds is cut into runs of a few seeds each. Each run searches, chooses and measures as if it were
alone, so the runs are reruns of one another.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise, permutations
from typing import NamedTuple

import numpy as np

from roletrust_env.benchmarking.leaderboard import LeaderboardRow, leaderboard_rows
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import Suite

_EDGES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)


class Promise(NamedTuple):
    """Promise of runs, and how often other runs keep it.

    Attributes:
        what: What is promised.
        promised: Mean of the promised probability.
        kept: Share of the cases in which the other run keeps it.
        cases: Number of cases: a model in a run, with another run.
    """

    what: str
    promised: float
    kept: float
    cases: int


def reruns(suite: Suite, stored: Sequence[StoredCell], seeds: int) -> list[list[LeaderboardRow]]:
    """Return the leaderboard of each run.

    Args:
        suite: Suite of all seeds.
        stored: Cells of all seeds with their results.
        seeds: Number of seeds of a run. Seeds that are left over are not used.

    Raises:
        ValueError: There are fewer than two runs, or a cell is missing or failed.
    """
    runs = [suite.seeds[at : at + seeds] for at in range(0, len(suite.seeds) - seeds + 1, seeds)]
    if len(runs) < 2:
        raise ValueError(f"the suite has {len(suite.seeds)} seeds, too few for two runs of {seeds}")
    models, boards = suite.model_names, []
    for run in runs:
        part = [one for one in stored if one.cell.seed in run]
        cells_each = sum(cell.seed in run for cell in suite.cells()) // len(models)
        board = leaderboard_rows(suite, part, models, cells_each)
        if missing := [row.model for row in board if row.missing or np.isnan(row.worst.mean)]:
            raise ValueError(f"cells of {missing[0]} with the seeds {', '.join(map(str, run))} are missing or failed")
        boards.append(board)
    return boards


def promises(boards: Sequence[Sequence[LeaderboardRow]]) -> list[Promise]:
    """Return what runs promise of one another: intervals of 95%, and the probability of ranks in five parts.

    Args:
        boards: Leaderboards of the runs, with the same models.
    """
    cases = list(_cases(boards))
    worst = [(one.worst, other.worst) for one, other in cases]
    near = [abs(one.mean - other.mean) <= np.hypot(one.half, other.half) for one, other in worst]
    found = [Promise("means are within the interval of their difference", 0.95, float(np.mean(near)), len(near))]
    holds = np.array([one.holds for one, _ in cases])
    same = np.array([one.rank == other.rank for one, other in cases])
    for low, high in pairwise(_EDGES):
        part = (holds >= low) & ((holds < high) | (high == _EDGES[-1]))
        if part.any():
            what = f"ranks are the same, holds from {low:.1f} to {high:.1f}"
            found.append(Promise(what, float(holds[part].mean()), float(same[part].mean()), int(part.sum())))
    found.append(Promise("ranks are the same, all", float(holds.mean()), float(same.mean()), len(cases)))
    return found


def _cases(boards: Sequence[Sequence[LeaderboardRow]]) -> Iterator[tuple[LeaderboardRow, LeaderboardRow]]:
    """Yield each row of a run with the row of the same model in each other run."""
    for one, other in permutations(boards, 2):
        rows = {row.model: row for row in other}
        for row in one:
            yield row, rows[row.model]
