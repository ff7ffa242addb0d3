"""Ratings that fade, bad ones faster, weighted by their rater's quality of recommendation."""

import math
from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, namespace, total
from roletrust_env.parameters import Factor, Share, checked_dataclass
from roletrust_env.shapes import PerAdviser, PerPair, PerRater, Shape
from roletrust_env.trees import AMOUNTS, SHARES, SIGNED
from roletrust_env.trust.personal import (
    Personal,
    absorb,
    compare_opinions,
    credence_sum,
    credences,
    in_common,
    mean_of_sums,
    nothing_yet,
    published_raters,
    push,
)
from roletrust_env.trust.ratings import PROVIDER, Ratings, occurred

_MEMORY = 10  # number of ratings of a rater for a provider in memory


class QorState(NamedTuple):
    """Memory of the judges.

    Attributes:
        trust: Trust T in [0, 1], shape (S, P, ...).
        quality: Quality QR of the recommendations of k to i, in [-1, 1], shape (S, S, ...).
        past: Weighted mean of all QR so far, this one included, shape (S, S, ...).
        weight: Sum of the weights c behind it, shape (S, S, ...).
        values: Last ratings that k gave j, in [-1, 1], the newest first, shape (10, S, P, ...).
        weights: Current weights of these ratings, 0 where there is none, shape (10, S, P, ...).
    """

    trust: Annotated[PerPair, SHARES]
    quality: Annotated[PerAdviser, SIGNED]
    past: Annotated[PerAdviser, SIGNED]
    weight: Annotated[PerAdviser, AMOUNTS]
    values: Annotated[Array, Shape("10 S P ..."), SIGNED]
    weights: Annotated[Array, Shape("10 S P ..."), SHARES]


@checked_dataclass
class QualityOfRecommendation(Personal):
    """Quality of recommendation: faded ratings, each multiplied by the quality of its rater's
    earlier ratings.

    Ben Saied, Olivereau, Zeghlache and Laurent, "Trust management system design for the Internet of
    Things: a context-aware and multi-service approach" (2013), with ratings N = 2f - 1 in [-1, 1]
    of age dt in rounds:

        T[i, j]   = sum over k and its ratings of w QR[i, k] N / sum of w,
                w = theta^((s + 1) dt),  s = (N^2 - N) / 2
        r         = 1 - |N[k, j] - N[i, j]|,
                the mean over the providers j that both rated in the round
        QR[i, k] <- (sum of c QR over all QR[i, k] so far + r) / (sum of c + 1),  c = theta^dt,  1
                at first

    A rating of -1 fades twice as fast as one of 0 or 1. A judge's own ratings count with QR 1. The
    model publishes T and QR mapped to [0, 1].

    Not included: contexts, since services have none here (their distance d is 0 in a further factor
    l^d of w). Uncertain: in the only public code r is inside the sum, once for each of its terms.
    Added where the paper leaves something open: r weighs 1, as C_F, since a judge's own feedback
    does; there is one QR per round, whatever the order of the services; the last 10 ratings of a
    rater for a provider count; T is updated for providers that were rated in the round.

    Attributes:
        initial: Trust before any rating, in [0, 1].
        theta: Share of a weight that remains after a round, in (0, 1].
    """

    initial: Share = 0.5
    theta: Factor = 0.7
    rates_raters = True
    source = "Ben Saied et al. (2013)"
    cost = "S^2 P"

    def start(self, like: PerPair) -> QorState:
        """Return the state with initial trust, full quality of all raters and no ratings. See
        `TrustModel.start`.
        """
        nothing, quality = nothing_yet(like, _MEMORY), credences(like, 1.0)
        return QorState(nothing[0] + self.initial, quality, quality, quality, nothing, nothing)

    def update(self, state: QorState, ratings: Ratings) -> QorState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings.values)
        outcomes, met = ratings.values, ratings.weights
        common = in_common(ratings)
        right = mean_of_sums(compare_opinions(ratings, lambda apart: 1 - 2 * apart), common)
        new, weight = occurred(common), self.theta * state.weight
        quality = xp.where(common > 0, absorb(state.past, weight, right, new), state.quality)
        past = absorb(state.past, weight, new * quality, new)
        faded = state.weights * xp.exp(
            math.log(self.theta) * (1 + 0.5 * (state.values**2 - state.values))
        )
        values, weights = push(state.values, 2 * outcomes - 1, ratings), push(faded, met, ratings)
        said = credence_sum(quality, total(weights * values, 0))
        trust = 0.5 + 0.5 * mean_of_sums(said, total(total(weights, 0), 0))
        trust = xp.where(ratings.rated(PROVIDER), trust, state.trust)
        return QorState(trust, quality, past, weight + new, values, weights)

    def rater_trust(self, state: QorState) -> PerRater:
        """Return the mean quality of each rater's recommendations to the others, mapped to [0, 1],
        shape (S, ...).
        """
        return published_raters(0.5 + 0.5 * state.quality)
