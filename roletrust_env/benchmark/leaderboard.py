"""Leaderboard: the trust models in the order of their mean score in the worst case of each condition.

On the scale of utility a score is never less than that of a blind choice, since a consumer can always choose blindly. A
model that ignores ratings has exactly this utility in every condition, and is ranked last. On the scale of skill a
blind choice is 0.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmark.store import StoredCell
from roletrust_env.benchmark.suite import WHITE_BOX_RUNGS, Suite
from roletrust_env.benchmark.worst_case import AttackScores, attack_scores, least_mean, worst_cases
from roletrust_env.metrics.confidence import Estimate, over_games
from roletrust_env.metrics.score import mean_or_nan

Floats = npt.NDArray[np.float64]

_RESAMPLES = 2000
_DIGITS = 9
"""Number of decimal digits in which means are compared. Smaller differences are rounding errors."""


class LeaderboardRow(NamedTuple):
    """Row of the leaderboard. Each estimate is a mean with half its 95% interval over the games.

    Attributes:
        rank: Rank, which counts from 1.
        model: Name of the model.
        clean: Mean score over the tracks on which all agents are honest, on the scale of the suite.
        worst: Mean score of the worst case over the conditions.
        open_worst: Mean score of the worst case if rungs with more knowledge than a real attacker count, too.
        damage: Loss of trust of honest agents in the worst case.
        false_alarms: Share of honest agents that are classified as attackers while all agents are honest.
        detection: AUC of the detection of attackers in the worst case.
        holds: Probability of the same rank in another run with new games.
        missing: Number of cells that failed, entirely or in part, or that have not been played.
        worst_attack: Name of the attack that leaves the least score in any condition. Empty if none was played.
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
    attacks = attack_scores(stored, suite.score) if attacks is None else attacks
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
        games[model] = _over_conditions(one.score for one in attacked)
        lowest = min(attacked, key=lambda one: least_mean(one.score), default=None)
        rows.append(
            LeaderboardRow(
                0,
                model,
                _estimate(one.score for one in clean),
                _estimate(one.score for one in attacked),
                _estimate(one.score for one in with_white_box),
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


def _shared_ranks(keys: Sequence[Any]) -> list[int]:
    """Return the ranks of sorted keys. Equal keys share the rank of the first one."""
    return [keys.index(key) + 1 for key in keys]


def _order(worst: float, clean: float) -> tuple[float, float]:
    """Return a sort key: the best first, undefined values last, and equal keys where only rounding differs."""
    return tuple(np.inf if np.isnan(x) else -round(x, _DIGITS) for x in (worst, clean))  # type: ignore[return-value]


def _rank_stability(games: Sequence[Floats]) -> list[float]:
    """Return the probability of each rank in another run with new games.

    All models play the same games, so the games are resampled jointly (paired bootstrap, Efron and Tibshirani 1993).
    Both runs are noisy. The best models of this run owe a part of their lead to luck, so means are expected nearer to
    each other in the other run, the more so the noisier they are (empirical Bayes, Morris 1983); and the other run adds
    noise of its own. Searches would find other attacks there, which is not counted.
    """
    if not games or any(len(row) != len(games[0]) for row in games):
        return [np.nan] * len(games)
    scores = np.stack(games)
    picks = np.random.default_rng(0).integers(0, scores.shape[1], (_RESAMPLES, scores.shape[1]))
    current = scores.mean(axis=1)
    noise = np.stack([scores[:, pick].mean(axis=1) for pick in picks]) - current
    known = ~np.isnan(current)
    kept = _reliability(current[known], noise[:, known])
    middle = float(mean_or_nan(current, axis=0))
    expected = middle + kept * (current - middle)
    means, current = (expected + (1 + kept) ** 0.5 * noise).round(_DIGITS), current.round(_DIGITS)
    better = (means[:, None, :] > means[:, :, None]).sum(axis=2)  # number of better models for each model
    shares = (better == (current[None, :] > current[:, None]).sum(axis=1)).mean(axis=0)
    return [float(share) for share in np.where(known, shares, np.nan)]


def _reliability(means: Floats, noise: Floats) -> float:
    """Return the share of the variance between means that is not noise, in [0, 1].

    Args:
        means: Means of M models, shape (M,).
        noise: Noise of the means in R resamples, shape (R, M). What all models have in common is no difference.
    """
    if len(means) < 2 or not means.var() > 0:
        return 1.0
    own = noise - noise.mean(axis=1, keepdims=True)
    return max(0.0, 1.0 - float(own.var(axis=0).sum() / (len(means) - 1) / means.var(ddof=1)))


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
