"""Results of a benchmark of trust models as the commands read them, and the leaderboard as they
show it.
"""

import shlex
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from roletrust_env.benchmarking.closed_loop.board import ClosedLoopBoard
from roletrust_env.benchmarking.closed_loop.suite import ClosedLoopSuite
from roletrust_env.benchmarking.leaderboard import Leaderboard, row_texts
from roletrust_env.benchmarking.store import ResultStore, StoredCell
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.suite_files import AnySuite
from roletrust_env.benchmarking.verification import check_installed_names
from roletrust_experiments.commands.console import number_table, short

_SHOWN = ("clean", "worst", "holds")


def read_board(results: Path) -> ClosedLoopBoard:
    """Return the leaderboard of a results file.

    Raises:
        ValueError: The file cannot be read, or is not of a suite of the closed loop.
    """
    with ResultStore(results) as store:
        suite, stored = store.suite, store.all()
    if not isinstance(suite, ClosedLoopSuite):
        raise ValueError(f"{results} is of a suite for {suite.kind}; give one for trust models")
    return ClosedLoopBoard.of(suite, stored)


def read_run(results: Path) -> tuple[Suite, list[StoredCell]]:
    """Return the suite and the cells of a results file.

    Raises:
        ValueError: The file cannot be read, or is of a suite for learners.
    """
    with ResultStore(results) as store:
        suite, stored = store.suite, store.all()
    if not isinstance(suite, Suite):
        raise ValueError(f"{results} is of a suite for {suite.kind}; give one for trust models")
    return suite, stored


def leaderboard_table(leaderboard: Leaderboard) -> Table:
    """Return the leaderboard for a terminal of 80 columns; the file has further columns."""
    title = escape(f"Leaderboard, suite {leaderboard.suite.name}")
    caption = "\n".join(
        f"{name}: {meaning}" for name, meaning in leaderboard.explain(("tier", *_SHOWN)).items()
    )
    table = number_table(title, caption, *_SHOWN, name="tier, rank, model")
    table.add_column("worst attack", overflow="fold")
    for row in leaderboard.rows:
        texts = row_texts(row, "±")
        numbers = (short(texts[name]) for name in _SHOWN)
        table.add_row(
            f"{texts['tier']} {row.rank:2} {escape(row.model)}",
            *numbers,
            escape(row.worst_attack or "-"),
        )
    return table


def replay_command(leaderboard: Leaderboard, results: Path) -> str | None:
    """Return the command that shows the worst attack on the first model of a suite, None if there
    was none.
    """
    suite, attacked = leaderboard.suite, {row.model for row in leaderboard.rows if row.worst_attack}
    model = next((name for name in suite.model_names if name in attacked), None)
    if model is None:
        return None
    return shlex.join(["roletrust", "replay", str(results), "--model", model, *_allow_code(suite)])


def report_command(suite: AnySuite, out: Path) -> str:
    """Return the command that makes the page of a run, in the folder of its results."""
    results, page = str(out / "results.sqlite"), str(out / "report")
    return shlex.join(["roletrust", "report", results, *_allow_code(suite), "--out", page])


def _allow_code(suite: AnySuite) -> list[str]:
    """Return the option that a command on results needs if a suite names models or attacks that are
    not installed.
    """
    if isinstance(suite, Suite):
        try:
            check_installed_names(suite)
        except ValueError:
            return ["--allow-code"]
    return []


def leaderboard_markdown(leaderboard: Leaderboard, command: str) -> str:
    """Return the leaderboard in Markdown, with what it shows and the command that made it."""
    about = f"Suite {leaderboard.suite.name}. Made by `{command}`."
    return f"{leaderboard.to_markdown()}\n\n{about}\n\n{leaderboard.legend}"
