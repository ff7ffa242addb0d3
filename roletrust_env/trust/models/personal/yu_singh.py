"""Own experience, and advisers weighted by how right they were before: the model of Yu, Singh and
Sycara.
"""

from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, namespace, total
from roletrust_env.parameters import Factor, Share, Size, checked_dataclass
from roletrust_env.shapes import PerAdviser, PerPair, PerRater, Shape
from roletrust_env.trees import FLAGS, SHARES, ValueRange
from roletrust_env.trust.personal import (
    Personal,
    compare_opinions,
    credence_sum,
    credences,
    mean_of_sums,
    nothing_yet,
    others,
    published_raters,
    push,
)
from roletrust_env.trust.ratings import PROVIDER, Ratings

_FAINT = -40.0
"""Logarithm of the least relative credence, so that the credence of the only advisers does not
underflow to 0."""


class YuSinghState(NamedTuple):
    """Memory of the judges.

    Attributes:
        trust: Trust T, shape (S, P, ...).
        log_credence: Logarithm of C, shape (S, S, ...), since a product of hundreds of factors
            would underflow.
        recent: Last ratings that i gave j, the newest first, shape (memory, S, P, ...).
        known: Flag, 1 where there is such a rating, 0 elsewhere, shape (memory, S, P, ...).
    """

    trust: Annotated[PerPair, SHARES]
    log_credence: Annotated[PerAdviser, ValueRange(high=0)]
    recent: Annotated[Array, Shape("memory S P ..."), ValueRange(0, "known")]
    known: Annotated[Array, Shape("memory S P ..."), FLAGS]


@checked_dataclass
class YuSingh(Personal):
    """Yu-Singh-Sycara: own experience, and advisers whose credence falls with every error (weighted
    majority).

    Yu, Singh and Sycara, "Developing trust in large-scale peer-to-peer systems" (2004), for judge
    i, adviser k and provider j:

        C[i, k] <- C[i, k] (1 - (1 - beta) |f[k, j] - f[i, j]|)
                for each j that both rated in the round; 1 at first
        T[i, j]  = h local + (1 - h) sum over k of C[i, k] said[k, j] / sum over k of C[i, k]

    `local` is the mean of i's last `memory` ratings of j, and h is their number over `memory`.
    After `memory` ratings a judge relies on its own experience alone. `said` is the newest rating
    that k gave j, if any.

    Not included: the search for witnesses along chains of referrals. A judge hears all raters.
    Added where the paper leaves something open: without advisers T is all `local`, and it is
    updated for providers that were rated in the round.

    Attributes:
        initial: Trust before any rating, in [0, 1].
        beta: Share of its credence that an adviser keeps after the largest possible error, in (0,
            1].
        memory: Number of own ratings of a provider that a judge remembers, 1 or more.
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
        return YuSinghState(recent[0] + self.initial, credences(like, 0.0), recent, recent)

    def update(self, state: YuSinghState, ratings: Ratings) -> YuSinghState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings.values)
        lost = compare_opinions(ratings, lambda apart: xp.log(1 - (1 - self.beta) * apart))
        log_credence = state.log_credence + lost
        recent, known = (
            push(state.recent, ratings.values, ratings),
            push(state.known, ratings.weights, ratings),
        )
        experiences = total(known, 0)
        local, h = mean_of_sums(total(recent, 0), experiences), experiences / self.memory
        credence = _relative(log_credence)
        believed = credence_sum(credence, known[0])
        advice = mean_of_sums(credence_sum(credence, recent[0]), believed)
        trust = xp.where(believed > 0, h * local + (1 - h) * advice, local)
        return YuSinghState(
            xp.where(ratings.rated(PROVIDER), trust, state.trust), log_credence, recent, known
        )

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
