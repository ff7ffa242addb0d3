"""Results of a suite of the closed loop as the page shows them."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmarking.leaderboard import COLUMNS, Column, Leaderboard
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import RULES, Rule, Suite
from roletrust_env.benchmarking.suite_files import reproduction_command
from roletrust_env.metrics.confidence import Estimate, over_seeds
from roletrust_env.metrics.score import mean_or_nan
from roletrust_env.storage.files import write_text
from roletrust_env.storage.markdown import code, plain

_OPEN = "-open"
"""End of the name of a setting with open reports, next to the one with verified reports."""

_FIRST = 3
"""Number of models of each choice rule with a curve. More curves would hide each other."""

Floats = npt.NDArray[np.float64]


class Table(NamedTuple):
    """Rows of plain values under a header: the content of a CSV file and the data of a figure."""

    header: tuple[str, ...]
    rows: list[tuple[Any, ...]]


class Regimes(NamedTuple):
    """Worst-case skill with verified and with open reports, over the settings that have both.

    Attributes:
        model: Spec of the trust model.
        rule: Choice rule of the consumers.
        verified: Mean skill with verified reports.
        open: Mean skill with open reports.
        difference: Open less verified in the same worlds.
    """

    model: str
    rule: Rule
    verified: Estimate
    open: Estimate
    difference: Estimate


class TrustModels(NamedTuple):
    """The trust models' part of a report.

    Attributes:
        board: Leaderboard of the run.
        software: Versions of the software.
        command: Command that plays the suite.
        path: Path of the file.
        failed: Error messages of cells.
    """

    board: Leaderboard
    software: dict[str, Any]
    command: str
    path: Path
    failed: list[str]

    @classmethod
    def of(
        cls,
        suite: Suite,
        stored: Sequence[StoredCell],
        software: dict[str, Any],
        path: Path,
    ) -> Self:
        """Return the results of a run. Arguments as for `roletrust_experiments.report.content.read`
        and `Learners.of`.

        Raises:
            ValueError: No attack has been played.
        """
        board = Leaderboard.of(suite, stored)
        if not any(row.worst_attack for row in board.rows):
            raise ValueError(f"{path} has no attack that was played; continue the benchmark first")
        failed = [f"{cell.key}: {result.failed}" for cell, result in stored if result.failed]
        return cls(board, software, reproduction_command(suite, path), path, failed)

    @property
    def suite(self) -> Suite:
        """Suite that was played."""
        return self.board.suite

    @property
    def columns(self) -> list[Column]:
        """Columns of the leaderboard that readers see."""
        return [column for column in COLUMNS if column.shown]

    @property
    def warnings(self) -> list[str]:
        """Lines on what limits the numbers."""
        missing = [
            f"{label(row.model, row.rule)}: {row.missing} cells failed or missing"
            for row in self.board.rows
            if row.missing
        ]
        return [*missing, *self.failed]

    @property
    def distribution(self) -> dict[str, str]:
        """Fields of the scenario that the worlds change, with their values or draws as JSON."""
        return {name: json.dumps(value) for name, value in self.suite.worlds.set.items()}

    @property
    def cases(self) -> list[tuple[Any, ...]]:
        """Model, setting, attack, way to attack, its description and the skill of each worst case,
        in the order of the leaderboard.
        """
        rows = []
        for row in self.board.rows:
            for name in self.suite.settings:
                if case := self.board.worst_cases.get((row.model, row.rule, name)):
                    skill = _estimate(case.scores["skill"])
                    model = label(row.model, row.rule)
                    rows.append((model, name, skill, case.attack, case.method, case.words))
        return rows

    @property
    def regimes(self) -> list[Regimes]:
        """Skill by the kind of reports, in the order of the leaderboard; empty without settings
        that have both kinds.
        """
        pairs = [(x, x + _OPEN) for x in self.suite.settings if x + _OPEN in self.suite.settings]
        rows, cases = [], self.board.worst_cases
        for model, rule in ((row.model, row.rule) for row in self.board.rows):
            known = [pair for pair in pairs if all((model, rule, x) in cases for x in pair)]
            if known:
                grid = np.array(
                    [[cases[model, rule, x].scores["skill"] for x in pair] for pair in known]
                )
                verified, open_ = mean_or_nan(grid, axis=0)
                estimates = map(_estimate, (verified, open_, open_ - verified))
                rows.append(Regimes(model, rule, *estimates))
        return rows

    @property
    def curves(self) -> list[tuple[str, str, Rule, str, list[float]]]:
        """Setting, model, choice rule, worst attack and mean regret in each round."""
        cases = self.board.worst_cases
        return [
            (name, row.model, row.rule, case.attack, [np.nan if x is None else x for x in curve])
            for name in self.attacked
            for row in self.board.rows
            if (case := cases.get((row.model, row.rule, name))) and (curve := case.by_round)
        ]

    @property
    def first(self) -> list[str]:
        """Labels of the first models of each choice rule."""
        rows = self.board.rows
        by_rule = ([row for row in rows if row.rule == rule][:_FIRST] for rule in RULES)
        return [label(row.model, row.rule) for group in by_rule for row in group]

    @property
    def attacked(self) -> list[str]:
        """Names of the settings with compromised agents."""
        return [name for name, setting in self.suite.settings.items() if setting.roles]

    @property
    def tables(self) -> dict[str, Table]:
        """Tables by the names of their files, next to those of `write`."""
        names = ("verified", "open", "difference")
        halves = (part for name in names for part in (name, f"{name}_half_95"))
        lines = [
            (row.model, row.rule, *(x for estimate in row[2:] for x in estimate[:2]))
            for row in self.regimes
        ]
        curves = ("setting", "model", "rule", "attack", "regret")
        return {
            "curves": Table(curves, list(self.curves)),
            "regimes": Table(("model", "rule", *halves), lines),
        }

    def write(self, folder: Path) -> None:
        """Write the leaderboard as CSV and Markdown, and the worst cases as CSV.

        Raises:
            OSError: A file cannot be written.
        """
        board, suite = self.board, self.suite
        board.to_csv(folder / "leaderboard.csv")
        board.cases_to_csv(folder / "worst_cases.csv")
        about = f"Suite {plain(suite.name)}, version {suite.version}. Made by {code(self.command)}."
        text = f"{board.to_markdown()}\n\n{about}\n\n{board.legend}"
        write_text(folder / "leaderboard.md", text)


def label(model: str, rule: Rule) -> str:
    """Return the name of a model in figures, with its choice rule if it is not the common one."""
    return model if rule == "common" else f"{model} ({rule} rule)"


def _estimate(values: Floats) -> Estimate:
    """Return the mean over worlds, shape (W,)."""
    return over_seeds(values[None, None], 1).estimates[0]
