"""Own experience, and what advisers say as far as they were right before: Yu, Singh and Sycara's model."""

from typing import NamedTuple

from pydantic import PositiveInt

from roletrust_env.arrays import Array, namespace, total
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import Factor, Share
from roletrust_env.trust.judges import (
    compared,
    credences,
    mean,
    news,
    nothing_yet,
    others,
    published_providers,
    published_raters,
    remember,
    told,
    weighed,
)

_FAINT = -40.0
"""No credence counts less than exp(this) of the best adviser's, lest those of the only advisers underflow to 0."""


class YuSinghState(NamedTuple):
    """What each judge remembers.

    Attributes:
        trust: T, shape (S, P, ...).
        log_credence: the logarithm of C, shape (S, S, ...): a product of hundreds of factors would underflow.
        recent: the last ratings that i gave j, the newest first, shape (memory, S, P, ...).
        known: 1 where there is such a rating, 0 elsewhere, shape (memory, S, P, ...).
    """

    trust: Array
    log_credence: Array
    recent: Array
    known: Array


@checked_dataclass
class YuSingh:
    """Own experience, and advisers believed less with every miss: weighted majority among judges.

    Yu, Singh and Sycara, "Developing trust in large-scale peer-to-peer systems" (2004), for judge i, adviser k and
    provider j:

        C[i, k] <- C[i, k] (1 - (1 - beta) |f[k, j] - f[i, j]|)      for each j that both rated in the round; 1 at first
        T[i, j]  = h local + (1 - h) sum over k of C[i, k] said[k, j] / sum over k of C[i, k]

    `local` is the mean of i's last `memory` ratings of j and h their number over `memory`, so that after so many a
    judge goes by its own experience alone; `said` is the newest rating that k gave j, if any.

    Left out: how witnesses are found along chains of referrals; a judge hears everybody. Read into it: without advisers
    T is all `local`, and it is reckoned anew for a provider that somebody rated in the round.

    Attributes:
        initial: trust before any rating, in [0, 1].
        beta: what is left of the credence in an adviser that was as wrong as can be, in (0, 1].
        memory: how many own ratings of a provider a judge keeps, 1 or more.
    """

    initial: Share = 0.5
    beta: Factor = 0.5
    memory: PositiveInt = 10
    rates_raters = True
    family = "personal"
    source = "Yu, Singh and Sycara (2004)"
    cost = "S^2 P"

    def start(self, like: Array) -> YuSinghState:
        """Initial trust, full credence and no experience. See `TrustModel.start`."""
        recent = nothing_yet(like, self.memory)
        return YuSinghState(recent[0] + self.initial, credences(like, 0.0), recent, recent)

    def update(self, state: YuSinghState, ratings: Array, mask: Array) -> YuSinghState:
        """One round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings)
        outcomes, met = told(ratings, mask)
        log_credence = state.log_credence + compared(outcomes, met, lambda apart: xp.log(1 - (1 - self.beta) * apart))
        recent, known = remember(state.recent, outcomes, mask), remember(state.known, met, mask)
        experiences = total(known, 0)
        local, h = mean(total(recent, 0), experiences), experiences / self.memory
        credence = _relative(log_credence)
        believed = weighed(credence, known[0])
        advice = mean(weighed(credence, recent[0]), believed)
        trust = xp.where(believed > 0, h * local + (1 - h) * advice, local)
        return YuSinghState(xp.where(news(met), trust, state.trust), log_credence, recent, known)

    def rater_trust(self, state: YuSinghState) -> Array:
        """The mean credence of the others in each rater, shape (S, ...)."""
        return published_raters(namespace(state.trust).exp(state.log_credence))

    def provider_trust(self, state: YuSinghState) -> Array:
        """The judges' mean trust in each provider, shape (P, ...)."""
        return published_providers(state.trust)


def _relative(log_credence: Array) -> Array:
    """C of each judge in the others, over that in the best of them, shape (S, S, ...); 0 in itself."""
    xp, two = namespace(log_credence), others(log_credence)
    of_others = xp.where(two > 0, log_credence, xp.min(log_credence, axis=1, keepdims=True))
    return two * xp.exp(xp.clip(of_others - xp.max(of_others, axis=1, keepdims=True), _FAINT, 0.0))
