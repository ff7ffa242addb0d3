"""Leaderboard: the trust models in the order of their mean score in the worst case of each condition.

On the scale of utility a score is never less than that of a blind choice, since a consumer can always choose blindly. A
model that ignores ratings has exactly this utility in every condition, and is ranked last. On the scale of skill a
blind choice is 0. A leaderboard displays as a table and converts to other formats.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmarking.caveats import caveats
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.verdict import DIGITS, verdict
from roletrust_env.benchmarking.worst_case import AttackScores, WorstCase, attack_scores, worst_cases
from roletrust_env.metrics.confidence import Estimate, over_seeds
from roletrust_env.metrics.score import mean_or_nan
from roletrust_env.storage.files import write_csv
from roletrust_env.storage.markdown import markdown_table

if TYPE_CHECKING:
    import pandas as pd


Floats = npt.NDArray[np.float64]


class LeaderboardRow(NamedTuple):
    """Row of the leaderboard. Each estimate is a mean with half its 95% interval over the games and the seeds.

    Attributes:
        tier: Tier, which counts from 1. Models that are not told apart from the best one of a tier share it. None if
            the model lacks results.
        rank: Rank, which counts from 1.
        model: Name of the model.
        clean: Mean score over the tracks on which all agents are honest, on the scale of the suite.
        worst: Mean score of the worst case over the conditions.
        published: Mean score of the worst case if the consumers went by published trust.
        ensemble: Mean score of the worst case without the known attacks that others have found.
        open_worst: Mean score of the worst case if methods with more knowledge than a real attacker count, too.
        damage: Loss of trust of honest agents in the worst case.
        false_alarms: Share of honest agents that are classified as attackers while all agents are honest.
        detection: AUC of the detection of attackers in the worst case.
        holds: Probability of the same rank in another run, with new games, and with new seeds if there are several.
        missing: Number of cells that failed, entirely or in part, or that have not been played.
        worst_attack: Name of the attack in the condition with the least score. Empty if none was played.
        worst_condition: Description of that condition.
    """

    tier: int | None
    rank: int
    model: str
    clean: Estimate
    worst: Estimate
    published: Estimate
    ensemble: Estimate
    open_worst: Estimate
    damage: Estimate
    false_alarms: Estimate
    detection: Estimate
    holds: float
    missing: int
    worst_attack: str = ""
    worst_condition: str = ""

    def line(self) -> list[object]:
        """Return the row as plain values in the order of `HEADER`."""
        numbers = [value for name in _ESTIMATES for value in getattr(self, name)[:2]]
        return [*self[:_FIRST], *numbers, *self[_LAST:]]


_ESTIMATES = tuple(name for name, kind in LeaderboardRow.__annotations__.items() if kind is Estimate)
_FIRST = LeaderboardRow._fields.index(_ESTIMATES[0])
_LAST = _FIRST + len(_ESTIMATES)

HEADER = (
    *LeaderboardRow._fields[:_FIRST],
    *(f"{name}{end}" for name in _ESTIMATES for end in ("", "_half_95")),
    *LeaderboardRow._fields[_LAST:],
)
"""Column names of the leaderboard as a table."""


def leaderboard_rows(
    suite: Suite,
    stored: Sequence[StoredCell],
    models: Sequence[str],
    cells_each: int,
    attacks: Sequence[AttackScores] | None = None,
) -> list[LeaderboardRow]:
    """Return the rows of the leaderboard from the best model to the worst. Models that tie share a rank.

    Args:
        suite: Suite of the run.
        stored: Cells of the run with their results.
        models: Names of the models to rank.
        cells_each: Number of cells of each model.
        attacks: Scores of the attacks in the cells. They are computed if None.
    """
    attacks = attack_scores(suite, stored) if attacks is None else attacks
    honest = {name for name, track in suite.tracks.items() if not track.roles}
    entered = {(one.name, one.condition) for one in suite.known if one.finder}
    own = [one for one in attacks if (one.attack, tuple(one.condition)) not in entered]
    black_box, without, white_box = worst_cases(attacks), worst_cases(own), worst_cases(attacks, white_box=True)
    clean = [one for one in black_box.values() if one.condition.track in honest]
    attacked, ensemble, open_attacked = (
        [one for one in cases.values() if one.condition.track not in honest]
        for cases in (black_box, without, white_box)
    )
    worst = score_table(attacked, models)
    columns = {
        "clean": score_table(clean, models),
        "worst": worst,
        "published": score_table(attacked, models, lambda one: one.published),
        "ensemble": score_table(ensemble, models),
        "open_worst": score_table(open_attacked, models),
        "damage": score_table(attacked, models, lambda one: one.measured["damage"]),
        "false_alarms": score_table(clean, models, lambda one: one.measured["false_alarms"]),
        "detection": score_table(attacked, models, lambda one: one.measured["auc"]),
    }
    estimates = {name: over_seeds(values, len(models)).estimates for name, values in columns.items()}
    rows = []
    for k, model in enumerate(models):
        complete = sum(cell.model == model and not result.failed for cell, result in stored)
        lowest = min((one for one in attacked if one.model == model), key=lambda one: one.mean, default=None)
        row = LeaderboardRow(
            tier=None,
            rank=0,
            model=model,
            **{name: found[k] for name, found in estimates.items()},
            holds=np.nan,
            missing=cells_each - complete,
            worst_attack="" if lowest is None else lowest.attack,
            worst_condition="" if lowest is None else lowest.condition.description,
        )
        rows.append(row)
    keys = [(row.missing > 0, *_order(row.worst.mean, row.clean.mean)) for row in rows]
    order = sorted(range(len(rows)), key=lambda k: keys[k])
    in_order = [keys[k] for k in order]
    ranks = [in_order.index(key) + 1 for key in in_order]  # equal keys share the rank of the first one
    judged = [k for k in order if not rows[k].missing and not np.isnan(rows[k].worst.mean)]
    found = verdict(worst[judged])
    tiers, holds = dict(zip(judged, found.tiers, strict=True)), dict(zip(judged, found.holds, strict=True))
    return [
        rows[k]._replace(tier=tiers.get(k), rank=rank, holds=holds.get(k, np.nan))
        for k, rank in zip(order, ranks, strict=True)
    ]


def _order(worst: float, clean: float) -> tuple[float, float]:
    """Return a sort key: the best first, undefined values last, and equal keys where only rounding differs."""
    return tuple(np.inf if np.isnan(x) else -round(x, DIGITS) for x in (worst, clean))  # type: ignore[return-value]


def score_table(
    cases: Sequence[WorstCase], models: Sequence[str], value: Callable[[WorstCase], Floats] = lambda one: one.score
) -> Floats:
    """Return the mean over the conditions for each model, seed and game, shape (M, S, G); NaN without a condition.

    Args:
        cases: Worst cases of the models.
        models: Names of the models.
        value: Function that returns the value of a worst case, shape (S, G).
    """
    table = np.full((len(models), *(cases[0].score.shape if cases else (1, 1))), np.nan)
    for k, model in enumerate(models):
        if mine := [value(one) for one in cases if one.model == model]:
            table[k] = mean_or_nan(np.stack(mine), axis=0)
    return table


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
        names = suite.model_names
        attacks = attack_scores(suite, stored)
        rows = leaderboard_rows(suite, stored, names, len(suite.cells()) // len(names), attacks)
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
        return self.explain(self.columns)

    def explain(self, columns: Sequence[str]) -> str:
        """Return an explanation of the score and of some columns."""
        runs = "games and seeds" if len(self.suite.seeds) > 1 else "games"
        meanings = [f"{name}: {_MEANINGS[name]}" for name in columns if _MEANINGS[name]]
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

    def to_markdown(self) -> str:
        """Return the rows as a table in Markdown, with the columns of `columns`."""
        lines = []
        for row in self.rows:
            texts = row_texts(row, " ± ")
            texts["model"] = f"`{texts['model']}`"
            lines.append([texts[name] for name in self.columns])
        return markdown_table(self.columns, lines, names=_LEFT)

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

    def _repr_markdown_(self) -> str:
        """Return the rows as a table for a notebook, with what its columns mean."""
        notes = "".join(f"- {line}\n" for line in self.caveats)
        return f"**Leaderboard, suite {self.suite.name}**\n\n{self.to_markdown()}\n\n{self.caption}.\n\n{notes}"


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
