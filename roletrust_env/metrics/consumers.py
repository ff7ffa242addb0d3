"""Metrics of consumers that choose providers by their trust."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from roletrust_env.game.consumer import Bought, buy, receive
from roletrust_env.game.rollout import History
from roletrust_env.metrics.score import (
    FlagsByRound,
    Floats,
    RoundWeights,
    Score,
    in_rounds,
    ratio,
)
from roletrust_env.shapes import Shape

_ROUNDING = 1e-9  # a blind choice that is so near to the best one has no other that is better


def utility(
    trust: Annotated[Floats, Shape("T P ...")],
    offered: Annotated[Floats, Shape("T P ...")] | Annotated[Floats, Shape("T S P ...")],
    weights: RoundWeights | None = None,
) -> Score:
    """Return the quality that a consumer gets from the most trusted provider, as a share of the
    best quality offered.

        utility = sum over rounds t of offered[t, argmax trust[t - 1]] / sum over rounds t of max
                offered[t]

    The consumer knows the trust published after the previous round. Ties are broken uniformly. If
    providers treat raters differently, every rater is such a consumer, and both sums are over all
    raters, too.

    Args:
        trust: Trust of the providers, shape (T, P, ...); NaN where one is absent.
        offered: Quality that each provider offers, shape (T, P, ...), or offers to each rater,
            shape (T, S, P, ...); NaN where it does not serve, see `Game.offered`.
        weights: Weights of the rounds, shape (T,), see `Scenario.round_weights`; None weights all
            alike.
    """
    bought = _bought(trust, offered, weights)
    return share_of_best(bought.got, bought.best)


def blind_utility(
    trust: Annotated[Floats, Shape("T P ...")],
    offered: Annotated[Floats, Shape("T P ...")] | Annotated[Floats, Shape("T S P ...")],
    weights: RoundWeights | None = None,
) -> Score:
    """Return the utility of a consumer that chooses providers uniformly at random, as a baseline
    for `utility`.

        utility = sum over rounds t of mean offered[t] / sum over rounds t of max offered[t]

    Args:
        trust: See `utility`. It determines which providers can be chosen.
        offered: See `utility`.
        weights: See `utility`.
    """
    bought = _bought(trust, offered, weights)
    return share_of_best(bought.blind, bought.best)


def skill(
    utility: Annotated[Floats, Shape("G")], blind: Annotated[Floats, Shape("G")]
) -> Annotated[Floats, Shape("G")]:
    """Return the skill of the choice by trust against a blind choice in the same games, for each
    game.

        skill = s + (utility - blind - s (1 - blind)) / mean (1 - blind)
        s = mean (utility - blind) / mean (1 - blind)

    The means are over games. The mean of the result is s, the skill score of forecasts (Murphy,
    1988): 1 for the best choice in every round, 0 for a choice no better than chance, and below 0
    if trust misleads. It does not depend on how many good providers there are, as utility does.
    Around s the games vary as the quotient of means does to first order, so that the interval of
    their mean is that of s. NaN if a blind choice is the best in all games.

    Args:
        utility: Utility of each game, shape (G,), see `utility`; NaN where it is undefined.
        blind: Utility of a blind choice in each game, shape (G,), see `blind_utility`.

    Example:
        >>> import numpy as np
        >>> skill(np.array([0.9, 0.5]), np.array([0.6, 0.4])).round(2).tolist()
        [0.68, 0.12]
    """
    return skill_score(Bought(utility, np.ones(utility.shape), blind))


def skill_score(bought: Bought) -> Annotated[Floats, Shape("G")]:
    """Return the skill of the qualities that consumers got, for each game, see `skill`.

        skill = s + (got - blind - s (best - blind)) / mean (best - blind)
        s = mean (got - blind) / mean (best - blind)

    Args:
        bought: Qualities in each game, shape (G,); NaN where they are undefined.

    Returns:
        The skill of each game, shape (G,), whose mean is s; NaN if `blind` is the best in all.
    """
    won = bought.got - bought.blind
    known = ~np.isnan(won)
    possible = np.where(known, bought.best - bought.blind, np.nan)
    lead = float(possible[known].mean()) if known.any() else 0.0
    if not lead > _ROUNDING:
        return np.full(won.shape, np.nan)
    mean = float(won[known].mean()) / lead
    score: Floats = mean + (won - mean * possible) / lead
    return score


def received(
    history: History,
    ability: Annotated[Floats, Shape("P ...")] | Annotated[Floats, Shape("T P ...")],
    consumers: Sequence[int],
    honest: Sequence[int],
    *,
    providers: int = 1,
    weights: RoundWeights | None = None,
) -> Bought:
    """Return the quality that consumers received, and what the honest providers were able to offer,
    summed over the rounds, for each game, shape (...). `skill_score` makes the skill of it.

    Args:
        history: Record of the games, in which raters choose providers, see `Choice`.
        ability: Ability of each provider in [0, 1], shape (P, ...); or in each round, shape (T, P,
            ...), from `Round.before` where abilities change.
        consumers: Indices of the honest raters.
        honest: Indices of the honest providers.
        providers: Number of services that a consumer chooses in a round.
        weights: Weights of the rounds, shape (T,), see `Scenario.round_weights`; None weights all
            alike.
    """
    served, offered = np.asarray(history.served), np.asarray(history.offered, np.float64)
    able = np.broadcast_to(ability, served.shape[:1] + served.shape[2:])
    rounds = [
        receive(*each, consumers, honest, providers)
        for each in zip(served, offered, able, strict=True)
    ]
    return Bought(
        *(in_rounds(np.stack(part), weights).sum(axis=0) for part in zip(*rounds, strict=True))
    )


def robustness(served: FlagsByRound, buyers: Sequence[int], sellers: Sequence[int]) -> Score:
    """Return the robustness of Zhang, Jiang, Zhang and Ng (2012) in [-1, 1]: 1 robust, 0
    vulnerable, below 0 defeated.

        RE = (services that honest buyers had from honest sellers - from dishonest sellers) /
                services that they had

    Args:
        served: Boolean array of shape (T, S, P, ...), true where the provider served the rater.
        buyers: Indices of the honest raters.
        sellers: Indices of the honest providers.
    """
    services = np.asarray(served)[:, list(buyers)].sum(axis=(0, 1))  # (P, ...)
    honest, total = services[list(sellers)].sum(axis=0), services.sum(axis=0)
    share = ratio(2.0 * honest - total, total)
    return Score.where(total > 0, share, "no honest rater was ever served")


def _bought(trust: Floats, offered: Floats, weights: Floats | None) -> Bought:
    bought = buy(np.asarray(trust, np.float64)[:-1], np.asarray(offered, np.float64)[1:], axis=1)
    return Bought(*(in_rounds(part, None if weights is None else weights[1:]) for part in bought))


def share_of_best(
    got: Annotated[Floats, Shape("T ...")], best: Annotated[Floats, Shape("T ...")]
) -> Score:
    """Return the quality that consumers got as a share of the best quality offered, see `utility`.

        share = sum over rounds t of got[t] / sum over rounds t of best[t]

    Args:
        got: Quality that the consumers got, shape (T, ...).
        best: Best quality offered, shape (T, ...).
    """
    highest = best.sum(axis=0)
    return Score.where(highest > 0, ratio(got.sum(axis=0), highest), "no provider ever served well")
