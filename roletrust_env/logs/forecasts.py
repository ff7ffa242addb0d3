"""Trust as a forecast on a log of real ratings: of the next rating, and of raters against the
others' later view.

A round's ratings are compared with the trust before it, so no number sees the future but the view
of the others, which is the truth to be forecast. The length of a round is part of every number.
"""

from typing import Any, NamedTuple

import numpy as np

from roletrust_env.logs.log import Log, TooSmallError
from roletrust_env.logs.log_rounds import log_rounds, play_round
from roletrust_env.logs.rounds import spans
from roletrust_env.metrics.confidence import Interval
from roletrust_env.metrics.resampling import auc, correlation, interval, mean
from roletrust_env.metrics.score import ratio
from roletrust_env.trust.algorithms import agent_trust
from roletrust_env.trust.key_index import Floats, Ints
from roletrust_env.trust.run import make_run

_OTHERS = 2  # so many ratings by others make a view
_ACTIVITY = (3, 10, 30, 100)  # limits of the strata, in earlier ratings by the rater
_SPREAD = 1e-9  # less variance of trust in the past than this fits no line


class Forecasts(NamedTuple):
    """Trust before the round of each rating from the second round on, in the order of the log.

    Attributes:
        top: Trust in the ratee before the round, shape (n,).
        tor: Trust in the rater before the round, shape (n,); None if the model does not rate
            raters.
        own: Trust in the rater as a ratee before the round, shape (n,); None if raters are other
            agents than ratees.
        number: Number of the round, shape (n,).
        since: Place in the log of the first of these ratings.
    """

    top: Floats
    tor: Floats | None
    own: Floats | None
    number: Ints
    since: int


def forecasts(model: Any, log: Log, every: float, *, same_agents: bool) -> Forecasts:
    """Return what a model publishes before each round of a log.

    All agents of the log are present from the first round on, unlike in a `TrustStream`. A model
    that shares trust out among all agents, such as EigenTrust, gives those without a rating other
    trust than if they joined later.

    Raises:
        TooSmallError: The log has a single round.
        MemoryError: The model does not fit, see `make_run`.
    """
    numbers = log_rounds(log, every)
    since = int(np.searchsorted(numbers, 0, side="right"))
    if since == len(numbers):
        raise TooSmallError(
            f"with rounds of {every:g} the log has a single round, so there is nothing to forecast"
        )
    run = make_run(model, log.shape, one_role=not same_agents)
    top, tor, own = np.zeros((3, len(numbers)))
    for number, part in spans(numbers):
        top[part] = run.provider_trust[log.ratees[part]]
        tor[part] = run.rater_trust[log.raters[part]]
        own[part] = run.provider_trust[log.raters[part]] if same_agents else 0.0
        play_round(run, number, log.raters[part], log.ratees[part], log.values[part])
    raters = tor[since:] if model.rates_raters else None
    return Forecasts(
        top[since:], raters, own[since:] if same_agents else None, numbers[since:], since
    )


def next_rating(found: Forecasts, log: Log, seed: int = 0) -> dict[str, Interval]:
    """Return how well trust in a ratee forecasts its next ratings.

    - `auc`: negative ratings, below the middle of the scale, against the others, of ratees with
      earlier ratings.
    - `auc, newcomers too`: the same with the first ratings of ratees, which the initial trust
      forecasts.
    - `r`: Pearson's correlation of trust and rating.
    - `rmse`: root of the mean squared error of a line from trust to rating, fitted to earlier
      rounds only.

    Intervals resample ratees.

    Args:
        found: Trust before the rounds.
        log: The same log.
        seed: Random seed of the resamples.
    """
    values, groups = log.values[found.since :], log.ratees[found.since :]
    bad, known = (values < 0.5).astype(np.float64), ~np.isnan(past_mean(found, log))
    return {
        "auc": interval(auc(found.top[known], bad[known], 0 * groups[known]), groups[known], seed),
        "auc, newcomers too": interval(auc(found.top, bad, 0 * groups), groups, seed),
        "r": interval(correlation(found.top, values), groups, seed),
        "rmse": _error(found, values, groups, seed),
    }


def rated_before(
    found: Forecasts, log: Log, scale: tuple[float, float], seed: int = 0
) -> dict[str, Interval]:
    """Return how well trust forecasts ratings of ratees with earlier ones, as in studies of signed
    networks.

    - `r`: Pearson's correlation of trust and rating, as Kumar et al. (2016) report it.
    - `rmse`: root of the mean squared error on the scale of the log, of a line that is fitted to
      earlier rounds only.
    - `r, past mean` and `rmse, past mean`: the same of the mean of all ratings of earlier rounds.

    Intervals resample ratees.

    Args:
        found: Trust before the rounds.
        log: The same log.
        scale: Worst and best rating.
        seed: Random seed of the resamples.

    Returns:
        The measures; none if no ratee has earlier ratings.
    """
    past, measures = past_mean(found, log), dict[str, Interval]()
    known = ~np.isnan(past)
    if not known.any():
        return measures
    values, groups = log.values[found.since :][known], log.ratees[found.since :][known]
    for name, top in (("", found.top), (", past mean", past)):
        one = found._replace(top=top[known], number=found.number[known])
        measures[f"r{name}"] = interval(correlation(one.top, values), groups, seed)
        error = _error(one, values, groups, seed)
        measures[f"rmse{name}"] = Interval(*(end * (scale[1] - scale[0]) for end in error))
    return measures


