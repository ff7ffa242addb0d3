"""Own experience, and advisers weighted by how right they were before: the model of Yu, Singh and
Sycara.
"""

from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, namespace, total
from roletrust_env.parameters import Factor, Share, Size, checked_dataclass
from roletrust_env.shapes import PerAdviser, PerPair, PerRater, Shape
from roletrust_env.trees import FLAGS, SHARES, ValueRange
from roletrust_env.trust.personal import (
    Evidence,
    Personal,
    compare_opinions,
    credences,
    mean_of_sums,
    news,
    nothing_yet,
    others,
    product,
    published_raters,
    push,
)
from roletrust_env.trust.ratings import Ratings

_FAINT = -40.0
"""Logarithm of the least relative credence, so that the credence of the only advisers does not
underflow to 0."""


class YuSinghState(NamedTuple):
    """Memory of the judges.

    Attributes:
        trust: Trust T, shape (S, P, ...).
        log_credence: Logarithm of C, shape (S, S, ...), since a product of hundreds of factors
            would underflow.
        recent: Last services of j that i received, the newest first, shape (memory, S, P, ...).
        known: Flag, 1 where there is such a service, 0 elsewhere, shape (memory, S, P, ...).
        said: Newest rating that k gave j, 0 without any.
    """

    trust: Annotated[PerPair, SHARES]
    log_credence: Annotated[PerAdviser, ValueRange(high=0)]
    recent: Annotated[Array, Shape("memory S P ..."), ValueRange(0, "known")]
    known: Annotated[Array, Shape("memory S P ..."), FLAGS]
    said: Evidence


@checked_dataclass
class YuSingh(Personal):
    """Yu-Singh-Sycara: own experience, and advisers whose credence falls with every error (weighted
    majority).

    Yu, Singh and Sycara, "Developing trust in large-scale peer-to-peer systems" (2004), for judge
    i, adviser k and provider j:

        C[i, k] <- C[i, k] (1 - (1 - beta) |f[k, j] - x[i, j]|)
                for each j that k rated and i received a service x of in the round; 1 at first
        T[i, j]  = h local + (1 - h) sum over k of C[i, k] said[k, j] / sum over k of C[i, k]

    `local` is the mean of the last `memory` services of j that i received, and h is their number
    over `memory`. After `memory` services a judge relies on its own experience alone. `said` is the
    newest rating that k gave j, if any.

    Not included: the search for witnesses along chains of referrals. A judge hears all raters.
    Added where the paper leaves something open: without advisers T is all `local`, and it is
    updated for providers of which the judge has news in the round.

    Attributes:
        initial: Trust before any rating, in [0, 1].
        beta: Share of its credence that an adviser keeps after the largest possible error, in (0,
            1].
        memory: Number of services of a provider that a judge remembers, 1 or more.
    """

    initial: Share = 0.5
    beta: Factor = 0.5
    memory: Size = 10
    rates_raters = True
    source = "Yu, Singh and Sycara (2004)"
    cost = "S^2 P"

    def start(self, like: PerPair) -> YuSinghState:
        """Return the state with initial trust, full credence and no experience. See
        `TrustModel.start`.
        """
        recent = nothing_yet(like, self.memory)
        return YuSinghState(
            recent[0] + self.initial, credences(like, 0.0), recent, recent, Evidence.none(like)
        )

    def update(self, state: YuSinghState, ratings: Ratings) -> YuSinghState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings.values)
        lost = compare_opinions(ratings, lambda apart: xp.log(1 - (1 - self.beta) * apart))
        log_credence = state.log_credence + lost
        own = ratings.experience
        recent = push(state.recent, own.values, own)
        known = push(state.known, own.weights, own)
        said = Evidence(
            *(ratings.write(*each) for each in zip(state.said, Evidence.of(ratings), strict=True))
        )
        experiences = total(known, 0)
        local, h = mean_of_sums(total(recent, 0), experiences), experiences / self.memory
        credence = _relative(log_credence)
        believed = product(credence, said.counts)
        advice = mean_of_sums(product(credence, said.sums), believed)
        trust = xp.where(believed > 0, h * local + (1 - h) * advice, local)
        trust = xp.where(news(ratings) > 0, trust, state.trust)
        return YuSinghState(trust, log_credence, recent, known, said)

    def rater_trust(self, state: YuSinghState) -> PerRater:
        """Return the mean credence of the others in each rater, shape (S, ...)."""
        return published_raters(namespace(state.trust).exp(state.log_credence))


def _relative(log_credence: Array) -> Array:
    """Return each judge's credence in the others relative to the best of them, shape (S, S, ...); 0
    in itself.
    """
    xp, two = namespace(log_credence), others(log_credence)
    of_others = xp.where(two > 0, log_credence, xp.min(log_credence, axis=1, keepdims=True))
    return two * xp.exp(xp.clip(of_others - xp.max(of_others, axis=1, keepdims=True), _FAINT, 0.0))
