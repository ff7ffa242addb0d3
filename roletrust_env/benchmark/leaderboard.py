"""The leaderboard: for every trust model the worst case over all attacks, chosen on some games and measured on others.

A condition is a scenario, a track and a share. In each the worst case is the attack that leaves consumers the least
utility in the games for choosing, over all rungs but those that know more than an attacker has in life. What counts is
its utility in the other games; and never less than going to any provider blindly would have brought in them, for that a
consumer can always do. A model that ignores ratings has just that everywhere, and is last.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmark.schema import AttackResult
from roletrust_env.benchmark.store import StoredCell
from roletrust_env.benchmark.suite import OPEN, Suite
from roletrust_env.metrics.confidence import Estimate, over_games
from roletrust_env.metrics.score import mean_or_nan

Floats = npt.NDArray[np.float64]

_RESAMPLES = 2000
_DIGITS = 9
"""Digits in which two means must differ; the others are rounding."""


class Condition(NamedTuple):
    """The place in which a model is attacked.

    Attributes:
        scenario: Name of the scenario in the suite.
        track: Name of the track in the suite.
        share: Share of compromised agents.
    """

    scenario: str
    track: str
    share: float

    @property
    def words(self) -> str:
        """The condition in words."""
        share = f" {self.share:.0%}" if self.share else ""
        return f"{self.scenario}, {self.track}{share}"


class AttackScores(NamedTuple):
    """What one attack did to one model in one condition.

    Attributes:
        model: its name.
        condition: where.
        attack: its name.
        rung: that found it.
        words: what it is.
        chosen: utility in the games for choosing, of all seeds one after the other, (G,).
        measured: what was measured in the other games, (G,) each, by the names of `play.MEASURED`.
        by_round: utility in each round of these from the second on, the mean over them, (T - 1,).
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
        """What counts: utility, and in the mean never less than going blindly, (G,)."""
        got, blind = self.measured["utility"], self.measured["blind"]
        return got if np.nanmean(got) >= np.nanmean(blind) else blind


