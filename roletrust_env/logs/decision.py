"""Which trust model suits a log, by paired differences: its forecast, and what it keeps under
attack.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from roletrust_env.logs.log import Log
from roletrust_env.metrics.confidence import Interval
from roletrust_env.metrics.resampling import RESAMPLES
from roletrust_env.randomness import generator
from roletrust_env.trust.key_index import Floats, Ints

_HALF = 0.5
"""A model that keeps less of 1 under attack does not resist."""

_NOTHING = Interval(float("nan"), float("nan"), float("nan"))


class Evaluated(NamedTuple):
    """What a model published on a log, for paired comparisons.

    Attributes:
        ratings: Positions of ratings of agents with earlier ones, shape (n,).
        trust: Trust in the agent before the round of each of these, shape (n,).
        kept: What each target keeps under the worst attack of each goal, from 0 to 1, shape
            (goals, targets); None where the log is too small for attacks.
    """

    ratings: Ints
    trust: Floats
    kept: Floats | None


class Standing(NamedTuple):
    """A model on a log.

    Attributes:
        name: Name of the model.
        forecast: Correlation r of trust with the next ratings of agents that have earlier ones.
        behind: Paired difference of r to that of the best model; 0 for the best.
        kept: Mean of what targets keep under attack.
    """

    name: str
    forecast: Interval
    behind: Interval
    kept: Interval


class Decision(NamedTuple):
    """The models of a log, the best forecast first.

    Attributes:
        standings: The models.
        recommended: Name of the recommended model; empty where none is.
        reason: Why, in a sentence or two.
    """

    standings: list[Standing]
    recommended: str
    reason: str


def decide(log: Log, models: Mapping[str, Evaluated], seed: int = 0) -> Decision | None:
    """Return which model suits a log; None without a forecast.

    Differences are paired: all models are compared in the same resamples, which draw raters and
    ratees both (the pigeonhole bootstrap of Owen, 2007), or targets of attacks. A model is
    recommended if its forecast is significantly better than that of all others, or if, of those
    that are not significantly worse than the best, it keeps significantly more under attack than
    all others, and at least half. Intervals are 95% for each pair, not corrected for their number.

    Args:
        log: Log.
        models: What each model published, by name.
        seed: Random seed of the resamples.
    """
    names, value, draws = _forecasts(log, models, seed)
    if not names:
        return None
    order = np.argsort(-value, kind="stable")
    best = int(order[0])
    kept = [_kept(models[name], seed) for name in names]
    standings = [
        Standing(
            names[k],
            _interval(float(value[k]), draws[:, k]),
            _interval(float(value[k] - value[best]), draws[:, k] - draws[:, best]),
            _NOTHING if kept[k] is None else _interval(float(kept[k][0]), kept[k][1:]),
        )
        for k in order.tolist()
    ]
    good = [
        k
        for k, standing in zip(order.tolist(), standings, strict=True)
        if k == best or standing.behind.high >= 0
    ]
    if len(names) == 1:
        return Decision(standings, "", "There is one model with a forecast.")
    reason = "Its forecast is significantly better than all others."
    if len(good) > 1:
        near = ", ".join(names[k] for k in good)
        reason = f"Not significantly different from the best forecast: {near}."
    found = {k: one for k in good if (one := kept[k]) is not None}
    if len(found) < len(good):
        return Decision(standings, names[best] if len(good) == 1 else "", reason)
    firm = max(good, key=lambda k: float(found[k][0]))
    if found[firm][0] < _HALF:
        reason += f" None resists: at most {found[firm][0]:.2f} of 1 is kept under attack."
    if len(good) == 1 or found[firm][0] < _HALF:
        return Decision(standings, names[best] if len(good) == 1 else "", reason)
    others = (found[firm][1:] - found[k][1:] for k in good if k != firm)
    if not all(_interval(0.0, other).low > 0 for other in others):
        return Decision(standings, "", reason)
    reason += f" Of these, {names[firm]} keeps significantly more under attack."
    return Decision(standings, names[firm], reason)


def _forecasts(
    log: Log, models: Mapping[str, Evaluated], seed: int
) -> tuple[list[str], Floats, Floats]:
    """Return the models whose trust varies, their correlations, shape (M,), and those in resamples
    of raters and ratees, shape (B, M).
    """
    names = [
        name
        for name, model in models.items()
        if np.ptp(model.trust) > 0 and np.ptp(log.values[model.ratings]) > 0
    ]
    if not names:
        return [], np.zeros(0), np.zeros((0, 0))
    places = models[names[0]].ratings
    trust = np.stack([models[name].trust for name in names])
    values, rng = log.values[places], generator(seed)
    sides = [
        np.unique(side, return_inverse=True)[1] for side in (log.raters[places], log.ratees[places])
    ]
    sizes = [int(side.max()) + 1 for side in sides]
    draws = np.empty((RESAMPLES, len(names)))
    for b in range(RESAMPLES):
        weights = np.ones(len(values))
        for side, size in zip(sides, sizes, strict=True):
            weights *= np.bincount(rng.integers(0, size, size), minlength=size)[side]
        draws[b] = _correlations(trust, values, weights)
    return names, _correlations(trust, values, np.ones(len(values))), draws


def _correlations(trust: Floats, values: Floats, weights: Floats) -> Floats:
    """Return the weighted correlation of each row with values, shape (M,)."""
    total = weights.sum()
    x = trust - (trust @ weights / total)[:, None]
    y = values - values @ weights / total
    spread = np.sqrt((x * x) @ weights * ((y * y) @ weights))
    with np.errstate(invalid="ignore", divide="ignore"):
        found: Floats = (x * y) @ weights / spread
    return found


def _kept(model: Evaluated, seed: int) -> Floats | None:
    """Return the mean of what targets keep, and it in resamples of targets, shape (1 + B,)."""
    if model.kept is None:
        return None
    targets = model.kept.shape[1]
    draws = generator(seed).integers(0, targets, (RESAMPLES, targets))
    each = model.kept.mean(axis=0)
    return np.append(each.mean(), each[draws].mean(axis=1))


def _interval(value: float, draws: Floats) -> Interval:
    """Return a value with the 95% interval of its resamples."""
    low, high = np.nanpercentile(draws, [2.5, 97.5])
    return Interval(value, float(low), float(high))
