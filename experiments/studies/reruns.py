"""Whether runs of a benchmark with other seeds agree as they should.

The suite `reruns` has many seeds, which are cut into runs of a few seeds each. Each run searches, chooses and measures
as if it were alone, so the runs are reruns of one another. Each has a leaderboard of its own, with intervals and the
probability that a rank holds in another run; the other runs show how often such a promise is kept. A quarter of an hour
on two cores; a repeat continues.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise, permutations
from typing import NamedTuple

import numpy as np

from roletrust_env.benchmarking import Leaderboard, benchmark
from roletrust_env.benchmarking.leaderboard import LeaderboardRow
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.storage.markdown import markdown_table
from studies.condition import suite_of
from studies.study import Recipe, Study

_EDGES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)


class Options(NamedTuple):
    """Suite with many seeds, and the number of seeds of each run."""

    suite: str = "reruns"
    seeds: int = 2


RECIPES = {"reruns": Recipe(Options(), {"reruns.md": "leaderboards/reruns.md"})}


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


def main(arguments: Sequence[str] | None = None) -> None:
    """Play the suite, and write how often promises are kept."""
    with Study(__name__, RECIPES, arguments) as study:
        asked, seeds = study.options
        found = benchmark(suite=suite_of(asked), out=study.out, workers=study.workers)
        suite, boards = found.suite, reruns(found.suite, found.cells, seeds)
        if failed := [f"{one.cell.key}: {one.result.failed}" for one in found.cells if one.result.failed]:
            raise ValueError(failed[0])
        study.page(
            "reruns.md",
            markdown_table(
                ["promise", "promised", "kept", "cases"],
                [[one.what, f"{one.promised:.2f}", f"{one.kept:.2f}", f"{one.cases:,}"] for one in promises(boards)],
                names=1,
            ),
            f"Reruns of suite {suite.name}: {len(boards)} runs of {seeds} seeds, {len(boards[0])} models; every pair "
            f"of runs. Made by `{study.command}`.",
        )


def reruns(suite: Suite, stored: Sequence[StoredCell], seeds: int) -> list[list[LeaderboardRow]]:
    """Return the leaderboard of each run.

    Args:
        suite: Suite of all seeds.
        stored: Cells of all seeds with their results.
        seeds: Number of seeds of a run. Seeds that are left over are not used.
    """
    runs = [suite.seeds[at : at + seeds] for at in range(0, len(suite.seeds) - seeds + 1, seeds)]
    return [
        Leaderboard.of(suite.model_copy(update={"seeds": run}), [one for one in stored if one.cell.seed in run]).rows
        for run in runs
    ]


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


if __name__ == "__main__":
    main()
