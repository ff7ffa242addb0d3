"""Whether runs of a benchmark with other seeds, or with agents at other places, agree as they should.

The suite `reruns` has many seeds, which are cut into runs of a few seeds each. Each run searches, chooses and measures
as if it were alone, so the runs are reruns of one another. Each has a leaderboard of its own, with intervals and the
probability that a rank holds in another run; the other runs show how often such a promise is kept.

The suite `reruns-shuffled` has the same cells with all agents at random places. Both search and measure with the same
random numbers. A model that treats all agents alike has the same scores in both, but for rounding, which may decide
between providers with equal trust, and so lead a search elsewhere. Some 20 minutes on two cores; a repeat continues.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise, permutations
from pathlib import Path
from typing import NamedTuple

import numpy as np

from roletrust_env.benchmarking import benchmark
from roletrust_env.benchmarking.leaderboard import Floats, LeaderboardRow, leaderboard_rows, score_table
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.worst_case import WorstCase, attack_scores, worst_cases
from roletrust_env.metrics.confidence import Estimate, over_seeds
from roletrust_env.storage.markdown import markdown_table
from roletrust_experiments.commands.leaderboard import read_run
from studies.condition import suite_of
from studies.study import Recipe, Study, plus_minus

_EDGES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)


class Options(NamedTuple):
    """Suites to play.

    Attributes:
        suite: Suite with many seeds.
        shuffled: The same suite with `places = "shuffled"`, and some of the seeds.
        seeds: Number of seeds of each run.
    """

    suite: str = "reruns"
    shuffled: str = "reruns-shuffled"
    seeds: int = 2


RECIPES = {"reruns": Recipe(Options(), {name: f"leaderboards/{name}" for name in ("reruns.md", "places.md")})}


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


class PlaceEffect(NamedTuple):
    """Scores of a model that sees the agents in order, and how they differ where it sees them shuffled.

    Attributes:
        model: Name of the model.
        clean: Mean score over the tracks on which all agents are honest; NaN if there are none.
        clean_change: Mean difference of that score in the same games: shuffled minus in order.
        worst: Mean score of the worst case over the conditions.
        worst_change: Mean difference of that score in the same games.
    """

    model: str
    clean: Estimate
    clean_change: Estimate
    worst: Estimate
    worst_change: Estimate


def main(arguments: Sequence[str] | None = None) -> None:
    """Play both suites, and write how often promises are kept, and what places change."""
    with Study(__name__, RECIPES, arguments) as study:
        suite, stored = _played(study, study.options.suite)
        boards, seeds = reruns(suite, stored, study.options.seeds), study.options.seeds
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
        other, theirs = _played(study, study.options.shuffled)
        rows = [
            [one.model, *(plus_minus(value, digits) for value, digits in zip(one[1:], (3, 5, 3, 5), strict=True))]
            for one in place_effects(stored, other, theirs)
        ]
        study.page(
            "places.md",
            markdown_table(["model", "clean", "change", "worst", "change"], rows, names=1),
            f"Places of agents of suites {suite.name} and {other.name}, {len(other.seeds)} seeds: {suite.score} with "
            "agents in order, and its change in the same games if they are shuffled. Made by "
            f"`{study.command}`.",
        )


def _played(study: Study[Options], suite: str) -> tuple[Suite, list[StoredCell]]:
    """Play the cells of a suite that are not in its folder, and return all. A cell that fails is an error."""
    folder = study.out / Path(suite).stem
    benchmark(suite=suite_of(suite), out=folder, workers=study.workers)
    found, stored = read_run(folder / "results.sqlite")
    if failed := [f"{one.cell.key}: {one.result.failed}" for one in stored if one.result.failed]:
        raise ValueError(failed[0])
    return found, stored


def reruns(suite: Suite, stored: Sequence[StoredCell], seeds: int) -> list[list[LeaderboardRow]]:
    """Return the leaderboard of each run.

    Args:
        suite: Suite of all seeds.
        stored: Cells of all seeds with their results.
        seeds: Number of seeds of a run. Seeds that are left over are not used.
    """
    runs = [suite.seeds[at : at + seeds] for at in range(0, len(suite.seeds) - seeds + 1, seeds)]
    models, boards = suite.model_names, []
    for run in runs:
        part = [one for one in stored if one.cell.seed in run]
        cells_each = sum(cell.seed in run for cell in suite.cells()) // len(models)
        boards.append(leaderboard_rows(suite, part, models, cells_each))
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


def place_effects(
    stored: Sequence[StoredCell], shuffled: Suite, stored_shuffled: Sequence[StoredCell]
) -> list[PlaceEffect]:
    """Return how the scores of each model change if it sees the agents shuffled, with intervals over games and seeds.

    Args:
        stored: Cells of a run in which models see the agents in order. It may have more seeds than the other one.
        shuffled: Suite of the other run, with `places = "shuffled"`.
        stored_shuffled: Its cells.
    """
    one, other = (_scores(shuffled, own) for own in (stored, stored_shuffled))
    columns = [one[0], other[0] - one[0], one[1], other[1] - one[1]]
    models = shuffled.model_names
    estimates = [over_seeds(values, len(models)).estimates for values in columns]
    return [PlaceEffect(*row) for row in zip(models, *estimates, strict=True)]


def _scores(suite: Suite, stored: Sequence[StoredCell]) -> tuple[Floats, Floats]:
    """Return the clean score and that of the worst case of each model, seed and game, shape (M, S, G) each."""
    wanted = {cell.key for cell in suite.cells()}
    part = [one for one in stored if one.cell.key in wanted]
    honest: dict[bool, list[WorstCase]] = {True: [], False: []}
    for one in worst_cases(attack_scores(suite, part)).values():
        honest[not suite.tracks[one.condition.track].roles].append(one)
    models = suite.model_names
    clean, worst = (score_table(honest[which], models) for which in (True, False))
    return clean, worst


if __name__ == "__main__":
    main()
