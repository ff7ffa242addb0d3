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
    credences,
    heard,
    in_common,
    mean_of_sums,
    news,
    nothing_yet,
    published_raters,
    push,
)
from roletrust_env.trust.ratings import Ratings, occurred

_MEMORY = 10  # number of ratings of a rater for a provider in memory


class Feedback(NamedTuple):
    """The last ratings, or services, of each pair.

    Attributes:
        values: Ratings N in [-1, 1], the newest first, shape (10, S, P, ...).
        weights: Current weights of these ratings, 0 where there is none, shape (10, S, P, ...).
    """

    values: Annotated[Array, Shape("10 S P ..."), SIGNED]
    weights: Annotated[Array, Shape("10 S P ..."), SHARES]

    def after(self, ratings: Ratings, theta: float) -> "Feedback":
        """Return the feedback after one more round, in which the weights fade."""
        faded = self.weights * namespace(self.weights).exp(
            math.log(theta) * (1 + 0.5 * (self.values**2 - self.values))
        )
        return Feedback(
            push(self.values, 2 * ratings.values - 1, ratings),
            push(faded, ratings.weights, ratings),
        )


class QorState(NamedTuple):
    """Memory of the judges.

    Attributes:
        trust: Trust T in [0, 1], shape (S, P, ...).
        quality: Quality QR of the recommendations of k to i, in [-1, 1], shape (S, S, ...).
        past: Weighted mean of all QR so far, this one included, shape (S, S, ...).
        weight: Sum of the weights c behind it, shape (S, S, ...).
        own: Last services of j that i received.
        said: Last ratings that k gave j.
    """

    trust: Annotated[PerPair, SHARES]
    quality: Annotated[PerAdviser, SIGNED]
    past: Annotated[PerAdviser, SIGNED]
    weight: Annotated[PerAdviser, AMOUNTS]
    own: Feedback
    said: Feedback


@checked_dataclass
class QualityOfRecommendation(Personal):
    """Quality of recommendation: faded ratings, each multiplied by the quality of its rater's
    earlier ratings.

    Ben Saied, Olivereau, Zeghlache and Laurent, "Trust management system design for the Internet of
    Things: a context-aware and multi-service approach" (2013), with ratings N = 2f - 1 in [-1, 1]
    of age dt in rounds:

        T[i, j]   = sum over k and its ratings of w QR[i, k] N / sum of w,
                w = theta^((s + 1) dt),  s = (N^2 - N) / 2
        r         = 1 - |N[k, j] - N'[i, j]|,
                the mean over the providers j that k rated and i was served by in the round
        QR[i, k] <- (sum of c QR over all QR[i, k] so far + r) / (sum of c + 1),  c = theta^dt,  1
                at first

    N' are the services that the judge itself received. They count with QR 1, in place of its
    ratings. A rating of -1 fades twice as fast as one of 0 or 1. The model publishes T and QR
    mapped to [0, 1].

    Not included: contexts, since services have none here (their distance d is 0 in a further factor
    l^d of w). Uncertain: in the only public code r is inside the sum, once for each of its terms.
    Added where the paper leaves something open: r weighs 1, as C_F, since a judge's own feedback
    does; there is one QR per round, whatever the order of the services; the last 10 ratings of a
    rater for a provider count; T is updated for providers of which the judge has news in the round.

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
        none = Feedback(nothing, nothing)
        return QorState(nothing[0] + self.initial, quality, quality, quality, none, none)

    def update(self, state: QorState, ratings: Ratings) -> QorState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings.values)
        common = in_common(ratings)
        right = mean_of_sums(compare_opinions(ratings, lambda apart: 1 - 2 * apart), common)
        new, weight = occurred(common), self.theta * state.weight
        quality = xp.where(common > 0, absorb(state.past, weight, right, new), state.quality)
        past = absorb(state.past, weight, new * quality, new)
        own = state.own.after(ratings.experience, self.theta)
        said = state.said.after(ratings, self.theta)
        sums = heard(quality, total(said.weights * said.values, 0))
        weights = heard(1.0, total(said.weights, 0)) + total(own.weights, 0)
        trust = 0.5 + 0.5 * mean_of_sums(sums + total(own.weights * own.values, 0), weights)
        trust = xp.where(news(ratings) > 0, trust, state.trust)
        return QorState(trust, quality, past, weight + new, own, said)

    def rater_trust(self, state: QorState) -> PerRater:
        """Return the mean quality of each rater's recommendations to the others, mapped to [0, 1],
        shape (S, ...).
        """
        return published_raters(0.5 + 0.5 * state.quality)