class LeaderboardRow(NamedTuple):
    """A line of the leaderboard; each number with half its 95% interval over the games.

    Attributes:
        rank: from 1.
        model: its name.
        clean: utility while everybody is honest, the mean over the tracks on which nobody is compromised.
        worst: utility in the worst case, the mean over the conditions.
        open_worst: the same where rungs that know more count, too.
        damage: what the honest lost of their trust in the worst case.
        false_alarms: share of the honest taken for attackers while everybody is honest.
        detection: AUC in the worst case.
        holds: probability that the rank is the same on new games.
        missing: Cells that failed, wholly or in part, or are not played yet.
        worst_attack: Name of the attack that leaves the least utility in any condition; empty if none was played.
        worst_condition: The condition in words.
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
        """It as plain values, see `HEADER`."""
        numbers = [value for estimate in self[2:8] for value in estimate[:2]]
        return [self.rank, self.model, *numbers, *self[8:]]


HEADER = (
    "rank",
    "model",
    *(f"{name}{end}" for name in LeaderboardRow._fields[2:8] for end in ("", "_half_95")),
    *LeaderboardRow._fields[8:],
)
"""Of the leaderboard as a table."""


def attack_scores(kept: Iterable[StoredCell]) -> list[AttackScores]:
    """All attacks of a run, those of several seeds as one."""
    found: dict[tuple[str, Condition, str, str], list[AttackResult]] = {}
    for cell, done in kept:
        for row in done.rows:
            where = Condition(cell.scenario, cell.track, cell.share)
            found.setdefault((cell.model, where, row.attack, cell.rung), []).append(row)
    return [
        AttackScores(
            model,
            where,
            attack,
            rung,
            "; ".join(dict.fromkeys(row.words for row in rows)),
            np.concatenate([numbers(row.chosen["utility"]) for row in rows]),
            {name: np.concatenate([numbers(row.measured[name]) for row in rows]) for name in rows[0].measured},
            mean_or_nan(np.stack([numbers(row.by_round) for row in rows]), axis=0),
        )
        for (model, where, attack, rung), rows in found.items()
    ]


def worst(
    attacks: Iterable[AttackScores], knowing: frozenset[str] = frozenset()
) -> dict[tuple[str, Condition], AttackScores]:
    """The worst case of every model in every condition: the least utility in the games for choosing.

    Args:
        attacks: all there are.
        knowing: rungs among `OPEN` that count, too.
    """
    found: dict[tuple[str, Condition], AttackScores] = {}
    for one in attacks:
        if one.rung in OPEN - knowing:
            continue
        key = one.model, one.condition
        if key not in found or _least(one.chosen) < _least(found[key].chosen):
            found[key] = one
    return found


def leaderboard_rows(
    suite: Suite,
    stored: Sequence[StoredCell],
    models: Sequence[str],
    cells_each: int,
    attacks: Sequence[AttackScores] | None = None,
) -> list[LeaderboardRow]:
    """Return the leaderboard, the best model first. Models that tie share a rank.

    Args:
        suite: Suite of the run.
        stored: Cells of the run.
        models: Models that are ranked.
        cells_each: Number of cells of each model.
        attacks: Scores of the attacks in the cells, if they are known already.
    """
    attacks = attack_scores(stored) if attacks is None else attacks
    honest = {name for name, track in suite.tracks.items() if not track.roles}
    closed, opened = worst(attacks), worst(attacks, OPEN)
    rows, games = [], {}
    for model in models:
        mine = [one for (name, _), one in closed.items() if name == model]
        calm = [one for one in mine if one.condition.track in honest]
        struck = [one for one in mine if one.condition.track not in honest]
        known = [one for (name, where), one in opened.items() if name == model and where.track not in honest]
        played = sum(cell.model == model and not done.failed for cell, done in stored)
        games[model] = _over_conditions(one.utility for one in struck)
        lowest = min(struck, key=lambda one: _least(one.utility), default=None)
        rows.append(
            LeaderboardRow(
                0,
                model,
                _estimate(one.measured["utility"] for one in calm),
                _estimate(one.utility for one in struck),
                _estimate(one.utility for one in known),
                _estimate(one.measured["damage"] for one in struck),
                _estimate(one.measured["false_alarms"] for one in calm),
                _estimate(one.measured["auc"] for one in struck),
                np.nan,
                cells_each - played,
                "" if lowest is None else lowest.attack,
                "" if lowest is None else lowest.condition.words,
            )
        )
    keys = {row.model: (row.missing > 0, *_order(row.worst.mean, row.clean.mean)) for row in rows}
    rows.sort(key=lambda row: keys[row.model])
    ranks = _shared_ranks([keys[row.model] for row in rows])
    holds = _holding([games[row.model] for row in rows if not row.missing])
    return [
        row._replace(rank=rank, holds=holds[k] if k < len(holds) else np.nan)
        for k, (row, rank) in enumerate(zip(rows, ranks, strict=True))
    ]


def _least(utility: Floats) -> float:
    """Return the mean utility by which the worst case is chosen; where it is undefined, any other is worse."""
    mean = float(mean_or_nan(utility, axis=0))
    return np.inf if np.isnan(mean) else mean


def _shared_ranks(keys: Sequence[Any]) -> list[int]:
    """Return the rank of each of some sorted keys; equal keys share the rank of the first one."""
    return [keys.index(key) + 1 for key in keys]


def _order(worst: float, clean: float) -> tuple[float, float]:
    """Sorts the best first, and what is undefined last; what differs by rounding only is equal."""
    return tuple(np.inf if np.isnan(x) else -round(x, _DIGITS) for x in (worst, clean))  # type: ignore[return-value]


def _holding(games: Sequence[Floats]) -> list[float]:
    """The probability of each place of a ranking on new games: the share of resamples of the games that keep it.

    All models have the same games, so these are drawn together (a paired bootstrap, Efron and Tibshirani 1993).
    """
    if not games or any(len(row) != len(games[0]) for row in games):
        return [np.nan] * len(games)
    scores = np.stack(games)
    picks = np.random.default_rng(0).integers(0, scores.shape[1], (_RESAMPLES, scores.shape[1]))
    means = np.stack([scores[:, pick].mean(axis=1) for pick in picks]).round(_DIGITS)
    places = (means[:, None, :] > means[:, :, None]).sum(axis=2)  # of each model the number of better ones
    now = scores.mean(axis=1).round(_DIGITS)
    shares = (places == (now[None, :] > now[:, None]).sum(axis=1)).mean(axis=0)
    return [float(share) for share in np.where(np.isnan(now), np.nan, shares)]


def _estimate(of_conditions: Iterable[Floats]) -> Estimate:
    """The mean over conditions and games, and half its interval: over the games, of their means over conditions."""
    mean, half, _ = over_games(_over_conditions(of_conditions))
    return Estimate(float(mean), float(half))


def _over_conditions(rows: Iterable[Floats]) -> Floats:
    """The mean over conditions, for each game; NaN of none."""
    columns = list(rows)
    if not columns:
        return np.full(1, np.nan)
    length = max(map(len, columns))
    padded = [np.pad(row, (0, length - len(row)), constant_values=np.nan) for row in columns]
    return mean_or_nan(np.stack(padded), axis=0)


def numbers(values: Sequence[float | None]) -> Floats:
    """Numbers as they are kept; NaN where there is none."""
    return np.array([np.nan if x is None else x for x in values], np.float64)
