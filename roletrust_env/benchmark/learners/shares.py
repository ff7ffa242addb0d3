"""How near learners come to the best attack, and how soon: shares of the optimum, over tasks and seeds."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from roletrust_env.metrics.confidence import Floats, Interval, interquartile_mean

EVERY = "all tasks"
"""What stands for the task where runs of all of them count together."""

HEADER = ("task", "learner", "budget", "runs", "score", "share", "share_low_95", "share_high_95")
"""Of a table of results."""


class Run(NamedTuple):
    """One learner on one task with one budget and one seed.

    Attributes:
        task: its name.
        learner: its name.
        budget: game rounds that it could play.
        seed: of all luck.
        score: mean reward per round in the held-out games.
    """

    task: str
    learner: str
    budget: int
    seed: int
    score: float


class Scale(NamedTuple):
    """What share 0 and share 1 are on a task.

    Attributes:
        foot: the score of honest play, by seed: in the games in which the run of that seed is measured.
        top: the score whose share is 1.
        words: what that is.
    """

    foot: dict[int, float]
    top: float
    words: str

    def share(self, run: Run) -> float:
        """Of the way from honest play to the top; NaN where there is no way."""
        way = self.top - float(np.mean(list(self.foot.values())))
        return (run.score - self.foot[run.seed]) / way if way > 0 else np.nan


class Result(NamedTuple):
    """What a learner reaches with a budget.

    Attributes:
        task: or `EVERY`.
        learner: its name.
        budget: game rounds.
        runs: how many there are.
        score: their mean; NaN over tasks, whose rewards do not compare.
        share: their interquartile mean, with its 95% interval.
    """

    task: str
    learner: str
    budget: int
    runs: int
    score: float
    share: Interval


def scale(foot: Sequence[Run], bounds: dict[str, float], runs: Sequence[Run]) -> Scale:
    """The scale of a task.

    Args:
        foot: honest play with each seed.
        bounds: that are known, by what they are; no attack scores more.
        runs: of the learners, of which the best is the top if no bound is known: that with the highest mean score over
            the seeds with any budget.
    """
    floor = {run.seed: run.score for run in foot}
    for words, bound in bounds.items():
        return Scale(floor, bound, words)
    means = {key: float(np.mean(scores)) for key, scores in _grouped(runs).items()}
    if not means:
        return Scale(floor, np.nan, "not known")
    (learner, budget), top = max(means.items(), key=lambda item: item[1])
    return Scale(floor, top, f"the best that was found, by {learner} with {budget:,} rounds")


def results(scales: dict[str, Scale], runs: Sequence[Run]) -> list[Result]:
    """What each learner reaches with each budget, on each task and, where it has runs on each, on all together."""
    found = []
    for (learner, budget), _ in _grouped(runs).items():
        mine = {task: [run for run in runs if run[:3] == (task, learner, budget)] for task in scales}
        shares = {task: np.array([scales[task].share(run) for run in some]) for task, some in mine.items()}
        if all(mine.values()):
            found.append(_result(EVERY, learner, budget, [], list(shares.values())))
        found += [_result(task, learner, budget, some, [shares[task]]) for task, some in mine.items() if some]
    return found


def ranked(found: Sequence[Result]) -> list[str]:
    """The learners, the best first: over all tasks, with the largest budget."""
    largest = max((result.budget for result in found), default=0)
    best = {one.learner: one.share.value for one in found if one.task == EVERY and one.budget == largest}
    names = dict.fromkeys(result.learner for result in found)
    return sorted(names, key=lambda name: -np.nan_to_num(best.get(name, np.nan), nan=-np.inf))


def lines(found: Sequence[Result]) -> list[tuple[object, ...]]:
    """A table, see `HEADER`."""
    return [(*result[:5], *result.share) for result in found]


def _grouped(runs: Sequence[Run]) -> dict[tuple[str, int], list[float]]:
    """The scores of each learner with each budget."""
    found: dict[tuple[str, int], list[float]] = {}
    for run in runs:
        found.setdefault((run.learner, run.budget), []).append(run.score)
    return found


def _result(task: str, learner: str, budget: int, runs: Sequence[Run], shares: Sequence[Floats]) -> Result:
    score = float(np.mean([run.score for run in runs])) if runs else np.nan
    return Result(task, learner, budget, sum(map(len, shares)), score, interquartile_mean(shares))
