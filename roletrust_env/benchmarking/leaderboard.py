"""Leaderboard of the closed loop: the trust models in the order of their worst-case skill.

The worst case of a model in a setting is the attack with the lowest mean skill over the selection
worlds; honest play is one of the candidates. Its skill is measured in other worlds. All worlds
count alike, and are a random effect: intervals are over worlds. Models that choose by the common
rule and models that choose by their own rule are ranked apart. Opening results plays nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmarking.schema import AttackResult, CellResult
from roletrust_env.benchmarking.store import ResultStore
from roletrust_env.benchmarking.suite import RULES, Cell, Rule, Suite
from roletrust_env.benchmarking.suite_files import reproduction_command
from roletrust_env.benchmarking.tiers import tiers
from roletrust_env.evaluation.received import SCORES
from roletrust_env.metrics.confidence import Estimate, over_seeds
from roletrust_env.metrics.score import mean_or_nan
from roletrust_env.storage.files import write_csv, write_text
from roletrust_env.storage.markdown import code, markdown_table, plain

Floats = npt.NDArray[np.float64]

CONVERGED = 0.01
"""Difference of skill up to which a search has converged, and its starts agree."""


class Column(NamedTuple):
    """A column of the leaderboard: the mean of a score over settings and worlds.

    Attributes:
        name: Name.
        score: Name of the score, see `SCORES`.
        settings: Settings with compromised agents, those without, or those with silent consumers.
        shown: Whether tables for readers have the column; the CSV file has all.
        meaning: Definition.
    """

    name: str
    score: str
    settings: Literal["attacked", "honest", "silent"]
    shown: bool
    meaning: str


COLUMNS = (
    Column("worst", "skill", "attacked", True, "skill score in the worst case of each setting"),
    Column(
        *("gain", "skill", "attacked", True),
        "worst case less that of the solo model, which listens to nobody; below 0 the model is "
        "worse than no reputation system",
    ),
    Column("clean", "skill", "honest", True, "skill score while all agents are honest"),
    Column(
        *("silent", "silent_skill", "silent", False),
        "skill score of consumers that send no reports, while all agents are honest",
    ),
    Column("regret", "regret", "attacked", False, SCORES["regret"].formula),
    Column(
        *("attacker_share", "attacker_share", "attacked", True),
        "share of the services that came from compromised providers",
    ),
    Column(
        *("attacker_earnings", "attacker_earnings", "attacked", False),
        SCORES["attacker_earnings"].formula,
    ),
    Column(
        *("brier", "brier", "attacked", True),
        "mean squared difference between trust at the choice and the quality received",
    ),
)
"""The columns of estimates. Those of settings with compromised agents are of the worst cases."""

_TIER = "models of a tier are not significantly different from its best one (95%)"


class WorstCase(NamedTuple):
    """Worst case of a trust model in a setting.

    Attributes:
        attack: Name of the attack.
        words: Short description of the attack.
        method: Way to attack that found it.
        record: Record of the attacker, see `roletrust_env.evaluation.attackers`.
        scores: Scores in each measured world by name, shape (W,) each, see `SCORES`.
        by_round: Mean regret in each round.
        last_gain: Skill that the last doubling of its budget took from the model in a search; NaN
            without a search.
        disagreement: Difference between the skills at the end of two starts of the search, the
            largest one; NaN without a second start.
    """

    attack: str
    words: str
    method: str
    record: str
    scores: dict[str, Floats]
    by_round: Sequence[float | None]
    last_gain: float
    disagreement: float

    @property
    def skill(self) -> float:
        """Mean skill over the measured worlds."""
        return float(mean_or_nan(self.scores["skill"], axis=0))


class BoardRow(NamedTuple):
    """Row of the leaderboard.

    Attributes:
        tier: Tier among the models with the same choice rule, which counts from 1. None if the
            model lacks results.
        rank: Rank by the worst case, which counts from 1.
        model: Spec of the trust model.
        rule: Choice rule of the consumers.
        estimates: Means over worlds with half their 95% interval, by the name of the column, see
            `COLUMNS`.
        worst_setting: Setting with the lowest skill.
        worst_attack: Worst attack in this setting.
        missing: Number of cells that failed or have not been played.
    """

    tier: int | None
    rank: int
    model: str
    rule: Rule
    estimates: dict[str, Estimate]
    worst_setting: str
    worst_attack: str
    missing: int


HEADER = (
    *("tier", "rank", "model", "rule"),
    *(name for column in COLUMNS for name in (column.name, f"{column.name}_half_95")),
    *("worst_setting", "worst_attack", "missing"),
)
"""Column names of the leaderboard as a CSV file."""

CASES_HEADER = (
    *("model", "rule", "setting", "attack", "words", "method"),
    *(name for score in SCORES for name in (score, f"{score}_half_95")),
    *("last_gain", "disagreement"),
)
"""Column names of the worst cases as a CSV file."""


@dataclass(frozen=True, eq=False)
class Leaderboard:
    """Leaderboard of a run.

    Attributes:
        suite: Suite of the run.
        rows: Trust models with the common choice rule, from the best to the worst, then those with
            their own one.
        worst_cases: Worst case by model, choice rule and setting.
        failed: Why cells failed, by their keys.
    """

    suite: Suite
    rows: list[BoardRow]
    worst_cases: dict[tuple[str, Rule, str], WorstCase]
    failed: dict[str, str]

    @classmethod
    def of(cls, suite: Suite, stored: Sequence[tuple[Cell, CellResult]]) -> Self:
        """Return the leaderboard of a run.

        Args:
            suite: Suite of the run.
            stored: Cells of the run with their results.
        """
        cases = _worst_cases(stored)
        played = {cell.key for cell, result in stored if not result.failed}
        rows = [row for rule in RULES for row in _rows(suite, rule, cases, played)]
        failed = {cell.key: result.failed for cell, result in stored if result.failed}
        return cls(suite, rows, cases, failed)

    @classmethod
    def read(cls, results: str | Path) -> Self:
        """Return the leaderboard of a results file.

        Raises:
            ValueError: The file cannot be read, or is of a suite for learners.
        """
        with ResultStore(Path(results)) as store:
            suite, stored = store.suite, store.all()
        if not isinstance(suite, Suite):
            raise ValueError(f"{results} is of a suite for {suite.kind}; give one for trust models")
        return cls.of(suite, stored)

    @property
    def legend(self) -> str:
        """Meaning of the columns, as a list in Markdown."""
        meanings = {"tier": _TIER} | {c.name: c.meaning for c in COLUMNS if c.shown}
        lines = (f"- **{_title(name)}**: {meaning}.\n" for name, meaning in meanings.items())
        note = "- Estimates are means over the measured worlds ± half the 95% interval.\n"
        return "".join(lines) + note

    @property
    def convergence(self) -> str:
        """Number of searches that converged, in one sentence; empty without a search."""
        gains = np.array([case.last_gain for case in self.worst_cases.values()])
        apart = np.array([case.disagreement for case in self.worst_cases.values()])
        searched, twice = gains[~np.isnan(gains)], apart[~np.isnan(apart)]
        if not len(searched):
            return ""
        return (
            f"The last doubling of the budget gained less than {CONVERGED} in "
            f"{(searched < CONVERGED).sum()} of {len(searched)} searches; two starts agree within "
            f"{CONVERGED} in {(twice < CONVERGED).sum()} of {len(twice)}."
        )

    def write(self, folder: str | Path) -> list[str]:
        """Write `leaderboard.csv`, `leaderboard.md` and `worst_cases.csv`, and return their names.

        Raises:
            OSError: A file cannot be written.
        """
        path = Path(folder)
        self.to_csv(path / "leaderboard.csv")
        self.cases_to_csv(path / "worst_cases.csv")
        command = reproduction_command(self.suite, path / "results.sqlite")
        name, version = plain(self.suite.name), self.suite.version
        about = f"Suite {name}, version {version}. Made by {code(command)}."
        write_text(path / "leaderboard.md", f"{self.to_markdown()}\n\n{about}\n\n{self.legend}")
        return ["leaderboard.csv", "leaderboard.md", "worst_cases.csv"]

    def to_csv(self, path: str | Path) -> None:
        """Write the rows as a CSV file.

        Raises:
            OSError: The file cannot be written.
        """
        write_csv(Path(path), HEADER, self.lines())

    def to_pandas(self) -> Any:
        """Return the rows as a `pandas.DataFrame` with the columns of `HEADER`.

        Raises:
            ImportError: pandas is not installed.
        """
        from pandas import DataFrame

        return DataFrame(self.lines(), columns=list(HEADER))

    def lines(self) -> list[tuple[object, ...]]:
        """Return the rows as plain values in the order of `HEADER`."""
        return [
            (
                *row[:4],
                *(x for column in COLUMNS for x in row.estimates[column.name][:2]),
                *row[-3:],
            )
            for row in self.rows
        ]

    def cases_to_csv(self, path: str | Path) -> None:
        """Write the worst case of each model in each setting as a CSV file.

        Raises:
            OSError: The file cannot be written.
        """
        write_csv(Path(path), CASES_HEADER, self.case_lines())

    def case_lines(self) -> list[tuple[object, ...]]:
        """Return the worst cases as plain values in the order of `CASES_HEADER`."""
        return [
            (
                *(*key, case.attack, case.words, case.method),
                *(x for score in SCORES for x in _estimates(case.scores[score][None])[0][:2]),
                *(case.last_gain, case.disagreement),
            )
            for key, case in self.worst_cases.items()
        ]

    def to_markdown(self) -> str:
        """Return the rows as tables in Markdown, one for each choice rule."""
        parts = []
        for rule, lines in self._tables():
            names = ("model", "worst attack")
            for line in lines:
                line["model"] = code(line["model"])
                line["worst attack"] = plain(line["worst attack"])
            table = markdown_table(tuple(lines[0]), [list(x.values()) for x in lines], names=names)
            parts.append(f"{_HEADINGS[rule]}\n\n{table}")
        return "\n\n".join(parts)

    def __repr__(self) -> str:
        """Return the rows as tables of plain text."""
        parts = [f"Leaderboard, suite {self.suite.name}"]
        for rule, lines in self._tables():
            widths = {x: max(len(x), *(len(line[x]) for line in lines)) for x in lines[0]}
            texts = [dict.fromkeys(lines[0], ""), *lines]
            texts[0] = {name: name for name in lines[0]}
            text = ("  ".join(f"{t[x]:<{widths[x]}}" for x in widths).rstrip() for t in texts)
            parts.append("\n".join([_HEADINGS[rule], *text]))
        return "\n".join(parts)

    def _repr_markdown_(self) -> str:
        """Return the rows as tables for a notebook, with what their columns mean."""
        title = f"**Leaderboard, suite {plain(self.suite.name)}**"
        return f"{title}\n\n{self.to_markdown()}\n\n{self.legend}"

    def _tables(self) -> list[tuple[Rule, list[dict[str, str]]]]:
        """Return the displayed columns of each table as text."""
        tables = [(rule, [_texts(row) for row in self.rows if row.rule == rule]) for rule in RULES]
        return [(rule, lines) for rule, lines in tables if lines]


_HEADINGS: dict[Rule, str] = {
    "common": "Common choice rule: the provider of the highest trust, with forced exploration",
    "own": "Own choice rule of the model, without forced exploration",
}


def _rows(
    suite: Suite,
    rule: Rule,
    cases: dict[tuple[str, Rule, str], WorstCase],
    played: set[str],
) -> list[BoardRow]:
    """Return the rows of a choice rule, from the best to the worst."""
    models = [model for model, own in suite.entrants if own == rule]
    expected = [cell for cell in suite.cells() if cell.rule == rule]
    missing = [
        sum(cell.key not in played for cell in expected if cell.model == model) for model in models
    ]
    kinds = {
        name: "attacked" if setting.roles else "silent" if setting.silent else "honest"
        for name, setting in suite.settings.items()
    }

    def table(column: Column) -> Floats:
        """Return the mean over settings for each model and world, shape (M, W)."""
        settings = [name for name, kind in kinds.items() if kind == column.settings]
        grid = np.full((len(models), max(1, len(settings)), suite.worlds.measured), np.nan)
        for m, model in enumerate(models):
            for s, setting in enumerate(settings):
                if (model, rule, setting) in cases:
                    grid[m, s] = cases[model, rule, setting].scores[column.score]
        return mean_or_nan(grid, axis=1)

    values = {column.name: table(column) for column in COLUMNS}
    worst = values["worst"]
    solo = suite.solo[rule]
    values["gain"] = worst - worst[models.index(solo)] if solo in models else np.nan * worst
    estimates = {name: _estimates(grid) for name, grid in values.items()}
    keys = [
        (lacking > 0, np.inf if np.isnan(mean) else -round(mean, 9))
        for lacking, (mean, *_) in zip(missing, estimates["worst"], strict=True)
    ]
    order = sorted(range(len(models)), key=lambda k: keys[k])
    judged = [k for k in order if not missing[k] and not np.isnan(keys[k][1])]
    tier_of = dict(zip(judged, tiers(worst[judged][:, None]), strict=True))
    rows = []
    for k in order:
        own = {
            name: case
            for name, kind in kinds.items()
            if kind == "attacked" and (case := cases.get((models[k], rule, name)))
        }
        lowest = min(own, key=lambda name: own[name].skill, default="")
        rows.append(
            BoardRow(
                tier=tier_of.get(k),
                rank=[keys[j] for j in order].index(keys[k]) + 1,
                model=models[k],
                rule=rule,
                estimates={name: parts[k] for name, parts in estimates.items()},
                worst_setting=lowest,
                worst_attack=own[lowest].attack if lowest else "",
                missing=missing[k],
            )
        )
    return rows


def _worst_cases(
    stored: Sequence[tuple[Cell, CellResult]],
) -> dict[tuple[str, Rule, str], WorstCase]:
    candidates: dict[tuple[str, Rule, str], list[tuple[Cell, AttackResult]]] = {}
    for cell, result in stored:
        for row in result.rows:
            candidates.setdefault((cell.model, cell.rule, cell.setting), []).append((cell, row))
    cases = {}
    for key, attacks in candidates.items():
        measured = [attack for attack in attacks if attack[1].measured]
        cell, row = min(measured, key=lambda attack: _mean(attack[1].chosen["skill"]))
        starts = [row for cell, row in attacks if cell.method == "search"]
        unknown = [np.nan] * len(row.measured["skill"])  # scores that are newer than the run
        cases[key] = WorstCase(
            row.attack,
            row.words,
            cell.method,
            row.record,
            {name: np.array(row.measured.get(name, unknown), np.float64) for name in SCORES},
            row.by_round,
            max((_last_gain(start) for start in starts), default=np.nan),
            _disagreement([_mean(start.chosen["skill"]) for start in starts]),
        )
    return cases


def _last_gain(row: AttackResult) -> float:
    """Return the skill that the last doubling of the rounds of a search took from the model."""
    rounds, last = row.progress[-1]
    earlier = [skill for played, skill in row.progress if 2 * played <= rounds]
    return earlier[-1] - last if earlier else np.nan


def _disagreement(skills: Sequence[float]) -> float:
    return max(skills) - min(skills) if len(skills) > 1 else np.nan


def _mean(values: Sequence[float | None]) -> float:
    """Return a mean by which a worst case is chosen; infinite where it is undefined."""
    mean = float(mean_or_nan(np.array(values, np.float64), axis=0))
    return np.inf if np.isnan(mean) else mean


def _estimates(values: Floats) -> list[Estimate]:
    """Return the mean over worlds for each row, shape (M, W)."""
    return over_seeds(values[:, None], len(values)).estimates


def _title(name: str) -> str:
    return name.replace("_", " ")


def _texts(row: BoardRow) -> dict[str, str]:
    """Return the displayed columns of a row as text."""
    attack = f"{row.worst_attack} ({row.worst_setting})" if row.worst_attack else "-"
    return {
        "tier": "-" if row.tier is None else str(row.tier),
        "rank": str(row.rank),
        "model": row.model,
        **{_title(c.name): _number(row.estimates[c.name]) for c in COLUMNS if c.shown},
        "worst attack": f"{row.missing} failed or missing" if row.missing else attack,
    }


def _number(estimate: Estimate) -> str:
    if estimate.mean != estimate.mean:
        return "-"
    half = f" ± {estimate.half:.3f}" if estimate.half == estimate.half else ""
    return f"{estimate.mean:.3f}{half}"
