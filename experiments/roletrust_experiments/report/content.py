"""Content of a report: a benchmark of trust models, of learners, or both."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self

from roletrust_env.benchmarking.learners.results import (
    ALL_TASKS,
    HEADER,
    LearnerResult,
    TaskScale,
    learner_results,
    ranking,
    table_rows,
)
from roletrust_env.benchmarking.learners.suite import LearnersSuite
from roletrust_env.benchmarking.store import ResultStore, StoredCell
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.suite_files import reproduction_command
from roletrust_env.metrics.confidence import Interval
from roletrust_experiments.report.board import Table, TrustModels


class Learners(NamedTuple):
    """The learners' part of a report.

    Attributes:
        suite: Suite that was played.
        software: Versions of the software.
        command: Command that plays the suite.
        scales: Scores of share 0 and 1 on each task.
        results: Results of each learner.
        warnings: Warnings for the reader.
    """

    suite: LearnersSuite
    software: dict[str, Any]
    command: str
    scales: dict[str, TaskScale]
    results: list[LearnerResult]
    warnings: list[str]

    @classmethod
    def of(
        cls,
        suite: LearnersSuite,
        stored: Sequence[StoredCell],
        software: dict[str, Any],
        path: Path,
    ) -> Self:
        """Return the results of a run.

        Args:
            suite: Suite of the run.
            stored: Trials with their results.
            software: Versions of the software.
            path: Path of the file.

        Raises:
            ValueError: No learner has been played.
        """
        scales, results = learner_results(suite, stored)
        if not results:
            raise ValueError(
                f"{path} holds no learner that was played; let `roletrust benchmark` go on first"
            )
        warnings = [f"{trial.key}: {done.failed}" for trial, done in stored if done.failed]
        unfit = {
            f"{trial.learner} on {trial.task}": done.unsuitable
            for trial, done in stored
            if done.unsuitable
        }
        warnings += [
            f"{who}: {why}"
            for who, why in unfit.items()
            if who.partition(" on ")[0] in suite.learners
        ]
        return cls(suite, software, reproduction_command(suite, path), scales, results, warnings)

    @property
    def order(self) -> list[str]:
        """Learners, the best first."""
        return ranking(self.results)

    @property
    def tables(self) -> dict[str, Table]:
        """The table by the name of its figure."""
        tasks, names = [ALL_TASKS, *self.scales], self.order
        ordered = sorted(
            self.results,
            key=lambda result: (
                tasks.index(result.task),
                names.index(result.learner),
                result.budget,
            ),
        )
        return {"learners": Table(HEADER, table_rows(ordered))}

    @property
    def shares(self) -> dict[str, dict[str, Interval]]:
        """Share of each learner with the largest budget over all tasks and on each task, the best
        learner first.
        """
        largest = self.suite.budgets[-1]
        mine = {
            (result.learner, result.task): result.share
            for result in self.results
            if result.budget == largest
        }
        nothing = Interval(float("nan"), float("nan"), float("nan"))
        tasks = (ALL_TASKS, *self.scales)
        return {
            name: {task: mine.get((name, task), nothing) for task in tasks} for name in self.order
        }


class Content(NamedTuple):
    """Parts of a report, at least one."""

    models: TrustModels | None = None
    learners: Learners | None = None

    @property
    def parts(self) -> list[TrustModels | Learners]:
        """Parts that are present."""
        return [part for part in self if part is not None]

    @property
    def tables(self) -> dict[str, Table]:
        """All tables by the name of their figure."""
        return {name: table for part in self.parts for name, table in part.tables.items()}


def read(paths: Iterable[Path]) -> Content:
    """Return the content of the files of runs.

    Args:
        paths: Paths of the files.

    Raises:
        ValueError: A file cannot be read or is empty, or two files have the same kind.
    """
    content, taken = Content(), dict[str, Path]()
    for path in paths:
        with ResultStore(path) as store:
            suite, stored, software = store.suite, store.all(), store.software
        if suite.kind in taken:
            raise ValueError(
                f"{taken[suite.kind]} and {path} are both of a suite for {suite.kind}; a report "
                "has one of each kind"
            )
        taken[suite.kind] = path
        if isinstance(suite, LearnersSuite):
            content = content._replace(learners=Learners.of(suite, stored, software, path))
        elif isinstance(suite, Suite):
            content = content._replace(models=TrustModels.of(suite, stored, software, path))
        else:
            raise ValueError(f"{path} is of a suite for {suite.kind}, which has no report")
    return content
