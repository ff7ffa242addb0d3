"""A log of ratings as the rounds of a team, of which `infer_scenario` makes a scenario."""

from typing import Any

import numpy as np

from roletrust_env.logs.log import Log
from roletrust_env.logs.log_rounds import log_rounds
from roletrust_env.metrics.score import ratio
from roletrust_manager.dds.recorded_team import TeamObservation
from roletrust_manager.team import Team

_MOST = 10_000_000  # numbers of all rounds


def observe_log(log: Log, every: float) -> TeamObservation:
    """Return the rounds of a log, such as the export of a trust manager. A name is one agent in
    both roles.

    Several ratings of one agent by another in a round are their mean. A provider serves in the
    rounds in which it is rated; that a rater is silent counts as loss.

    Args:
        log: Log with times.
        every: Length of a round, in the unit of the times, seconds.

    Raises:
        ValueError: The log has no times, less than two rounds, or too many for its agents.
    """
    numbers = log_rounds(log, every)
    raters, i = np.unique(log.raters, return_inverse=True)
    providers, j = np.unique(log.ratees, return_inverse=True)
    shape = int(numbers[-1]) + 1, len(raters), len(providers)
    if shape[0] < 2:
        raise ValueError(f"the log has less than two rounds of {every:g} s")
    if shape[0] * shape[1] * shape[2] > _MOST:
        raise ValueError(
            "the log has {:,} rounds of {:,} raters and {:,} providers: take longer rounds".format(
                *shape
            )
        )
    cells = np.ravel_multi_index((numbers, i, j), shape)
    counts, sums = (
        np.bincount(cells, weights, minlength=np.prod(shape)) for weights in (None, log.values)
    )
    ratings = ratio(sums, counts).reshape(shape)
    team = Team(
        tuple(log.rater_names[k] for k in raters), tuple(log.ratee_names[k] for k in providers)
    )
    sent: Any = ~np.isnan(ratings)
    return TeamObservation(team, round(every * 1e9), ratings, sent, sent.any(axis=1))
