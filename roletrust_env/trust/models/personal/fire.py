"""Own experience and witnesses, each weighted by its reliability: two of the four parts of FIRE."""

import math
from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, namespace, total
from roletrust_env.parameters import PositiveAmount, Share, checked_dataclass
from roletrust_env.shapes import PerAdviser, PerPair, PerRater, Shape
from roletrust_env.trees import AMOUNTS, SHARES, SIGNED
from roletrust_env.trust.personal import (
    Personal,
    absorb,
    by_judges,
    compare_opinions,
    credences,
    in_common,
    mean_of_sums,
    news,
    nothing_yet,
    others,
    product,
    published_raters,
    push,
)
from roletrust_env.trust.ratings import Ratings

_MEMORY = 10  # number of own ratings of a provider in memory
_FADE = 0.5 ** (1 / 5)  # exp(-1 / l) with l = -5 / ln .5: after five rounds a rating weighs half
_INTERACTION, _WITNESS = 2.0, 1.0  # component weights
_FORGOTTEN = 1e-20  # evidence of less weight is ignored


class FireState(NamedTuple):
    """Memory of the judges.

    Attributes:
        trust: Trust T in [0, 1], shape (S, P, ...).
        credibility: Credibility of the witnesses, in [-1, 1], shape (S, S, ...).
        judged: Weight of the credibility ratings behind it, shape (S, S, ...).
        values: Last services of j that i received, on [-1, 1], the newest first, shape (10, S, P,
            ...).
        weights: Current weights of these services, 0 where there is none, shape (10, S, P, ...).
        said: Newest rating that k gave j, on [-1, 1], shape (S, P, ...).
        said_weights: Current weight of that rating, 0 where there is none, shape (S, P, ...).
    """

    trust: Annotated[PerPair, SHARES]
    credibility: Annotated[PerAdviser, SIGNED]
    judged: Annotated[PerAdviser, AMOUNTS]
    values: Annotated[Array, Shape("10 S P ..."), SIGNED]
    weights: Annotated[Array, Shape("10 S P ..."), SHARES]
    said: Annotated[PerPair, SIGNED]
    said_weights: Annotated[PerPair, SHARES]


@checked_dataclass
class Fire(Personal):
    """FIRE's interaction trust and witness reputation, each weighted by its reliability.

    Huynh, Jennings and Shadbolt, "An integrated trust and reputation model for open multi-agent
    systems" (2006), with v = 2f - 1 in [-1, 1], ages dt in rounds, l = -5 / ln .5 and g = -ln .5:

        component   = sum w v / sum w,
                reliability = (1 - exp(-g sum w)) (1 - half of sum w |v - component| / sum w)
        interaction:  the last 10 services of j that i received, w = exp(-dt / l)
        witness:      the newest rating that each k gave j, w = max(credibility, 0) exp(-dt / l)
        T           = sum of weight * reliability * component / sum of weight * reliability,
                weights 2 and 1

    Each time that k rates a provider in the round in which i received its service, k gets a
    credibility rating of `1 - |v_k - v_i|` if that difference is below `tolerance`, else of -1; its
    credibility is sum w v / sum w over all of these. The model publishes trust and credibility
    mapped to [0, 1].

    Not included: role-based trust, certified reputation, and how witnesses are found. The values of
    `tolerance`, `credibility` and the component weights could not be checked in the paper. Added
    where the paper leaves something open: T is updated for providers of which the judge has news
    in the round; it stays where all weights are 0.

    Attributes:
        initial: Trust before any rating, in [0, 1].
        tolerance: Error on [-1, 1] up to which a witness is partly right, called i in the paper,
            above 0.
        credibility: Credibility of a witness that is not judged yet, in [0, 1].
    """

    initial: Share = 0.5
    tolerance: PositiveAmount = 0.5
    credibility: Share = 0.5
    rates_raters = True
    source = "Huynh, Jennings and Shadbolt (2006)"
    differentiable = False
    cost = "S^2 P"

    def start(self, like: PerPair) -> FireState:
        """Return initial trust, the default credibility and no experience. See
        `TrustModel.start`.
        """
        nothing = nothing_yet(like, _MEMORY)
        credibility = credences(like, self.credibility)
        return FireState(
            nothing[0] + self.initial,
            credibility,
            0 * credibility,
            nothing,
            nothing,
            nothing[0],
            nothing[0],
        )

    def update(self, state: FireState, ratings: Ratings) -> FireState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        own_ratings = ratings.experience
        judged, count = _FADE * state.judged, in_common(ratings)
        credibility = absorb(
            state.credibility, judged, compare_opinions(ratings, self._credible), count
        )
        values = push(state.values, 2 * own_ratings.values - 1, own_ratings)
        weights = push(_FADE * state.weights, own_ratings.weights, own_ratings)
        said = ratings.write(state.said, 2 * ratings.values - 1)
        said_weights = ratings.write(_FADE * state.said_weights, 1.0)
        own, own_weight = _interaction(values, weights)
        advice, advice_weight = _witnesses(credibility, said, said_weights)
        weight = _INTERACTION * own_weight + _WITNESS * advice_weight
        trust = 0.5 + 0.5 * mean_of_sums(
            _INTERACTION * own_weight * own + _WITNESS * advice_weight * advice, weight
        )
        trust = namespace(ratings.values).where(
            (news(ratings) > 0) & (weight > _FORGOTTEN), trust, state.trust
        )
        return FireState(trust, credibility, judged + count, values, weights, said, said_weights)

    def _credible(self, apart: Array) -> Array:
        """Return the credibility rating of a witness by its distance from the outcome, both in [0,
        1].
        """
        return namespace(apart).where(2 * apart < self.tolerance, 1 - 2 * apart, -1.0)

    def rater_trust(self, state: FireState) -> PerRater:
        """Return the mean credibility of each rater with the others, mapped from [-1, 1] to [0, 1],
        shape (S, ...).
        """
        return published_raters(0.5 + 0.5 * state.credibility)


def _interaction(values: Array, weights: Array) -> tuple[Array, Array]:
    """Return interaction trust in [-1, 1] and its reliability, each of shape (S, P, ...)."""
    weight = total(weights, 0)
    component = mean_of_sums(total(weights * values, 0), weight)
    return component, _reliability(weight, total(weights * abs(values - component), 0))


def _witnesses(credibility: Array, values: Array, weights: Array) -> tuple[Array, Array]:
    """Return witness reputation in [-1, 1] and its reliability, each of shape (S, P, ...).

    Args:
        credibility: Credibility of the witnesses, shape (S, S, ...).
        values: Latest rating of each witness, shape (S, P, ...).
        weights: Weights by age, shape (S, P, ...).
    """
    asked = others(credibility) * namespace(credibility).clip(credibility, 0.0, None)
    weight = product(asked, weights)
    component = mean_of_sums(product(asked, weights * values), weight)

    def apart(judges: slice) -> Array:
        return total(asked[judges, :, None] * weights * abs(values - component[judges, None]), 1)

    return component, _reliability(weight, by_judges(apart, values))


def _reliability(weight: Array, apart: Array) -> Array:
    """Return the reliability of a weighted mean of ratings, in [0, 1].

    Args:
        weight: Sum of the weights.
        apart: Weighted sum of the distances to the mean.
    """
    return -namespace(weight).expm1(math.log(0.5) * weight) * (
        1 - 0.5 * mean_of_sums(apart, weight)
    )
