"""What a report tells, as tables: the page shows them, and each is a CSV file beside it."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from experiments.benchmark.board import HEADER, Attacked, Condition, Standing, attacked, standings, worst
from experiments.benchmark.caveats import caveats
from experiments.benchmark.cells import cells, models
from experiments.benchmark.store import Store
from experiments.benchmark.suite import Suite
from experiments.naming import check_installed
from experiments.results.confidence import over_games
from roletrust_env.trust.model import registry as trust_models

_POINTS = 40
"""Of a curve at the most; the rounds of longer games are averaged a few at a time."""

Floats = npt.NDArray[np.float64]


class Table(NamedTuple):
    """Rows of plain values under a header."""

    header: tuple[str, ...]
    rows: list[tuple[Any, ...]]

    def columns(self) -> dict[str, list[Any]]:
        """The values of each column."""
        return {name: [row[k] for row in self.rows] for k, name in enumerate(self.header)}


class Content(NamedTuple):
    """What was found.

    Attributes:
        suite: that was played.
        software: that it was played with.
        standings: the leaderboard, the best first.
        tables: by the name of what shows them.
        warnings: what a reader should know.
    """

    suite: Suite
    software: dict[str, Any]
    standings: list[Standing]
    tables: dict[str, Table]
    warnings: list[str]

    @property
    def order(self) -> list[str]:
        """The models, the best first."""
        return [row.model for row in self.standings]


def read(store: Store, *, allow_code: bool = False) -> Content:
    """What the file of a run holds.

    Args:
        store: the file.
        allow_code: whether it may name trust models that are not installed.

    Raises:
        ValueError: it is of a suite for learners, it names what it may not, or not one attack of it has been played.
    """
    if not isinstance(suite := store.suite, Suite):
        raise ValueError(f"{store.path} is of a suite for {suite.kind}; a report is on one for robustness")
    kept, names = store.all(), models(suite)
    if not allow_code:
        check_installed(trust_models, names)
    attacks = attacked(kept)
    if not attacks:
        raise ValueError(f"{store.path} holds no attack that was played; let `roletrust benchmark` go on first")
    rows = standings(suite, kept, names, len(cells(suite)) // len(names))
    place = {row.model: row.rank for row in rows}
    attacks.sort(key=lambda one: (place[one.model], one.condition, one.attack))
    cases = worst(attacks)
    tables = {
        "leaderboard": Table(HEADER, [tuple(row.line()) for row in rows]),
        "heatmap": _heatmap(suite, attacks, cases),
        "curves": _curves(suite, attacks, cases),
        "breakdown": _breakdown(suite, cases),
        "tradeoff": _tradeoff(attacks, cases),
    }
    return Content(suite, store.software, rows, tables, caveats(suite, kept, attacks, names))


def called(condition: Condition) -> str:
    """A condition in words."""
    share = f" {condition.share:.0%}" if condition.share else ""
    return f"{condition.scenario}, {condition.track}{share}"


_Worst = dict[tuple[str, Condition], Attacked]


def _is_worst(one: Attacked, cases: _Worst) -> bool:
    return cases.get((one.model, one.condition)) is one


def _heatmap(suite: Suite, attacks: Sequence[Attacked], cases: _Worst) -> Table:
    """Utility under each attack; in each condition those first that do most harm to all models."""
    struck = [one for one in attacks if suite.tracks[one.condition.track].roles]
    harm: dict[tuple[Condition, str], list[float]] = {}
    for one in struck:
        harm.setdefault((one.condition, one.attack), []).append(_mean(one.measured["utility"])[0])
    struck.sort(key=lambda one: (one.condition, np.nanmean(harm[one.condition, one.attack])))
    header = ("condition", "attack", "model", "rung", "utility", "utility_half_95", "blind", "worst")
    return Table(header, [(*_name(one), one.rung, *_utility(one), _is_worst(one, cases)) for one in struck])


def _name(one: Attacked) -> tuple[str, str, str]:
    return called(one.condition), one.attack, one.model


def _utility(one: Attacked) -> tuple[float, float, float]:
    return *_mean(one.measured["utility"]), _mean(one.measured["blind"])[0]


def _curves(suite: Suite, attacks: Sequence[Attacked], cases: _Worst) -> Table:
    """Utility from round to round; the conditions in which all are honest come last."""
    header = ("condition", "attack", "model", "worst", "rounds", "utility")
    rows = []
    for one in sorted(attacks, key=lambda one: not suite.tracks[one.condition.track].roles):
        if len(one.by_round):
            rounds, utility = _few(one.by_round)
            rows.append((*_name(one), _is_worst(one, cases), rounds, utility))
    return Table(header, rows)


def _few(by_round: Floats) -> tuple[list[float], list[float]]:
    """A curve with not too many points, and the rounds, counted from 1, in the middle of which each stands."""
    many = -(-len(by_round) // _POINTS)
    parts = np.array_split(by_round, range(many, len(by_round), many))
    middles = np.array_split(np.arange(len(by_round)) + 2.0, range(many, len(by_round), many))
    return [float(part.mean()) for part in middles], [_mean(part)[0] for part in parts]


def _breakdown(suite: Suite, cases: _Worst) -> Table:
    """Utility in the worst case by the share of the compromised, from 0 where everybody is honest in the same world."""
    header = ("where", "share", "model", "attack", "utility", "utility_half_95")
    rows = []
    for (model, where), one in cases.items():
        for scenario, track in _stand_for(suite, where):
            mean, half = _mean(one.utility)
            rows.append((f"{scenario}, {track}", where.share, model, one.attack, mean, half))
    rows.sort(key=lambda row: (row[0], row[2], row[1]))
    return Table(header, rows)


def _stand_for(suite: Suite, where: Condition) -> Iterator[tuple[str, str]]:
    """The tracks of which a condition is a point: its own; if all are honest there, those that change the same."""
    mine = suite.tracks[where.track]
    for name, track in suite.tracks.items():
        if track.roles and (name == where.track or (not mine.roles and track.set == mine.set)):
            yield where.scenario, name


def _tradeoff(attacks: Sequence[Attacked], cases: _Worst) -> Table:
    """What an attack costs the honest, and how well it is told apart."""
    header = ("condition", "attack", "model", "damage", "damage_half_95", "auc", "auc_half_95", "worst")
    rows = []
    for one in attacks:
        damage, auc = _mean(one.measured["damage"]), _mean(one.measured["auc"])
        if not np.isnan([damage[0], auc[0]]).any():
            rows.append((*_name(one), *damage, *auc, _is_worst(one, cases)))
    return Table(header, rows)


def _mean(values: Floats) -> tuple[float, float]:
    """A mean and half its interval; over games."""
    mean, half, _ = over_games(values)
    return float(mean), float(half)
