"""Which trust model suits a log: one that forecasts about as well as the best, and keeps much under
attack.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from roletrust_env.metrics.confidence import Interval

Measures = Mapping[tuple[str, str], Interval]
"""Measures of a model by protocol and name, as `roletrust rate --compare` has them."""

FORECAST = "rated before", "r"
"""Measure by which forecasts compare."""

_NEAR = 0.05
"""Difference of what models keep under attack, below which the forecast decides."""
_ATTACK, _GOALS = "attack", ("sink", "lift")


class Advice(NamedTuple):
    """A recommendation.

    Attributes:
        model: Name of the recommended model.
        best: Name of the model with the best forecast.
        forecast: Forecast of the recommended model, see `FORECAST`.
        kept: What it keeps under attack, see `kept`; NaN where nothing was attacked.
        most: The most that a model with such a forecast keeps.
    """

    model: str
    best: str
    forecast: Interval
    kept: float
    most: float

    @property
    def words(self) -> str:
        """The recommendation and its reason, in two sentences."""
        place = (
            "is the best"
            if self.model == self.best
            else f"lies in the interval of the best, {self.best}"
        )
        reason = f"Its forecast (r {self.forecast.value:.2f}) {place}"
        if not np.isnan(self.kept):
            reason += (
                f", and it keeps {self.kept:.2f} of 1 under attack; no model with such a "
                "forecast keeps more than "
            )
            reason += f"{self.most:.2f}"
        return f"Recommended: {self.model}. {reason}."


def advise(models: Mapping[str, Measures]) -> Advice | None:
    """Return which model suits a log; None without forecasts.

    Of the models with a forecast inside the interval of the best one, and of these the ones that
    keep about the most under attack, it is the one with the best forecast.
    """
    found = {name: one[FORECAST].value for name, one in models.items() if FORECAST in one}
    found = {name: value for name, value in found.items() if not np.isnan(value)}
    if not found:
        return None
    best = max(found, key=lambda name: found[name])
    limit = models[best][FORECAST].low
    good = [name for name, value in found.items() if value >= limit or name == best]
    left = {name: one.value if (one := kept(models[name])) else np.nan for name in good}
    most = float(np.fmax.reduce(list(left.values())))
    near = [name for name, value in left.items() if np.isnan(most) or value >= most - _NEAR]
    model = max(near, key=lambda name: found[name])
    return Advice(model, best, models[model][FORECAST], left[model], most)


def kept(measures: Mapping[tuple[str, str], Interval]) -> Interval | None:
    """Return what a trust model keeps on a log under the worst attack with each goal, the mean over
    both goals.

    With the goal `sink` it keeps the percentile of the good providers after the attack, with `lift`
    what the newcomers lack of the top: 1 if no attack moves its targets.

    Args:
        measures: Measures of the model by protocol and name, as `roletrust rate --compare` has
            them.

    Returns:
        The mean with its interval; None where a goal was not attacked.
    """
    by_goal: dict[str, list[Interval]] = {}
    for (protocol, what), value in measures.items():
        goal, _, accounts = what.partition(", ")
        if protocol == _ATTACK and goal in _GOALS and accounts != "honest":
            left = (
                value
                if goal == "sink"
                else Interval(1 - value.value, 1 - value.high, 1 - value.low)
            )
            by_goal.setdefault(goal, []).append(left)
    complete = len(by_goal) == len(_GOALS)
    return (
        Interval(*np.mean([min(attacks) for attacks in by_goal.values()], axis=0).tolist())
        if complete
        else None
    )
