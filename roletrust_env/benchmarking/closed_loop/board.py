"""Leaderboard of the closed loop: the trust models in the order of their worst-case skill.

The worst case of a model in a setting is the attack with the lowest mean skill over the selection
worlds; honest play is one of the candidates. Its skill is measured in other worlds. All worlds
count alike, and are a random effect: intervals are over worlds. Opening results plays nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmarking.closed_loop.suite import Cell, ClosedLoopSuite, Rule
from roletrust_env.benchmarking.schema import AttackResult, CellResult
from roletrust_env.benchmarking.verdict import verdict
from roletrust_env.metrics.confidence import Estimate, over_seeds
from roletrust_env.metrics.score import mean_or_nan
from roletrust_env.storage.files import write_csv
from roletrust_env.storage.markdown import markdown_table

Floats = npt.NDArray[np.float64]


class SettingWorstCase(NamedTuple):
    """Worst case of a trust model in a setting.

    Attributes:
        attack: Name of the attack.
        method: Way to attack that found it.
        scores: Scores in each measured world by name, shape (W,) each, see
            `roletrust_env.evaluation.received.COLUMNS`.
    """

    attack: str
    method: str
    scores: dict[str, Floats]


class BoardRow(NamedTuple):
    """Row of the leaderboard. Estimates are means over worlds with half their 95% interval.

    Attributes:
        tier: Tier, which counts from 1. Models of a tier are not significantly different from its
            best one. None if the model lacks results.
        rank: Rank by the worst case, which counts from 1.
        model: Spec of the trust model.
        rule: Choice rule of the consumers.
        worst: Skill in the worst case, the mean over the settings with attackers.
        gain: This skill less that of the solo model. Below 0 the model is worse than no reputation
            system.
        clean: Skill while all agents are honest.
        attacker_share: Share of the services that came from compromised providers, in the worst
            cases of settings that have some.
        brier: Brier score of trust against the quality received, in the worst cases.
        worst_setting: Setting with the lowest skill.
        worst_attack: Worst attack in this setting.
        missing: Number of cells that failed or have not been played.
    """

    tier: int | None
    rank: int
    model: str
    rule: Rule
    worst: Estimate
    gain: Estimate
    clean: Estimate
    attacker_share: Estimate
    brier: Estimate
    worst_setting: str
    worst_attack: str
    missing: int

    def line(self) -> list[object]:
        """Return the row as plain values in the order of `HEADER`."""
        return [
            part
            for value in self
            for part in (value[:2] if isinstance(value, Estimate) else (value,))
        ]


HEADER = tuple(
    column
    for name, kind in BoardRow.__annotations__.items()
    for column in ((name, f"{name}_half_95") if kind is Estimate else (name,))
)
"""Column names of the leaderboard as a table."""

MEANINGS = {
    "tier": "models of a tier are not significantly different from its best one (95%)",
    "rule": "choice rule of consumers: greedy with forced exploration, or that of the model",
    "worst": "skill in the worst case, ± half the 95% interval over worlds: 1 is always the best "
    "honest provider, 0 is chance",
    "gain": "this skill less that of the solo model, which listens to nobody",
    "clean": "skill while all agents are honest",
    "attackers": "share of the services that came from compromised providers, in the worst cases",
    "Brier": "mean squared difference between trust and the quality received, in the worst cases",
}
"""Meaning of the displayed columns."""


@dataclass(frozen=True, eq=False)
class ClosedLoopBoard:
    """Leaderboard of a run.

    Attributes:
        suite: Suite of the run.
        rows: Trust models by their choice rule, from the best to the worst.
        worst_cases: Worst case by model, choice rule and setting.
    """

    suite: ClosedLoopSuite
    rows: list[BoardRow]
    worst_cases: dict[tuple[str, Rule, str], SettingWorstCase]

    @classmethod
    def of(cls, suite: ClosedLoopSuite, stored: Sequence[tuple[Cell, CellResult]]) -> Self:
        """Return the leaderboard of a run.

        Args:
            suite: Suite of the run.
            stored: Cells of the run with their results.
        """
        cases = _worst_cases(stored)
        played = {cell.key for cell, result in stored if not result.failed}
        every = suite.cells()
        entrants = list(dict.fromkeys((cell.model, cell.rule) for cell in every))
        missing = [
            sum(cell.key not in played for cell in every if (cell.model, cell.rule) == entrant)
            for entrant in entrants
        ]
        worlds = suite.worlds.measured
        attacked = [name for name, setting in suite.settings.items() if setting.roles]
        honest = [
            name
            for name, setting in suite.settings.items()
            if not setting.roles and not setting.silent
        ]

        def table(settings: Sequence[str], score: str) -> Floats:
            """Return the mean over settings for each entrant and world, shape (M, W)."""
            grid = np.full((len(entrants), len(settings) or 1, worlds), np.nan)
            for m, entrant in enumerate(entrants):
                for s, setting in enumerate(settings):
                    if (*entrant, setting) in cases:
                        grid[m, s] = cases[(*entrant, setting)].scores[score]
            return mean_or_nan(grid, axis=1)

        worst = table(attacked, "skill")
        solo_rules = [k for k, (model, _) in enumerate(entrants) if model == suite.solo]
        columns = {
            "worst": worst,
            "gain": worst - worst[solo_rules[-1]],  # by its own rule if it has one
            "clean": table(honest, "skill"),
            "attacker_share": table(attacked, "attacker_share"),
            "brier": table(attacked, "brier"),
        }
        estimates = {
            name: over_seeds(values[:, None], len(entrants)).estimates
            for name, values in columns.items()
        }
        keys = [
            (lacking > 0, np.inf if np.isnan(mean) else -round(mean, 9))
            for lacking, (mean, *_) in zip(missing, estimates["worst"], strict=True)
        ]
        order = sorted(range(len(entrants)), key=lambda k: keys[k])
        judged = [k for k in order if not missing[k] and not np.isnan(keys[k][1])]
        tiers = dict(zip(judged, verdict(worst[judged][:, None]).tiers, strict=True))
        rows = []
        for k in order:
            own = {name: cases[key] for name in attacked if (key := (*entrants[k], name)) in cases}
            lowest = min(own, key=lambda name: _skill(own[name]), default="")
            rows.append(
                BoardRow(
                    tier=tiers.get(k),
                    rank=[keys[j] for j in order].index(keys[k]) + 1,
                    model=entrants[k][0],
                    rule=entrants[k][1],
                    worst=estimates["worst"][k],
                    gain=estimates["gain"][k],
                    clean=estimates["clean"][k],
                    attacker_share=estimates["attacker_share"][k],
                    brier=estimates["brier"][k],
                    worst_setting=lowest,
                    worst_attack=own[lowest].attack if lowest else "",
                    missing=missing[k],
                )
            )
        return cls(suite, rows, cases)

    @property
    def legend(self) -> str:
        """Meaning of the columns, as a list in Markdown."""
        return "".join(f"- **{name}**: {meaning}.\n" for name, meaning in MEANINGS.items())

    def to_csv(self, path: str | Path) -> None:
        """Write the rows as a CSV file.

        Raises:
            OSError: The file cannot be written.
        """
        write_csv(Path(path), HEADER, [row.line() for row in self.rows])

    def to_markdown(self) -> str:
        """Return the rows as a table in Markdown."""
        lines = [_texts(row) for row in self.rows]
        for line in lines:
            line["model"] = f"`{line['model']}`"
        columns = tuple(_texts(self.rows[0]))
        names = ("model", "rule", "worst attack")
        return markdown_table(columns, [list(line.values()) for line in lines], names=names)

    def __repr__(self) -> str:
        """Return the rows as a table of plain text."""
        lines = [_texts(row) for row in self.rows]
        widths = {name: max(len(name), *(len(line[name]) for line in lines)) for name in lines[0]}
        text = ("  ".join(f"{line[name]:<{widths[name]}}" for name in widths) for line in lines)
        head = "  ".join(f"{name:<{widths[name]}}" for name in widths)
        return "\n".join([f"Leaderboard, suite {self.suite.name}", head.rstrip(), *text])

    def _repr_markdown_(self) -> str:
        """Return the rows as a table for a notebook, with what its columns mean."""
        title = f"**Leaderboard, suite {self.suite.name}**"
        return f"{title}\n\n{self.to_markdown()}\n\n{self.legend}"


def _worst_cases(
    stored: Sequence[tuple[Cell, CellResult]],
) -> dict[tuple[str, Rule, str], SettingWorstCase]:
    candidates: dict[tuple[str, Rule, str], list[tuple[Cell, AttackResult]]] = {}
    for cell, result in stored:
        for row in result.rows:
            candidates.setdefault((cell.model, cell.rule, cell.setting), []).append((cell, row))
    cases = {}
    for key, attacks in candidates.items():
        cell, row = min(attacks, key=lambda attack: _mean(attack[1].chosen["skill"]))
        scores = {name: np.array(values, np.float64) for name, values in row.measured.items()}
        cases[key] = SettingWorstCase(row.attack, cell.method, scores)
    return cases


def _mean(values: Sequence[float | None]) -> float:
    """Return a mean by which a worst case is chosen; infinite where it is undefined."""
    mean = float(mean_or_nan(np.array(values, np.float64), axis=0))
    return np.inf if np.isnan(mean) else mean


def _skill(case: SettingWorstCase) -> float:
    return float(mean_or_nan(case.scores["skill"], axis=0))


def _texts(row: BoardRow) -> dict[str, str]:
    """Return the displayed columns of a row as text."""
    attack = f"{row.worst_attack} ({row.worst_setting})" if row.worst_attack else "-"
    return {
        "tier": "-" if row.tier is None else str(row.tier),
        "rank": str(row.rank),
        "model": row.model,
        "rule": row.rule,
        "worst": _estimate(row.worst),
        "gain": _estimate(row.gain),
        "clean": _estimate(row.clean),
        "attackers": _estimate(row.attacker_share),
        "Brier": _estimate(row.brier),
        "worst attack": f"{row.missing} failed or missing" if row.missing else attack,
    }


def _estimate(estimate: Estimate) -> str:
    if estimate.mean != estimate.mean:
        return "-"
    half = f" ± {estimate.half:.3f}" if estimate.half == estimate.half else ""
    return f"{estimate.mean:.3f}{half}"