def past_mean(found: Forecasts, log: Log) -> Floats:
    """Return the mean of the ratings of each ratee in earlier rounds, shape (n,); NaN where there
    is none.
    """
    ratees = log.ratees[found.since :]
    total, count = (
        earlier(found, ratees, log.ratees, weights)
        for weights in (log.values, np.ones(len(log.values)))
    )
    return ratio(total, count)


def earlier(found: Forecasts, asked: Ints, agents: Ints, weights: Floats) -> Floats:
    """Return the sum of the weights of an agent's ratings in earlier rounds.

    Args:
        found: Trust before the rounds.
        asked: An agent for each forecast, shape (n,).
        agents: The agent of each rating of the log: its rater, or its ratee.
        weights: Weight of each rating of the log.

    Returns:
        Shape (n,).
    """
    total, sums = (
        np.bincount(agents[: found.since], weights[: found.since], agents.max() + 1),
        np.zeros(len(asked)),
    )
    agents, weights = agents[found.since :], weights[found.since :]
    for _, part in spans(found.number):
        sums[part] = total[asked[part]]
        np.add.at(total, agents[part], weights[part])
    return sums


def _error(found: Forecasts, values: Floats, groups: Ints, seed: int) -> Interval:
    """Return the root of the mean squared error of a line that is fitted to earlier rounds."""
    squares = (_from_past(found, values) - values) ** 2
    return Interval(*np.sqrt(interval(mean(squares), groups, seed)).tolist())


def _from_past(found: Forecasts, values: Floats) -> Floats:
    """Return the rating that a line fitted to earlier rounds gives; the middle of the scale in the
    first.
    """
    line = np.full(len(values), 0.5)
    for _, part in spans(found.number):
        x, y = found.top[: part.start], values[: part.start]
        if len(x):
            slope = np.cov(x, y, bias=True)[0, 1] / np.var(x) if np.var(x) > _SPREAD else 0.0
            line[part] = y.mean() + slope * (found.top[part] - x.mean())
    return line


def rater_forward(found: Forecasts, log: Log, seed: int = 0) -> dict[str, Interval]:
    """Return how well trust in a rater forecasts that its next ratings are against the view of the
    others.

    The view is the mean of all ratings of the ratee by others in the whole log, where at least two
    others rated it. A rating is against it if one is below the middle of the scale and the other is
    not. The values are the AUC, within strata of equal activity, of

    - `ratings`: the number of earlier ratings by the rater, since activity alone is a forecast,
      too.
    - `kindness`: the share of them that is not below the middle. Where most
      views are kind, kind raters are seldom against them.
    - `trust`: ToR, if the model rates raters.
    - `ToA`: the trust of the agent in both of its roles (Algorithm 3), if raters are ratees, too.

    Raters without an earlier rating are left out. Intervals resample raters.

    Args:
        found: Trust before the rounds.
        log: The same log.
        seed: Random seed of the resamples.
    """
    raters, one = log.raters[found.since :], np.ones(len(log.values))
    _, pair = np.unique_inverse(log.raters * log.shape[1] + log.ratees)
    total, count = (np.bincount(log.ratees, w) for w in (log.values, one))
    own, own_count = np.bincount(pair, log.values)[pair], np.bincount(pair)[pair]
    others = count[log.ratees] - own_count
    view = (total[log.ratees] - own) / np.maximum(others, 1)
    against = ((log.values < 0.5) != (view < 0.5)).astype(np.float64)[found.since :]
    ratings, kind = (
        earlier(found, raters, log.raters, w) for w in (one, (log.values >= 0.5).astype(np.float64))
    )
    scores = {"ratings": ratings, "kindness": kind / np.maximum(ratings, 1)}
    if found.tor is not None:
        scores["trust"] = found.tor
        if found.own is not None:
            provided = earlier(found, raters, log.ratees, one)
            scores["ToA"] = agent_trust(
                found.tor, found.own, rated=ratings, provided=provided, initial=0.5
            )
    judged = (others[found.since :] >= _OTHERS) & (ratings > 0)
    strata, groups = np.digitize(ratings, _ACTIVITY)[judged], raters[judged]
    return {
        name: interval(auc(score[judged], against[judged], strata), groups, seed)
        for name, score in scores.items()
    }
