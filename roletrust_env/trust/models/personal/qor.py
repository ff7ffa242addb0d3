"""Notes that fade, bad ones sooner, each as good as its author's quality of recommendation."""

import math
from typing import NamedTuple

from roletrust_env.arrays import Array, namespace, total
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import Factor, Share
from roletrust_env.trust.algorithms import occurred
from roletrust_env.trust.judges import (
    absorbed,
    compared,
    credences,
    in_common,
    mean,
    news,
    nothing_yet,
    published_providers,
    published_raters,
    remember,
    told,
    weighed,
)

_MEMORY = 10  # notes of a rater on a provider that are kept


class QorState(NamedTuple):
    """What each judge remembers.

    Attributes:
        trust: T in [0, 1], shape (S, P, ...).
        quality: QR, of the recommendations of k to i, in [-1, 1], shape (S, S, ...).
        past: the weighted mean of all QR so far, this one included, shape (S, S, ...).
        weight: the sum of the weights c behind it, shape (S, S, ...).
        notes: the last notes that k gave j, in [-1, 1], the newest first, shape (10, S, P, ...).
        weights: what they weigh by now, and 0 where there is none, shape (10, S, P, ...).
    """

    trust: Array
    quality: Array
    past: Array
    weight: Array
    notes: Array
    weights: Array


@checked_dataclass
class QualityOfRecommendation:
    """Quality of recommendation: faded notes, each multiplied by what its author's notes were worth before.

    Ben Saied, Olivereau, Zeghlache and Laurent, "Trust management system design for the Internet of Things: a
    context-aware and multi-service approach" (2013), with notes N = 2f - 1 in [-1, 1] of age dt in rounds:

        T[i, j]   = sum over k and its notes of w QR[i, k] N / sum of w,   w = theta^((s + 1) dt),  s = (N^2 - N) / 2
        r         = 1 - |N[k, j] - N[i, j]|,  the mean over the providers j that both rated in the round
        QR[i, k] <- (sum of c QR over all QR[i, k] so far + r) / (sum of c + 1),  c = theta^dt,  1 at first

    A note of -1 fades twice as fast as one of 0 or 1. A judge's own notes count with QR 1. Published are T and QR
    moved to [0, 1].

    Left out: contexts, which our services do not have (their distance d is 0 in a further factor l^d of w). Unsure: in
    the one public code r stands inside the sum, once for each of its terms. Read into it: r weighs 1, as C_F, since a
    judge's own feedback does; there is one QR a round, in whatever order the services came; of one rater's notes on a
    provider the last 10 are kept; T is reckoned anew for a provider that somebody rated in the round.

    Attributes:
        initial: trust before any rating, in [0, 1].
        theta: what is left of a weight after a round, in (0, 1].
    """

    initial: Share = 0.5
    theta: Factor = 0.7
    rates_raters = True
    family = "personal"
    source = "Ben Saied et al. (2013)"
    cost = "S^2 P"

    def start(self, like: Array) -> QorState:
        """Initial trust, recommendations of full quality and no notes. See `TrustModel.start`."""
        nothing, quality = nothing_yet(like, _MEMORY), credences(like, 1.0)
        return QorState(nothing[0] + self.initial, quality, quality, quality, nothing, nothing)

    def update(self, state: QorState, ratings: Array, mask: Array) -> QorState:
        """One round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings)
        outcomes, met = told(ratings, mask)
        common = in_common(met)
        right = mean(compared(outcomes, met, lambda apart: 1 - 2 * apart), common)
        new, weight = occurred(common), self.theta * state.weight
        quality = xp.where(common > 0, absorbed(state.past, weight, right, new), state.quality)
        past = absorbed(state.past, weight, new * quality, new)
        faded = state.weights * xp.exp(math.log(self.theta) * (1 + 0.5 * (state.notes**2 - state.notes)))
        notes, weights = remember(state.notes, 2 * outcomes - 1, mask), remember(faded, met, mask)
        said = weighed(quality, total(weights * notes, 0))
        trust = 0.5 + 0.5 * mean(said, total(total(weights, 0), 0))
        return QorState(xp.where(news(met), trust, state.trust), quality, past, weight + new, notes, weights)

    def rater_trust(self, state: QorState) -> Array:
        """The mean quality of each rater's recommendations to the others, from [-1, 1] to [0, 1], shape (S, ...)."""
        return published_raters(0.5 + 0.5 * state.quality)

    def provider_trust(self, state: QorState) -> Array:
        """The judges' mean trust in each provider, shape (P, ...)."""
        return published_providers(state.trust)
