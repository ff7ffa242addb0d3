"""What makes the trust in an agent: its raters, their ratings, and its trust without them."""

from collections.abc import Callable
from difflib import get_close_matches
from typing import Any, NamedTuple

import numpy as np

from roletrust_baselines.logs.rounds import played
from roletrust_env.data.log import RatingLog
from roletrust_env.trust.key_index import Floats, Ints

MOST = 10
"""Number of raters without whom trust is computed again."""

_MANY = 10_000  # names among which one is suggested


class Reason(NamedTuple):
    """A rater of the agent.

    Attributes:
        rater: Place of the rater.
        tor: Trust in the rater.
        ratings: Its ratings of the agent on [0, 1], in the order of time.
        without: Trust in the agent without these ratings.
        rank: Rank of the agent without them, 1 for the most trusted.
    """

    rater: int
    tor: float
    ratings: Floats
    without: float
    rank: int


class Explanation(NamedTuple):
    """Trust in an agent, and what makes it.

    Attributes:
        trust: Trust in the agent.
        rank: Its rank by trust among the rated agents, 1 for the most trusted.
        n_ratings: Number of its ratings.
        n_raters: Number of its raters.
        reasons: Its most important raters, those first without whom its trust is furthest from what it is.
    """

    trust: float
    rank: int
    n_ratings: int
    n_raters: int
    reasons: list[Reason]


def find_ratee(log: RatingLog, name: str) -> int:
    """Return the place of an agent that has ratings, by its name.

    Raises:
        ValueError: There is none.
    """
    rated: dict[str, int] = {log.ratee_names[place]: place for place in np.unique(log.ratees).tolist()}
    if name not in rated:
        near = get_close_matches(name, list(rated)[:_MANY], 1)
        raise ValueError(f"no agent {name!r} has ratings{f'; did you mean {near[0]!r}?' if near else ''}")
    return rated[name]


def explain(
    model: Any,
    log: RatingLog,
    numbers: Ints,
    agent: int,
    *,
    most: int = MOST,
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> Explanation:
    """Return what makes the trust in an agent.

    The whole log is played again without the ratings of the agent by each of its raters. Of more raters than `most`,
    those are taken whose mean rating is furthest from its trust, weighted by the trust in them.

    Args:
        model: Trust model.
        log: Log.
        numbers: Number of the round of each rating, shape (n,), ascending.
        agent: Place of the agent among the ratees.
        most: Number of raters.
        advance: Function that is called with the number of logs that were played, and of all.

    Raises:
        MemoryError: The model does not fit, see `make_run`.
    """
    own, rated = log.ratees == agent, np.unique(log.ratees)
    run = played(model, log, numbers)
    trust, tor = float(run.provider_trust[agent]), run.rater_trust
    raters, place, times = np.unique(log.raters[own], return_inverse=True, return_counts=True)
    weight = tor[raters] * np.abs(np.bincount(place, log.values[own]) / times - trust)
    chosen = raters[np.argsort(-weight, kind="stable")[:most]]
    reasons = []
    for done, rater in enumerate(chosen.tolist()):
        theirs = own & (log.raters == rater)
        other = played(model, log, numbers, without=theirs).provider_trust
        without = float(other[agent])
        reasons.append(Reason(rater, float(tor[rater]), log.values[theirs], without, _rank(other[rated], without)))
        advance(done + 1, len(chosen))
    reasons.sort(key=lambda reason: -abs(reason.without - trust))
    return Explanation(trust, _rank(run.provider_trust[rated], trust), int(own.sum()), len(raters), reasons)


def _rank(trusts: Floats, trust: float) -> int:
    return 1 + int((trusts > trust).sum())
