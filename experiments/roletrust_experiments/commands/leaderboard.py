"""The leaderboard of trust models as the commands show it: on the screen and in Markdown."""

from collections.abc import Sequence

from rich.markup import escape
from rich.table import Table

from roletrust_env.benchmark.leaderboard import LeaderboardRow
from roletrust_env.benchmark.suite import Suite
from roletrust_env.metrics.confidence import Estimate
from roletrust_experiments.commands.console import number_table

_CAPTION = (
    "utility of who goes by trust, ± half the 95% interval over the games; clean: everybody honest, disturbed or not; "
    "worst: over all attacks, chosen on other games. damage, AUC: in the worst case. alarms: honest agents with trust "
    "below 0.5 where clean. holds: probability of the same rank in new games"
)
_COLUMNS = ("clean", "worst", "damage", "alarms", "AUC", "holds")


def leaderboard_table(suite: Suite, rows: Sequence[LeaderboardRow]) -> Table:
    """For the screen."""
    table = number_table(f"Leaderboard, suite {suite.name}", _CAPTION, *_COLUMNS)
    for row in rows:
        table.add_row(f"{row.rank:2} {escape(row.model)}", *(cell.replace("0.", ".") for cell in _cells(row, "±")))
    return table


def leaderboard_markdown(suite: Suite, rows: Sequence[LeaderboardRow], command: str) -> str:
    """For a README: it says what it shows, and by which command."""
    head = ("rank", "model", *_COLUMNS)
    lines = [head, ("---:", ":---", *("---:" for _ in _COLUMNS))]
    lines += [(str(row.rank), f"`{row.model}`", *_cells(row, " ± ")) for row in rows]
    table = "\n".join(f"| {' | '.join(cell.replace('|', '&#124;') for cell in line)} |" for line in lines)
    return f"{table}\n\nSuite {suite.name}: {_CAPTION}. Made by `{command}`.\n"


def _cells(row: LeaderboardRow, between: str) -> list[str]:
    """A line behind its rank and its model, in the order of `_COLUMNS`."""
    sure = [_words(estimate, between) for estimate in (row.clean, row.worst)]
    rest = [_words(estimate) for estimate in (row.damage, row.false_alarms, row.detection)]
    holds = "-" if row.holds != row.holds else f"{row.holds:.0%}"
    return [*sure, *rest, f"{row.missing} failed or missing" if row.missing else holds]


def _words(estimate: Estimate, between: str = "") -> str:
    if estimate.mean != estimate.mean:
        return "-"
    half = f"{between}{estimate.half:.3f}" if between and estimate.half == estimate.half else ""
    return f"{estimate.mean:.3f}{half}"
