"""Trust as a forecast on a log of real ratings: trust before a round against the ratings of the
round.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.logs.log import Log, TooSmallError
from roletrust_env.logs.log_rounds import log_rounds, play_round
from roletrust_env.logs.rounds import spans
from roletrust_env.metrics.confidence import Interval
from roletrust_env.metrics.resampling import auc, correlation, interval
from roletrust_env.trust.key_index import Floats, Ints
from roletrust_env.trust.run import make_run


class Forecasts(NamedTuple):
    """Trust before the round of each rating of an agent with ratings in earlier rounds.

    Attributes:
        ratings: Positions of these ratings in the log, shape (n,).
        trust: Trust in the agent before the round, shape (n,).
    """

    ratings: Ints
    trust: Floats


def forecasts(model: Any, log: Log, every: float) -> Forecasts:
    """Return what a model forecasts before each round of a log, see `Forecasts`.

    All agents of the log are present from the first round on.

    Args:
        model: Trust model.
        log: Log with times.
        every: Length of a round in seconds.

    Raises:
        TooSmallError: No agent has ratings in two rounds.
        MemoryError: The model does not fit, see `make_run`.
    """
    numbers = log_rounds(log, every)
    run, trust = make_run(model, log.shape, one_role=not log.same_agents), np.zeros(len(numbers))
    for number, part in spans(numbers):
        trust[part] = run.provider_trust[log.ratees[part]]
        play_round(run, number, log.raters[part], log.ratees[part], log.values[part])
    first = np.zeros(log.shape[1], np.int64)
    first[log.ratees[::-1]] = numbers[::-1]  # the last assignment stays
    known = np.flatnonzero(numbers > first[log.ratees])
    if not len(known):
        raise TooSmallError(f"with rounds of {every:g} s no agent has ratings in two rounds")
    return Forecasts(known, trust[known])


def forecast_measures(found: Forecasts, log: Log, seed: int = 0) -> dict[str, Interval]:
    """Return how well trust forecasts ratings.

    - `r`: Pearson's correlation of trust and rating, as Kumar et al. (2016) report it. It does not
      have an interval here: `compare` resamples all models together.
    - `auc`: area under the ROC curve for negative ratings, those below the middle of the scale. Its
      interval resamples ratees.

    Args:
        found: Trust before the rounds.
        log: The same log.
        seed: Random seed of the resamples.
    """
    values, groups = log.values[found.ratings], log.ratees[found.ratings]
    bad = (values < 0.5).astype(np.float64)
    return {
        "r": Interval(correlation(found.trust, values)(np.ones(len(values))), math.nan, math.nan),
        "auc": interval(auc(found.trust, bad), groups, seed),
    }
