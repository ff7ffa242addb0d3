"""Options and output of `roletrust benchmark` for a suite of learners."""

from collections.abc import Sequence
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from roletrust_env.benchmarking.learners.learner import is_search, make_search_method, registry
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
from roletrust_env.evaluation.specs import check_installed
from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.files import write_csv, write_text
from roletrust_env.storage.markdown import markdown_table
from roletrust_experiments.commands.console import console, number_table
from roletrust_experiments.plots.figure_files import write_figure

_INTERVALS = "interquartile mean of the runs, with its 95% interval by stratified bootstrap"


def asked_learners(suite: LearnersSuite, named: Sequence[str] | None, allow_code: bool) -> LearnersSuite:
    """Return the suite with the learners of the options, once all of them can be made.

    Args:
        suite: Suite as it is in its file.
        named: Learners instead of the suite's; `all` means the suite's own.
        allow_code: True if a file may name what is not installed.

    Raises:
        ValueError: A name is unknown, a learner cannot be made, or a file names what is not installed.
    """
    if not allow_code:
        check_installed(registry, [name for name in suite.learners if not is_search(name)])
    asked = [part for name in named or ["all"] for part in (suite.learners if name == "all" else [name])]
    found = suite.model_copy(update={"learners": tuple(dict.fromkeys(asked))})
    for name in found.learners:
        make_search_method(name, next(iter(suite.tasks.values())).id)
    return found


def show_learners(suite: LearnersSuite, stored: Sequence[StoredCell], out: Path) -> None:
    """Write the tables and the picture of a run, and print its ranking."""
    from roletrust_experiments.plots.learners import learners_figure

    scales, found = learner_results(suite, stored)
    write_csv(out / "learners.csv", HEADER, table_rows(found))
    write_figure(out / "learners.png", learners_figure(suite.title, found, scales))
    command = reproduction_command(suite, out / "results.sqlite")
    write_text(out / "learners.md", _markdown(suite, found, scales, command))
    console.print(_table(suite, found, scales))
    for task, scale in scales.items():
        console.print(
            f"[dim]{escape(task)}: 1 is {escape(scale.description)}, {scale.top_score:.4f}[/]", soft_wrap=True
        )
    for trial, done in stored:
        if why := done.failed or (done.unsuitable if trial.learner in suite.learners else ""):
            console.print(f"[dim]{escape(trial.key)}: {escape(why)}[/]", soft_wrap=True)
    console.print(f"Written to {out}: results.sqlite, learners.csv, learners.md, learners.png", soft_wrap=True)


def show_learners_cost(suite: LearnersSuite) -> None:
    """Print the maximum number of rounds; the time of a learner is unknown."""
    table = number_table(f"{suite.name}, at the most", "rounds of each learner, over all games", "trials", "rounds")
    times, tests = len(suite.tasks) * len(suite.seeds), len(suite.budgets) * suite.games
    measured = sum(tests * task.arguments()["scenario"].max_cycles for task in suite.tasks.values()) * len(suite.seeds)
    for name in suite.learners:
        table.add_row(escape(name), f"{times * len(suite.budgets):,}", f"{times * sum(suite.budgets) + measured:,}")
    console.print(table)


def _table(suite: LearnersSuite, found: Sequence[LearnerResult], scales: dict[str, TaskScale]) -> Table:
    largest = suite.budgets[-1]
    caption = f"share with {largest:,} rounds: 0 is honest play; {_INTERVALS}"
    table = number_table(f"Learners, suite {suite.name}", caption, *map(escape, (ALL_TASKS, *scales)))
    for name in ranking(found):
        table.add_row(*map(escape, _row(name, largest, found, scales)))
    return table


def _markdown(suite: LearnersSuite, found: Sequence[LearnerResult], scales: dict[str, TaskScale], command: str) -> str:
    """Return the shares with each budget in Markdown, with what they mean and the command that made them."""
    names = ranking(found)
    rows = []
    for budget in suite.budgets:
        for name in names:
            learner, *shares = _row(name, budget, found, scales)
            rows.append([f"{budget:,}", f"`{learner}`", *shares])
    tops = [f"{task}: {scale.description}, {scale.top_score:.3f}" for task, scale in scales.items()]
    caption = f"Share by the rounds of play: 0 is honest play; {_INTERVALS}. Share 1 is, on {'; '.join(tops)}."
    table = markdown_table(["rounds", "learner", ALL_TASKS, *scales], rows, names=2)
    return f"{table}\n\n{caption} Made by `{command}`.\n"


def _row(name: str, budget: int, found: Sequence[LearnerResult], scales: dict[str, TaskScale]) -> list[str]:
    """Return the name of a learner and its shares with a budget."""
    shares = {one.task: one.share for one in found if (one.learner, one.budget) == (name, budget)}
    return [name, *(_words(shares.get(task)) for task in (ALL_TASKS, *scales))]


def _words(share: Interval | None) -> str:
    if share is None or share.value != share.value:
        return "-"
    interval = "" if share.low != share.low else f" [{share.low:.2f}, {share.high:.2f}]"
    return f"{share.value:.2f}{interval}"
