"""Leaderboard of learners: their shares of the optimum, over all tasks and on each."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

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
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite_files import reproduction_command
from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.files import write_csv, write_text
from roletrust_env.storage.markdown import ShownAsMarkdown, code, markdown_table, plain

_MEANING = (
    "Share by the rounds of play: 0 is honest play; interquartile mean of the runs, with its 95% "
    "interval by stratified bootstrap."
)


@dataclass(frozen=True, repr=False)
class LearnerBoard(ShownAsMarkdown):
    """Leaderboard of a run of learners.

    Attributes:
        suite: Suite of the run.
        scales: Scores with share 0 and share 1 on each task.
        results: Results of each learner with each budget.
        failed: Why trials failed, by their keys.
        unsuitable: Why learners of the suite do not apply to tasks, by the keys of the trials.
    """

    suite: LearnersSuite
    scales: dict[str, TaskScale]
    results: list[LearnerResult]
    failed: dict[str, str]
    unsuitable: dict[str, str]

    @classmethod
    def of(cls, suite: LearnersSuite, stored: Sequence[StoredCell]) -> Self:
        """Return the leaderboard of a run.

        Args:
            suite: Suite of the run.
            stored: Trials of the run with their results.
        """
        scales, results = learner_results(suite, stored)
        failed = {trial.key: done.failed for trial, done in stored if done.failed}
        unsuitable = {
            trial.key: done.unsuitable
            for trial, done in stored
            if done.unsuitable and trial.learner in suite.learners
        }
        return cls(suite, scales, results, failed, unsuitable)

    @property
    def ranking(self) -> list[str]:
        """Names of the learners, the best over all tasks with the largest budget first."""
        return ranking(self.results)

    @property
    def legend(self) -> str:
        """Meaning of the shares, and the score of share 1 on each task."""
        tops = [
            f"{task}: {scale.description}, {scale.top_score:.4f}"
            for task, scale in self.scales.items()
        ]
        return f"{_MEANING} Share 1 is, on {'; '.join(tops)}."

    def table(self) -> tuple[list[str], list[list[str]]]:
        """Return the headings and the rows of a table, by budget and learner."""
        shares = {(one.budget, one.learner, one.task): one.share for one in self.results}
        tasks = [ALL_TASKS, *self.scales]
        rows = [
            [f"{budget:,}", name, *(_words(shares.get((budget, name, task))) for task in tasks)]
            for budget in self.suite.budgets
            for name in self.ranking
        ]
        return ["rounds", "learner", *tasks], rows

    def to_markdown(self) -> str:
        """Return the table in Markdown."""
        headings, rows = self.table()
        quoted = [[rounds, code(name), *shares] for rounds, name, *shares in rows]
        return markdown_table(list(map(plain, headings)), quoted, 2)

    def write(self, folder: str | Path) -> list[str]:
        """Write `learners.csv` and `learners.md`, and return their names.

        Raises:
            OSError: A file cannot be written.
        """
        path = Path(folder)
        write_csv(path / "learners.csv", HEADER, table_rows(self.results))
        command = reproduction_command(self.suite, path / "results.sqlite")
        text = f"{self.to_markdown()}\n\n{plain(self.legend)} Made by {code(command)}.\n"
        write_text(path / "learners.md", text)
        return ["learners.csv", "learners.md"]

    def _repr_markdown_(self) -> str:
        title = f"**Learners, suite {plain(self.suite.name)}**"
        return f"{title}\n\n{self.to_markdown()}\n\n{plain(self.legend)}"


def _words(share: Interval | None) -> str:
    if share is None or share.value != share.value:
        return "-"
    interval = "" if share.low != share.low else f" [{share.low:.2f}, {share.high:.2f}]"
    return f"{share.value:.2f}{interval}"
