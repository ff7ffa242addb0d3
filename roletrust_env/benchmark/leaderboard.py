"""Leaderboard: the worst case of each trust model over all attacks, chosen in some games and measured in others.

A condition is a scenario, a track and a share. Its worst case is the attack that leaves consumers the least utility in
the games for choosing. Rungs with more knowledge than a real attacker are excluded. The result is the utility in the
games for measuring. It is never less than the utility of a blind choice there, since a consumer can always choose
blindly. A model that ignores ratings has exactly this utility in every condition, and is ranked last.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmark.schema import AttackResult
from roletrust_env.benchmark.store import StoredCell
from roletrust_env.benchmark.suite import WHITE_BOX_RUNGS, Suite
from roletrust_env.metrics.confidence import Estimate, over_games
from roletrust_env.metrics.score import mean_or_nan

Floats = npt.NDArray[np.float64]

_RESAMPLES = 2000
_DIGITS = 9
"""Number of decimal digits in which means are compared. Smaller differences are rounding errors."""


class Condition(NamedTuple):
    """Combination of scenario, track and share in which models are attacked.

    Attributes:
        scenario: Name of the scenario in the suite.
        track: Name of the track in the suite.
        share: Share of compromised agents.
    """

    scenario: str
    track: str
    share: float

    @property
    def description(self) -> str:
        """Short text for tables, such as `market, raters 30%`."""
        share = f" {self.share:.0%}" if self.share else ""
        return f"{self.scenario}, {self.track}{share}"


class AttackScores(NamedTuple):
    """Scores of one attack on one model in one condition.

    Attributes:
        model: Name of the model.
        condition: Condition of the attack.
        attack: Name of the attack.
        rung: Name of the rung that found the attack.
        words: Short description of the attack.
        chosen: Utility in the games for choosing, all seeds concatenated, (G,).
        measured: Scores in the games for measuring, by the names of `MEASURED`, (G,) each.
        by_round: Mean utility over the games for measuring in each round from the second on, (T - 1,).
    """

    model: str
    condition: Condition
    attack: str
    rung: str
    words: str
    chosen: Floats
    measured: Mapping[str, Floats]
    by_round: Floats

    @property
    def utility(self) -> Floats:
        """Utility of the ranking, (G,): that of the choice by trust, or of a blind choice if its mean is higher."""
        by_trust, blind = self.measured["utility"], self.measured["blind"]
        return by_trust if np.nanmean(by_trust) >= np.nanmean(blind) else blind


class LeaderboardRow(NamedTuple):
    """Row of the leaderboard. Each estimate is a mean with half its 95% interval over the games.

    Attributes:
        rank: Rank, which counts from 1.
        model: Name of the model.
        clean: Mean utility over the tracks on which all agents are honest.
        worst: Mean utility of the worst case over the conditions.
        open_worst: Mean utility of the worst case if rungs with more knowledge than a real attacker count, too.
        damage: Loss of trust of honest agents in the worst case.
        false_alarms: Share of honest agents that are classified as attackers while all agents are honest.
        detection: AUC of the detection of attackers in the worst case.
        holds: Probability of the same rank in new games.
        missing: Number of cells that failed, entirely or in part, or that have not been played.
        worst_attack: Name of the attack that leaves the least utility in any condition. Empty if none was played.
        worst_condition: Description of the condition of that attack.
    """

    rank: int
    model: str
    clean: Estimate
    worst: Estimate
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
        numbers = [value for estimate in self[2:8] for value in estimate[:2]]
        return [self.rank, self.model, *numbers, *self[8:]]


HEADER = (
    "rank",
    "model",
    *(f"{name}{end}" for name in LeaderboardRow._fields[2:8] for end in ("", "_half_95")),
    *LeaderboardRow._fields[8:],
)
"""Column names of the leaderboard as a table."""


def attack_scores(stored: Iterable[StoredCell]) -> list[AttackScores]:
    """Return the scores of all attacks of a run. The games of several seeds are concatenated.

    Args:
        stored: Cells of the run with their results.
    """
    groups: dict[tuple[str, Condition, str, str], list[AttackResult]] = {}
    for cell, result in stored:
        for row in result.rows:
            condition = Condition(cell.scenario, cell.track, cell.share)
            groups.setdefault((cell.model, condition, row.attack, cell.rung), []).append(row)
    return [
        AttackScores(
            model,
            condition,
            attack,
            rung,
            "; ".join(dict.fromkeys(row.words for row in rows)),
            np.concatenate([as_array(row.chosen["utility"]) for row in rows]),
            {name: np.concatenate([as_array(row.measured[name]) for row in rows]) for name in rows[0].measured},
            mean_or_nan(np.stack([as_array(row.by_round) for row in rows]), axis=0),
        )
        for (model, condition, attack, rung), rows in groups.items()
    ]


def worst_cases(
    attacks: Iterable[AttackScores], included: frozenset[str] = frozenset()
) -> dict[tuple[str, Condition], AttackScores]:
    """Return the worst case of each model and condition, the attack with the least utility in the games for choosing.

    Args:
        attacks: Scores of all attacks.
        included: Rungs of `WHITE_BOX_RUNGS` that count.
    """
    cases: dict[tuple[str, Condition], AttackScores] = {}
    for one in attacks:
        if one.rung in WHITE_BOX_RUNGS - included:
            continue
        key = one.model, one.condition
        if key not in cases or _least(one.chosen) < _least(cases[key].chosen):
            cases[key] = one
    return cases


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
    attacks = attack_scores(stored) if attacks is None else attacks
    honest = {name for name, track in suite.tracks.items() if not track.roles}
    black_box, white_box = worst_cases(attacks), worst_cases(attacks, WHITE_BOX_RUNGS)
    rows, games = [], {}
    for model in models:
        mine = [one for (name, _), one in black_box.items() if name == model]
        clean = [one for one in mine if one.condition.track in honest]
        attacked = [one for one in mine if one.condition.track not in honest]
        with_white_box = [
            one for (name, where), one in white_box.items() if name == model and where.track not in honest
        ]
        complete = sum(cell.model == model and not result.failed for cell, result in stored)
        games[model] = _over_conditions(one.utility for one in attacked)
        lowest = min(attacked, key=lambda one: _least(one.utility), default=None)
        rows.append(
            LeaderboardRow(
                0,
                model,
                _estimate(one.measured["utility"] for one in clean),
                _estimate(one.utility for one in attacked),
                _estimate(one.utility for one in with_white_box),
                _estimate(one.measured["damage"] for one in attacked),
                _estimate(one.measured["false_alarms"] for one in clean),
                _estimate(one.measured["auc"] for one in attacked),
                np.nan,
                cells_each - complete,
                "" if lowest is None else lowest.attack,
                "" if lowest is None else lowest.condition.description,
            )
        )
    keys = {row.model: (row.missing > 0, *_order(row.worst.mean, row.clean.mean)) for row in rows}
    rows.sort(key=lambda row: keys[row.model])
    ranks = _shared_ranks([keys[row.model] for row in rows])
    holds = _rank_stability([games[row.model] for row in rows if not row.missing])
    return [
        row._replace(rank=rank, holds=holds[k] if k < len(holds) else np.nan)
        for k, (row, rank) in enumerate(zip(rows, ranks, strict=True))
    ]


def _least(utility: Floats) -> float:
    """Return the mean utility by which the worst case is chosen; where it is undefined, any other is worse."""
    mean = float(mean_or_nan(utility, axis=0))
    return np.inf if np.isnan(mean) else mean


def _shared_ranks(keys: Sequence[Any]) -> list[int]:
    """Return the ranks of sorted keys. Equal keys share the rank of the first one."""
    return [keys.index(key) + 1 for key in keys]


def _order(worst: float, clean: float) -> tuple[float, float]:
    """Return a sort key: the best first, undefined values last, and equal keys where only rounding differs."""
    return tuple(np.inf if np.isnan(x) else -round(x, _DIGITS) for x in (worst, clean))  # type: ignore[return-value]


def _rank_stability(games: Sequence[Floats]) -> list[float]:
    """Return the probability of each rank in new games: the share of resamples of the games with the same rank.

    All models play the same games, so the games are resampled jointly (paired bootstrap, Efron and Tibshirani 1993).
    """
    if not games or any(len(row) != len(games[0]) for row in games):
        return [np.nan] * len(games)
    scores = np.stack(games)
    picks = np.random.default_rng(0).integers(0, scores.shape[1], (_RESAMPLES, scores.shape[1]))
    means = np.stack([scores[:, pick].mean(axis=1) for pick in picks]).round(_DIGITS)
    better = (means[:, None, :] > means[:, :, None]).sum(axis=2)  # number of better models for each model
    current = scores.mean(axis=1).round(_DIGITS)
    shares = (better == (current[None, :] > current[:, None]).sum(axis=1)).mean(axis=0)
    return [float(share) for share in np.where(np.isnan(current), np.nan, shares)]


def _estimate(rows: Iterable[Floats]) -> Estimate:
    """Return the mean over conditions and games, with half its interval over the games."""
    mean, half, _ = over_games(_over_conditions(rows))
    return Estimate(float(mean), float(half))


def _over_conditions(rows: Iterable[Floats]) -> Floats:
    """Return the mean over conditions for each game. It is NaN without a condition."""
    columns = list(rows)
    if not columns:
        return np.full(1, np.nan)
    length = max(map(len, columns))
    padded = [np.pad(row, (0, length - len(row)), constant_values=np.nan) for row in columns]
    return mean_or_nan(np.stack(padded), axis=0)


def as_array(values: Sequence[float | None]) -> Floats:
    """Return stored numbers as an array. None becomes NaN."""
    return np.array([np.nan if x is None else x for x in values], np.float64)
