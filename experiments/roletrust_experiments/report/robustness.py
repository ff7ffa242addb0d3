"""Results of a suite for trust models as tables: the page shows them, and each is also a CSV
file.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmarking.conditions import ConditionRow, Convergence, condition_rows
from roletrust_env.benchmarking.leaderboard import HEADER, Leaderboard, MovedRow, moved_rows
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import Scale, Suite
from roletrust_env.benchmarking.suite_files import reproduction_command
from roletrust_env.benchmarking.worlds import WorldRow
from roletrust_env.benchmarking.worst_case import (
    AttackScores,
    Condition,
    WorstCase,
    least_mean,
    skill_by_seed,
    worst_cases,
)
from roletrust_env.metrics.confidence import Estimate, Interval, over_seeds
from roletrust_env.metrics.score import mean_or_nan, ratio

_POINTS = 40  # of a curve at most; the rounds of longer games are averaged a few at a time

Floats = npt.NDArray[np.float64]
_Worst = Mapping[tuple[str, Condition], WorstCase]


class Table(NamedTuple):
    """Rows of plain values under a header: the content of a CSV file and the data of a figure."""

    header: tuple[str, ...]
    rows: list[tuple[Any, ...]]

    def columns(self) -> dict[str, list[Any]]:
        """Return the values of each column."""
        return {name: [row[k] for row in self.rows] for k, name in enumerate(self.header)}


class Robustness(NamedTuple):
    """The trust models' part of a report.

    Attributes:
        suite: Suite that was played.
        software: Versions of the software.
        command: Command that plays the suite.
        path: Path of the file.
        leaderboard: The leaderboard of the run.
        blind: Score of choosing blindly in the games of the first one's worst cases.
        conditions: Conditions with attacks.
        convergence: Convergence of all searches.
        tables: Tables by the name of their figure.
    """

    suite: Suite
    software: dict[str, Any]
    command: str
    path: Path
    leaderboard: Leaderboard
    blind: float
    conditions: list[ConditionRow]
    convergence: Convergence
    tables: dict[str, Table]

    @classmethod
    def of(
        cls,
        suite: Suite,
        stored: Sequence[StoredCell],
        software: dict[str, Any],
        path: Path,
        real: Mapping[str, Interval] | None = None,
    ) -> Self:
        """Return the results of a run. Arguments as for `roletrust_experiments.report.content.read`
        and `Learners.of`.

        Raises:
            ValueError: No attack has been played.
        """
        leaderboard = Leaderboard.of(suite, stored, real)
        attacks = list(leaderboard.attacks)
        struck = [attack for attack in attacks if suite.tracks[attack.condition.track].roles]
        if not struck:
            raise ValueError(
                f"{path} holds no attack that was played; let `roletrust benchmark` go on first"
            )
        rows = leaderboard.rows
        places = _places(suite, [row.model for row in rows])
        attacks.sort(key=places)
        struck.sort(key=places)
        cases = worst_cases(attacks)
        tables = {
            "leaderboard": Table(HEADER, [tuple(row.line()) for row in rows]),
            "heatmap": _heatmap(suite.score, struck, cases),
            "worst_cases": _worst_cases(cases, [row.model for row in rows]),
            "curves": _curves(suite, attacks, cases),
            "breakdown": _breakdown(suite, cases),
            "tradeoff": _tradeoff(attacks, cases),
            "moved": Table(MovedRow._fields, list(moved_rows(rows, struck))),
            "worlds": Table(
                WorldRow._fields, [WorldRow.of(*world) for world in suite.worlds.items()]
            ),
        }
        first = [
            attack
            for attack in struck
            if attack.model == rows[0].model and _is_worst(attack, cases)
        ]
        blind = float(np.mean([_mean(attack.measured["blind"]) for attack in first] or [np.nan]))
        blind = 0.0 if suite.score == "skill" else blind
        where, course = condition_rows(cases, struck, suite.conditions), Convergence.of(struck)
        return cls(
            suite,
            software,
            reproduction_command(suite, path),
            path,
            leaderboard,
            blind,
            where,
            course,
            tables,
        )

    @property
    def warnings(self) -> list[str]:
        """Lines on what limits the numbers."""
        return self.leaderboard.caveats

    @property
    def lowest(self) -> float:
        """Lowest worst case, at which the colours of heat maps begin; they end at 1."""
        return float(np.fmin.reduce(self.tables["worst_cases"].columns()["score"], initial=1.0))

    @property
    def order(self) -> list[str]:
        """The models, the best first."""
        return [row.model for row in self.leaderboard.rows]


def _places(suite: Suite, order: Sequence[str]) -> Callable[[AttackScores], tuple[Any, ...]]:
    """Sorts by condition, as the suite has them, and in each the best model first."""
    scenarios, tracks = list(suite.scenarios), list(suite.tracks)

    def place(attack: AttackScores) -> tuple[Any, ...]:
        where = attack.condition
        condition_place = scenarios.index(where.scenario), tracks.index(where.track), where.share
        return *condition_place, order.index(attack.model), attack.attack

    return place


def _is_worst(attack: AttackScores, cases: _Worst) -> bool:
    """Return whether an attack is the worst case; with several seeds, whether most of them choose
    it.
    """
    case = cases.get((attack.model, attack.condition))
    return case is not None and case.common is attack


def _heatmap(scale: Scale, struck: Sequence[AttackScores], cases: _Worst) -> Table:
    """Return what each attack leaves; in each condition the attack with the most harm to all models
    comes first.
    """
    header = (
        "condition", "attack", "model", "method",
        "utility", "utility_half_95", "skill", "skill_half_95", "blind", "worst", "treats",
    )  # fmt: skip
    measured = [(attack.measured["utility"], attack.measured["blind"]) for attack in struck]
    scales = (
        _estimates([by_trust for by_trust, _ in measured]),
        _estimates([skill_by_seed(*pair) for pair in measured]),
    )
    rows: list[tuple[Any, ...]] = []
    for attack, utility, skill in zip(struck, *scales, strict=True):
        blind = _mean(attack.measured["blind"])
        rows.append(
            (
                *_name(attack),
                attack.method,
                *utility[:2],
                *skill[:2],
                blind,
                _is_worst(attack, cases),
                attack.treats,
            )
        )
    place, harm = header.index(scale), dict[tuple[str, str], list[float]]()
    for row in rows:
        harm.setdefault(row[:2], []).append(row[place])
    means = {key: least_mean(np.array(values)) for key, values in harm.items()}
    where = list(dict.fromkeys(row[0] for row in rows))
    return Table(header, sorted(rows, key=lambda row: (where.index(row[0]), means[row[:2]])))


def _name(attack: AttackScores) -> tuple[str, str, str]:
    return attack.condition.description, attack.attack, attack.model


def _worst_cases(cases: _Worst, order: Sequence[str]) -> Table:
    """Return the worst case of each model in each condition, also in those without attackers, as it
    counts.
    """
    header = (
        "model", "scenario", "track", "share", "attack", "method", "score", "score_half_95", "blind", "games",  # noqa: E501
    )  # fmt: skip
    rows = []
    for case, estimate in zip(
        cases.values(), _estimates([case.score for case in cases.values()]), strict=True
    ):
        blind, games = _mean(case.measured["blind"]), int((~np.isnan(case.score)).sum())
        rows.append(
            (
                case.model,
                *case.condition,
                case.attack,
                case.common.method,
                *estimate[:2],
                blind,
                games,
            )
        )
    return Table(header, sorted(rows, key=lambda row: order.index(row[0])))


def _curves(suite: Suite, attacks: Sequence[AttackScores], cases: _Worst) -> Table:
    """Return utility from round to round; conditions with everybody honest come last."""
    header = ("condition", "attack", "model", "worst", "rounds", "utility")
    rows = []
    for attack in sorted(
        attacks, key=lambda attack: not suite.tracks[attack.condition.track].roles
    ):
        if len(attack.by_round):
            rounds, utility = _thinned(attack.by_round)
            rows.append((*_name(attack), _is_worst(attack, cases), rounds, utility))
    return Table(header, rows)


def _thinned(by_round: Floats) -> tuple[list[float], list[float]]:
    """Return a curve of at most `_POINTS` points, and for each point the middle of its rounds,
    counted from 1.
    """
    many = -(-len(by_round) // _POINTS)
    starts, known = np.arange(0, len(by_round), many), ~np.isnan(by_round)
    rounds = np.add.reduceat(np.arange(len(by_round)) + 2.0, starts) / np.diff(
        [*starts, len(by_round)]
    )
    sums = np.add.reduceat(np.where(known, by_round, 0.0), starts)
    utility: Floats = ratio(sums, np.add.reduceat(known.astype(np.float64), starts))
    return rounds.tolist(), utility.tolist()


def _breakdown(suite: Suite, cases: _Worst) -> Table:
    """Return the worst-case score by the share of compromised agents, from 0, where everybody is
    honest.
    """
    header = ("where", "share", "model", "attack", "score", "score_half_95")
    rows = []
    for case, estimate in zip(
        cases.values(), _estimates([case.score for case in cases.values()]), strict=True
    ):
        for scenario, track in _stand_for(suite, case.condition):
            rows.append(
                (
                    f"{scenario}, {track}",
                    case.condition.share,
                    case.model,
                    case.attack,
                    *estimate[:2],
                )
            )
    tracks = [f"{scenario}, {track}" for scenario in suite.scenarios for track in suite.tracks]
    rows.sort(key=lambda row: (tracks.index(row[0]), row[2], row[1]))
    return Table(header, rows)


def _stand_for(suite: Suite, where: Condition) -> Iterator[tuple[str, str]]:
    """Return the tracks that a condition belongs to: its own; without attackers, those with the
    same changes.
    """
    mine = suite.tracks[where.track]
    for name, track in ((name, suite.tracks[name]) for name in suite.shares_in(where.scenario)):
        if track.roles and (name == where.track or (not mine.roles and track.set == mine.set)):
            yield where.scenario, name


def _tradeoff(attacks: Sequence[AttackScores], cases: _Worst) -> Table:
    """Return the damage and the detectability of each attack."""
    header = (
        "condition",
        "attack",
        "model",
        "damage",
        "damage_half_95",
        "auc",
        "auc_half_95",
        "worst",
    )
    rows = []
    estimates = (
        _estimates([attack.measured[name] for attack in attacks]) for name in ("damage", "auc")
    )
    for attack, damage, auc in zip(attacks, *estimates, strict=True):
        if not np.isnan([damage.mean, auc.mean]).any():
            rows.append((*_name(attack), *damage[:2], *auc[:2], _is_worst(attack, cases)))
    return Table(header, rows)


def _mean(values: Floats) -> float:
    """Return the mean over seeds and games."""
    return float(mean_or_nan(values.ravel(), axis=0))


def _estimates(values: Sequence[Floats]) -> list[Estimate]:
    """Return means over seeds and games, (S, G) each, with half their intervals; all show how much
    seeds differ.
    """
    shapes = np.array([value.shape for value in values] or [(1, 1)])
    table = np.full(
        (len(values), *shapes.max(axis=0)), np.nan
    )  # conditions differ in the number of games
    for place, value in zip(table, values, strict=True):
        place[:, : value.shape[1]] = value
    return over_seeds(table, len(values)).estimates if values else []
