"""Leaderboard: the trust models in the order of their mean score in the worst case of each
condition.

On the scale of utility a score is never less than that of a blind choice, since a consumer can
always choose blindly. A model that ignores ratings has exactly this utility in every condition, and
is ranked last. On the scale of skill a blind choice is 0. A leaderboard displays as a table and
converts to other formats.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import gcd
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmarking.caveats import caveats
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.verdict import DIGITS, verdict
from roletrust_env.benchmarking.worst_case import (
    AttackScores,
    WorstCase,
    attack_scores,
    worst_cases,
)
from roletrust_env.metrics.confidence import Estimate, Interval, over_seeds
from roletrust_env.metrics.score import mean_or_nan
from roletrust_env.storage.files import write_csv
from roletrust_env.storage.markdown import markdown_table

if TYPE_CHECKING:
    import pandas as pd


Floats = npt.NDArray[np.float64]


class LeaderboardRow(NamedTuple):
    """Row of the leaderboard. Each estimate is a mean with half its 95% interval over the games and
    the seeds.

    Attributes:
        tier: Tier, which counts from 1. Models that are not told apart from the best one of a tier
            share it. None if the model lacks results.
        rank: Rank, which counts from 1.
        model: Name of the model.
        clean: Mean score over the tracks on which all agents are honest, on the scale of the suite.
        worst: Mean score of the worst case over the conditions.
        alike: Mean score of the worst case if only attacks count whose providers serve all raters
            alike.
        published: Mean score of the worst case if the consumers went by published trust.
        ensemble: Mean score of the worst case without the known attacks that others have found.
        open_worst: Mean score of the worst case if methods with more knowledge than a real attacker
            count, too.
        damage: Loss of trust of honest agents in the worst case.
        false_alarms: Share of honest agents that are classified as attackers while all agents are
            honest.
        detection: AUC of the detection of attackers in the worst case.
        holds: Probability of the same rank in another run, with new games, and with new seeds if
            there are several.
        missing: Number of cells that failed, entirely or in part, or that have not been played.
        worst_attack: Name of the attack in the condition with the least score. Empty if none was
            played.
        worst_condition: Description of that condition.
        alike_tier: Tier by `alike`.
        alike_rank: Rank by `alike`.
    """

    tier: int | None
    rank: int
    model: str
    clean: Estimate
    worst: Estimate
    alike: Estimate
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
    alike_tier: int | None = None
    alike_rank: int = 0

    def line(self) -> list[object]:
        """Return the row as plain values in the order of `HEADER`."""
        numbers = [value for name in _ESTIMATES for value in getattr(self, name)[:2]]
        return [*self[:_FIRST], *numbers, *self[_LAST:]]


_ESTIMATES = tuple(
    name for name, kind in LeaderboardRow.__annotations__.items() if kind is Estimate
)
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
    """Return the rows of the leaderboard from the best model to the worst. Models that tie share a
    rank.

    Args:
        suite: Suite of the run.
        stored: Cells of the run with their results.
        models: Names of the models to rank.
        cells_each: Number of cells of each model.
        attacks: Scores of the attacks in the cells. They are computed if None.
    """
    attacks = attack_scores(suite, stored) if attacks is None else attacks
    honest = {name for name, track in suite.tracks.items() if not track.roles}
    own = [
        scores
        for scores in attacks
        if (scores.attack, tuple(scores.condition)) not in suite.entered
    ]
    black_box, without, white_box = (
        worst_cases(attacks),
        worst_cases(own),
        worst_cases(attacks, white_box=True),
    )
    serving_alike = worst_cases(attacks, alike=True)
    clean = [case for case in black_box.values() if case.condition.track in honest]
    attacked, alike, ensemble, open_attacked = (
        [case for case in cases.values() if case.condition.track not in honest]
        for cases in (black_box, serving_alike, without, white_box)
    )
    columns = {
        "clean": score_table(clean, models),
        "worst": score_table(attacked, models),
        "alike": score_table(alike, models),
        "published": score_table(attacked, models, lambda case: case.published),
        "ensemble": score_table(ensemble, models),
        "open_worst": score_table(open_attacked, models),
        "damage": score_table(attacked, models, lambda case: case.measured["damage"]),
        "false_alarms": score_table(clean, models, lambda case: case.measured["false_alarms"]),
        "detection": score_table(attacked, models, lambda case: case.measured["auc"]),
    }
    estimates = {
        name: over_seeds(values, len(models)).estimates for name, values in columns.items()
    }
    missing = [
        cells_each - sum(cell.model == model and not result.failed for cell, result in stored)
        for model in models
    ]
    means = {
        name: [estimate.mean for estimate in estimates[name]]
        for name in ("clean", "worst", "alike")
    }
    places, own_places = (
        _places(columns[name], means[name], means["clean"], missing) for name in ("worst", "alike")
    )
    rows = []
    for k, model in enumerate(models):
        lowest = min(
            (case for case in attacked if case.model == model),
            key=lambda case: case.mean,
            default=None,
        )
        row = LeaderboardRow(
            tier=places.tiers.get(k),
            rank=places.ranks[k],
            model=model,
            **{name: values_of_models[k] for name, values_of_models in estimates.items()},
            holds=places.holds.get(k, np.nan),
            missing=missing[k],
            worst_attack="" if lowest is None else lowest.attack,
            worst_condition="" if lowest is None else lowest.condition.description,
            alike_tier=own_places.tiers.get(k),
            alike_rank=own_places.ranks[k],
        )
        rows.append(row)
    return [rows[k] for k in places.ranks]


class _Places(NamedTuple):
    """Ranks, tiers and the probability that a rank holds, by the number of the model, the best
    first.
    """

    ranks: dict[int, int]
    tiers: dict[int, int]
    holds: dict[int, float]


def _places(
    scores: Floats, means: Sequence[float], clean: Sequence[float], missing: Sequence[int]
) -> _Places:
    """Return the places of models.

    Args:
        scores: Score of each model, seed and game, shape (M, S, G).
        means: Mean score of each model.
        clean: Mean score while all agents are honest, which decides between equal ones.
        missing: Number of cells that each model lacks; a model that lacks some is last and has no
            tier.
    """
    keys = [
        (lacking > 0, *_order(*pair)) for lacking, *pair in zip(missing, means, clean, strict=True)
    ]
    order = sorted(range(len(keys)), key=lambda k: keys[k])
    in_order = [keys[k] for k in order]
    ranks = {
        k: in_order.index(keys[k]) + 1 for k in order
    }  # equal keys share the rank of the first one
    judged = [k for k in order if not missing[k] and not np.isnan(means[k])]
    ranked = verdict(scores[judged])
    tiers, holds = (
        dict(zip(judged, ranked.tiers, strict=True)),
        dict(zip(judged, ranked.holds, strict=True)),
    )
    return _Places(ranks, tiers, holds)


def _order(worst: float, clean: float) -> tuple[float, float]:
    """Return a sort key: the best first, undefined values last, and equal keys where only rounding
    differs.
    """
    return tuple(np.inf if np.isnan(x) else -round(x, DIGITS) for x in (worst, clean))  # type: ignore[return-value]


def score_table(
    cases: Sequence[WorstCase],
    models: Sequence[str],
    value: Callable[[WorstCase], Floats] = lambda case: case.score,
) -> Floats:
    """Return the mean over the conditions for each model, seed and game, shape (M, S, G); NaN
    without a condition.

    Where a condition has several times as many games as another, the mean of so many of them counts
    as one.

    Args:
        cases: Worst cases of the models.
        models: Names of the models.
        value: Function that returns the value of a worst case, shape (S, G).
    """
    shapes = {case.score.shape for case in cases} or {(1, 1)}
    seeds, games = min(shapes)[0], gcd(*(shape[1] for shape in shapes))
    table = np.full((len(models), seeds, games), np.nan)
    for k, model in enumerate(models):
        if mine := [value(case).reshape(seeds, games, -1) for case in cases if case.model == model]:
            table[k] = mean_or_nan(np.stack([mean_or_nan(part, axis=-1) for part in mine]), axis=0)
    return table


class MovedRow(NamedTuple):
    """A model with and without attacks whose providers treat raters differently.

    Attributes:
        model: Name of the model.
        tier: Tier by the worst case.
        rank: Rank by the worst case.
        alike_tier: Tier without these attacks.
        alike_rank: Rank without these attacks.
        worst: Mean score of the worst case.
        alike: The same without these attacks.
        loss: What these attacks cost, in the same games.
        loss_half_95: Half the 95% interval of the loss.
        condition: Condition in which they cost most.
        condition_loss: What they cost there.
        attack: Worst attack there.
    """

    model: str
    tier: int | None
    rank: int
    alike_tier: int | None
    alike_rank: int
    worst: float
    alike: float
    loss: float
    loss_half_95: float
    condition: str
    condition_loss: float
    attack: str


def moved_rows(rows: Sequence[LeaderboardRow], attacks: Sequence[AttackScores]) -> list[MovedRow]:
    """Return what attacks cost each model whose providers treat raters differently, in the order of
    the leaderboard.

    Args:
        rows: Rows of the leaderboard.
        attacks: Scores of the attacks in conditions with attackers.
    """
    models, worst, alike = (
        [row.model for row in rows],
        worst_cases(attacks),
        worst_cases(attacks, alike=True),
    )
    both = [key for key in worst if key in alike]
    tables = (score_table([cases[key] for key in both], models) for cases in (alike, worst))
    losses = over_seeds(np.subtract(*tables), len(models)).estimates
    moved = []
    for row, loss in zip(rows, losses, strict=True):
        mine = {key: alike[key].mean - worst[key].mean for key in both if key[0] == row.model}
        most = max(mine, key=mine.__getitem__, default=None)
        where, cost, attack = ("", np.nan, "")
        if most is not None:
            where, cost, attack = most[1].description, mine[most], worst[most].attack
        places, means = (
            (row.tier, row.rank, row.alike_tier, row.alike_rank),
            (row.worst.mean, row.alike.mean),
        )
        moved.append(MovedRow(row.model, *places, *means, *loss[:2], where, cost, attack))
    return moved


_MEANINGS = {
    "score": "{score} of choosing by trust, ± half the 95% interval over the {runs}",
    "tier": "models that are not told apart from the first one of the tier, at 5% for the whole table",  # noqa: E501
    "rank": "",
    "model": "",
    "clean": "all agents honest",
    "worst": "mean of the worst case over the conditions, chosen in other games",
    "alike": "the worst case of attacks that serve all raters alike, and the place by it",
    "published": "the worst case if consumers went by published trust",
    "ensemble": "the worst case without the attacks that others have found",
    "real": "what a model keeps in replays of real logs with hostile accounts, the mean over goals and logs",  # noqa: E501
    "worst attack": "the attack in the condition with the least {score}",
    "damage": "loss of trust of honest agents in the worst case",
    "alarms": "share of honest agents with trust below 0.5 while all agents are honest",
    "AUC": "detection of attackers by trust in the worst case",
    "holds": "probability of the same rank in another run with new {runs}",
}
"""Meaning of the score and of each column."""

COLUMNS = tuple(_MEANINGS)[1:]
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
        real: What models keep in replays of real logs, by name, see
            `roletrust_env.benchmarking.real_logs`.
    """

    suite: Suite
    rows: list[LeaderboardRow]
    caveats: list[str]
    cells: list[StoredCell]
    attacks: list[AttackScores]
    real: Mapping[str, Interval]

    @classmethod
    def of(
        cls, suite: Suite, stored: Sequence[StoredCell], real: Mapping[str, Interval] | None = None
    ) -> Self:
        """Return the leaderboard of a run.

        Args:
            suite: Suite of the run.
            stored: Cells of the run with their results.
            real: What models keep in replays of real logs, by name.
        """
        names = suite.model_names
        attacks = attack_scores(suite, stored)
        rows = leaderboard_rows(suite, stored, names, len(suite.cells()) // len(names), attacks)
        return cls(
            suite, rows, caveats(suite, stored, attacks, names), list(stored), attacks, real or {}
        )

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns that say something in this run.

        All of `COLUMNS`, but `alike` only if some attack treats raters differently, `published`
        only if the consumers are raters, `ensemble` only if others have found attacks, and `real`
        only with replays of logs.
        """
        idle = set() if any(attack.treats for attack in self.attacks) else {"alike"}
        if self.suite.consumers == "public":
            idle.add("published")
        if not any(attack.finder for attack in self.suite.known):
            idle.add("ensemble")
        if not self.real:
            idle.add("real")
        return tuple(name for name in COLUMNS if name not in idle)

    def explain(self, columns: Sequence[str]) -> dict[str, str]:
        """Return the meaning of the score, and of each of some columns that needs an explanation,
        by name.
        """
        words = {
            "score": self.suite.score,
            "runs": "games and seeds" if len(self.suite.seeds) > 1 else "games",
        }
        return {
            name: _MEANINGS[name].format(**words) for name in ("score", *columns) if _MEANINGS[name]
        }

    @property
    def legend(self) -> str:
        """Meaning of the score and of the columns, as a list in Markdown."""
        return "".join(
            f"- **{name}**: {meaning}.\n" for name, meaning in self.explain(self.columns).items()
        )

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
            texts = row_texts(row, " ± ", self.real)
            texts["model"] = f"`{texts['model']}`"
            lines.append([texts[name] for name in self.columns])
        return markdown_table(self.columns, lines, names=_LEFT)

    def __repr__(self) -> str:
        """Return the rows as a table of plain text."""
        lines = [
            dict(zip(COLUMNS, COLUMNS, strict=True)),
            *(row_texts(row, "±", self.real) for row in self.rows),
        ]
        widths = {name: max(len(line[name]) for line in lines) for name in self.columns}
        text = [
            "  ".join(
                f"{line[name]:{'<' if name in _LEFT else '>'}{width}}"
                for name, width in widths.items()
            )
            for line in lines
        ]
        title = f"Leaderboard, suite {self.suite.name}"
        return "\n".join([title, *(line.rstrip() for line in text), *self.caveats])

    def _repr_markdown_(self) -> str:
        """Return the rows as a table for a notebook, with what its columns mean."""
        notes = "".join(f"- {line}\n" for line in self.caveats)
        return (
            "**Leaderboard, suite "
            f"{self.suite.name}**\n\n{self.to_markdown()}\n\n{self.legend}\n{notes}"
        )


def row_texts(
    row: LeaderboardRow, between: str, real: Mapping[str, Interval] | None = None
) -> dict[str, str]:
    """Return a row as text, by the names in `COLUMNS`.

    Args:
        row: Row of a leaderboard.
        between: Text between a mean and half its interval.
        real: What models keep in replays of real logs, by name.
    """
    real_score = (real or {}).get(row.model)
    worst = f"{row.worst_attack} ({row.worst_condition})" if row.worst_attack else "-"
    holds = "-" if row.holds != row.holds else f"{row.holds:.0%}"
    return {
        "tier": "-" if row.tier is None else str(row.tier),
        "rank": str(row.rank),
        "model": row.model,
        "clean": _estimate(row.clean, between),
        "worst": _estimate(row.worst, between),
        "alike": f"{_estimate(row.alike, between)} ({row.alike_rank}, tier {row.alike_tier or '-'})",  # noqa: E501
        "published": _estimate(row.published, between),
        "ensemble": _estimate(row.ensemble, between),
        "real": "-"
        if real_score is None
        else f"{real_score.value:.3f} ({real_score.low:.3f}, {real_score.high:.3f})",
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
