"""Result of a benchmark: a leaderboard that displays as a table and converts to other formats."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Self

from roletrust_env.benchmarking.caveats import caveats
from roletrust_env.benchmarking.cells import cells, model_names
from roletrust_env.benchmarking.leaderboard import HEADER, LeaderboardRow, leaderboard_rows
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.worst_case import AttackScores, attack_scores
from roletrust_env.metrics.confidence import Estimate
from roletrust_env.storage.files import write_csv
from roletrust_env.storage.markdown import markdown_table

if TYPE_CHECKING:
    import pandas as pd

_MEANINGS = {
    "tier": "models that are not told apart from the first one of the tier, at 5% for the whole table",
    "rank": "",
    "model": "",
    "clean": "all agents honest",
    "worst": "mean of the worst case over the conditions, chosen in other games",
    "published": "the worst case if consumers went by published trust",
    "ensemble": "the worst case without the attacks that others have found",
    "worst attack": "the attack in the condition with the least {score}",
    "damage": "loss of trust of honest agents in the worst case",
    "alarms": "share of honest agents with trust below 0.5 while all agents are honest",
    "AUC": "detection of attackers by trust in the worst case",
    "holds": "probability of the same rank in another run with new {runs}",
}
"""Meaning of each column."""

COLUMNS = tuple(_MEANINGS)
"""Columns of the displayed table, see `Leaderboard.columns`."""

_LEFT = ("model", "worst attack")


@dataclass(frozen=True, eq=False)
class Leaderboard:
    """Leaderboard of a run.

    Attributes:
        suite: Suite of the run, with its models and attacks by name.
        rows: Trust models from the best to the worst.
        caveats: Limitations of the numbers, one line each.
        cells: All cells with their results.
        attacks: Scores of all attacks.
    """

    suite: Suite
    rows: list[LeaderboardRow]
    caveats: list[str]
    cells: list[StoredCell]
    attacks: list[AttackScores]

    @classmethod
    def of(cls, suite: Suite, stored: Sequence[StoredCell]) -> Self:
        """Return the leaderboard of a run.

        Args:
            suite: Suite of the run.
            stored: Cells of the run with their results.
        """
        names = model_names(suite)
        attacks = attack_scores(suite, stored)
        rows = leaderboard_rows(suite, stored, names, len(cells(suite)) // len(names), attacks)
        return cls(suite, rows, caveats(suite, stored, attacks, names), list(stored), attacks)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns that say something in this run.

        All of `COLUMNS`, but `published` only if the consumers are raters, and `ensemble` only if others have found
        attacks.
        """
        idle = set()
        if self.suite.consumers == "public":
            idle.add("published")
        if not any(one.finder for one in self.suite.known):
            idle.add("ensemble")
        return tuple(name for name in COLUMNS if name not in idle)

    @property
    def caption(self) -> str:
        """Explanation of the columns."""
        runs = "games and seeds" if len(self.suite.seeds) > 1 else "games"
        meanings = [f"{name}: {_MEANINGS[name]}" for name in self.columns if _MEANINGS[name]]
        text = f"{{score}} of choosing by trust, ± half the 95% interval over the {{runs}}; {'; '.join(meanings)}"
        return text.format(score=self.suite.score, runs=runs)

    def to_pandas(self) -> "pd.DataFrame":
        """Return the rows as a data frame with the columns of `to_csv`.

        Raises:
            ModuleNotFoundError: pandas is not installed.
        """
        import pandas as pd

        return pd.DataFrame([row.line() for row in self.rows], columns=list(HEADER))

    def to_csv(self, path: str | Path) -> None:
        """Write the rows as a CSV file.

        Raises:
            OSError: The file cannot be written.
        """
        write_csv(Path(path), HEADER, [row.line() for row in self.rows])

    def to_markdown(self, columns: Sequence[str] | None = None) -> str:
        """Return the rows as a table in Markdown.

        Args:
            columns: Columns among `COLUMNS`. None means those of `columns`.

        Raises:
            ValueError: A column is unknown.
        """
        selected = self.columns if columns is None else tuple(columns)
        for name in selected:
            if name not in COLUMNS:
                raise ValueError(f"there is no column {name!r}; there are {', '.join(COLUMNS)}")
        lines = []
        for row in self.rows:
            texts = row_texts(row, " ± ")
            texts["model"] = f"`{texts['model']}`"
            lines.append([texts[name] for name in selected])
        return markdown_table(selected, lines, names=_LEFT)

    def __repr__(self) -> str:
        """Return the rows as a table of plain text."""
        lines = [dict(zip(COLUMNS, COLUMNS, strict=True)), *(row_texts(row, "±") for row in self.rows)]
        widths = {name: max(len(line[name]) for line in lines) for name in self.columns}
        text = [
            "  ".join(f"{line[name]:{'<' if name in _LEFT else '>'}{width}}" for name, width in widths.items())
            for line in lines
        ]
        title = f"Leaderboard, suite {self.suite.name}"
        return "\n".join([title, *(line.rstrip() for line in text), *self.caveats])

    def _repr_html_(self) -> str:
        """Return the rows as an HTML table for a notebook."""
        head = "".join(f"<th>{escape(name)}</th>" for name in self.columns)
        texts = [row_texts(row, " ± ") for row in self.rows]
        body = "".join(
            f"<tr>{''.join(f'<td>{escape(text[name])}</td>' for name in self.columns)}</tr>" for text in texts
        )
        caveats = "".join(f"<li>{escape(line)}</li>" for line in self.caveats)
        title = f"Leaderboard, suite {escape(self.suite.name)}"
        return (
            f"<table><caption>{title}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
            f"<p><small>{escape(self.caption)}.</small></p>{f'<ul>{caveats}</ul>' if caveats else ''}"
        )


def row_texts(row: LeaderboardRow, between: str) -> dict[str, str]:
    """Return a row as text, by the names in `COLUMNS`.

    Args:
        row: Row of a leaderboard.
        between: Text between a mean and half its interval.
    """
    worst = f"{row.worst_attack} ({row.worst_condition})" if row.worst_attack else "-"
    holds = "-" if row.holds != row.holds else f"{row.holds:.0%}"
    return {
        "tier": "-" if row.tier is None else str(row.tier),
        "rank": str(row.rank),
        "model": row.model,
        "clean": _estimate(row.clean, between),
        "worst": _estimate(row.worst, between),
        "published": _estimate(row.published, between),
        "ensemble": _estimate(row.ensemble, between),
        "worst attack": worst,
        "damage": _estimate(row.damage),
        "alarms": _estimate(row.false_alarms),
        "AUC": _estimate(row.detection),
        "holds": f"{row.missing} failed or missing" if row.missing else holds,
    }


def _estimate(estimate: Estimate, between: str = "") -> str:
    if estimate.mean != estimate.mean:
        return "-"
    half = f"{between}{estimate.half:.3f}" if between and estimate.half == estimate.half else ""
    return f"{estimate.mean:.3f}{half}"
