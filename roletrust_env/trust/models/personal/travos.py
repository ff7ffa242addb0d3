"""TRAVOS: own experience where there is enough, else opinions, discounted by the accuracy of
earlier ones.
"""

import math
from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, cast, device_of, namespace
from roletrust_env.parameters import Share, Size, checked_dataclass
from roletrust_env.shapes import PerAdviser, PerPair, Shape
from roletrust_env.trees import AMOUNTS, SHARES
from roletrust_env.trust.beta_distribution import mass_below, mass_between, reputation
from roletrust_env.trust.personal import Evidence, Personal, by_judges, others
from roletrust_env.trust.ratings import Ratings

_FLAT = 1 / math.sqrt(12)
"""Standard deviation of the uniform distribution, to which an opinion without credibility is
reduced."""


class TravosState(NamedTuple):
    """Memory of the judges of TRAVOS.

    Attributes:
        own: Services that each judge received: their sums are its successes m, and the rest of
            their counts its failures n.
        said: Ratings that each adviser delivered, likewise.
        good: Successes of judge i after opinions of adviser k in each bin, shape (S, S, bins, ...).
        bad: Failures, of the same shape.
        accuracy: Accuracy rho of such opinions, of the same shape.
        confidence: Confidence of judge i in its own experience of provider j, shape (S, P, ...).
        trust: Trust of judge i in provider j, shape (S, P, ...).
        credence: Credence of judge i in adviser k, shape (S, S, ...).
    """

    own: Evidence
    said: Evidence
    good: Annotated[Array, Shape("S S bins ..."), AMOUNTS]
    bad: Annotated[Array, Shape("S S bins ..."), AMOUNTS]
    accuracy: Annotated[Array, Shape("S S bins ..."), SHARES]
    confidence: Annotated[PerPair, SHARES]
    trust: Annotated[PerPair, SHARES]
    credence: Annotated[PerAdviser, SHARES]


@checked_dataclass
class Travos(Personal):
    """TRAVOS: a judge with little experience asks others, and weights opinions by the accuracy of
    earlier ones.

    Teacy, Patel, Jennings and Luck, "TRAVOS: Trust and Reputation in the Context of Inaccurate
    Information Sources" (2006). A judge that saw m successes and n failures of a provider expects
    mu = (m + 1) / (m + n + 2), with a confidence that is the mass of Beta(m + 1, n + 1) within mu
    +- `error`. Above `threshold` that is its trust. Else it asks all advisers for their m and n,
    called R and S; these are what they delivered. The mean of such an opinion falls into one of
    `bins` equal bins. The accuracy of the adviser, rho, is the mass in that bin of the Beta
    distribution of the judge's own outcomes after earlier opinions of the adviser in the bin. With
    mu and sd of Beta(R + 1, S + 1), the opinion is weakened:

        mu' = 1/2 + rho (mu - 1/2),   sd' = u + rho (sd - u),   u = 1 / sqrt(12)
        m'  = (mu'^2 - mu'^3) / sd'^2 - mu' - 1,   n' the same of 1 - mu'

    and all m' and n' are added to the judge's own. A rating f counts as f of a success and 1 - f of
    a failure.

    Added where the paper leaves something open: an opinion is what an adviser holds before the
    round in which the judge sees the outcome; an adviser that has seen nothing has none; a bin
    holds its lower edge; and the credence of a judge in an adviser, which the paper has of each
    opinion only, is the mean of rho over the opinions that the adviser now holds, or 1 / `bins`
    where it holds none, which is the rho of an untried opinion. The choice of advisers is not
    included: all are asked.

    The memory grows with S^2, not with S^2 P, also during a round.

    Attributes:
        error: Tolerated distance of the truth from the mean, in [0, 1].
        threshold: Confidence above which a judge asks no adviser, in [0, 1]; with 1 it always asks.
        bins: Number of equal bins for opinions, at least 1.
    """

    error: Share = 0.2
    threshold: Share = 0.95
    bins: Size = 5
    rates_raters = True
    source = "Teacy et al. (2006)"
    differentiable = False
    cost = "S^2 P"

    def start(self, like: PerPair) -> TravosState:
        """Return the state without experience. See `TrustModel.start`."""
        xp, raters = namespace(like), like.shape[0]
        none, nothing = Evidence.none(like), xp.zeros_like(like)
        untried = xp.zeros(
            (raters, raters, self.bins, *like.shape[2:]), dtype=like.dtype, device=device_of(like)
        )
        accuracy = untried + self._accuracy(
            untried[:1, :1, ...], untried[:1, :1, ...], untried[:1, :1, ...] + 1
        )
        confidence = nothing + self._confidence(
            nothing[:1, :1, ...], nothing[:1, :1, ...], nothing[:1, :1, ...] + 1
        )
        credence = untried[:, :, 0, ...] + 1 / self.bins
        return TravosState(
            none, none, untried, untried, accuracy, confidence, nothing + 0.5, credence
        )

    def update(self, state: TravosState, ratings: Ratings) -> TravosState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings.values)
        own, said = state.own.after(ratings.experience), state.said.after(ratings)
        outcomes, before = ratings.experience, self._held(state.said)
        failed = outcomes.weights - outcomes.values
        good = state.good + xp.einsum("ij...,kbj...->ikb...", outcomes.values, before)
        bad = state.bad + xp.einsum("ij...,kbj...->ikb...", failed, before)
        changed = (good != state.good) | (bad != state.bad)  # few, where ratings are sparse
        by_bin = xp.where(
            changed, self._accuracy(good, bad, cast(changed, good.dtype)), state.accuracy
        )
        changed = own.counts != state.own.counts
        confidence = self._confidence(*_outcomes(own), cast(changed, good.dtype))
        confidence = xp.where(changed, confidence, state.confidence)
        now = self._held(said)

        def advice(judges: slice) -> Array:
            accuracy = xp.einsum("ikb...,kbj...->ikj...", by_bin[judges], now)
            return xp.concat([_advised(accuracy, judges, own, said), accuracy.sum(axis=2)], axis=1)

        advised_and_right, providers = by_judges(advice, said.counts), said.counts.shape[1]
        advised, right = (
            advised_and_right[:, :providers, ...],
            advised_and_right[:, providers:, ...],
        )
        trust = xp.where(confidence > self.threshold, reputation(*_outcomes(own)), advised)
        held = now.sum(axis=1).sum(axis=1)[None]
        credence = xp.where(held > 0, right / xp.clip(held, 1, None), 1 / self.bins)
        return TravosState(own, said, good, bad, by_bin, confidence, trust, credence)

    def _held(self, said: Evidence) -> Array:
        """Return 1 for the bin of adviser k's opinion of provider j, 0 for the other bins, shape
        (S, bins, P, ...).
        """
        low, high = (edge[:, None, ...] for edge in self._edges(said.counts))
        mean = reputation(*_outcomes(said))[:, None, ...]
        known = (said.counts > 0)[:, None, ...]
        return cast(known & (low <= mean) & (mean < high), said.counts.dtype)

    def _edges(self, like: Array) -> tuple[Array, Array]:
        """Return the lower and the upper edges of the bins, shape (bins, 1, ...), with an axis for
        each batch axis.
        """
        xp, batch = namespace(like), [1] * (like.ndim - 2)
        edges = xp.asarray(
            [b / self.bins for b in range(self.bins + 1)], dtype=like.dtype, device=device_of(like)
        )
        edges = xp.reshape(edges, (self.bins + 1, *batch))
        return edges[:-1], edges[1:]

    def _accuracy(self, good: Array, bad: Array, wanted: Array) -> Array:
        """Return rho, the accuracy of opinions in each bin, shape (S, S, bins, ...); any number
        where 0 is wanted.
        """
        xp, a, b = namespace(good), good + 1, bad + 1
        inner = self._edges(good[:, 0, ...])[0][1:]
        low, high = (
            inner * wanted[:, :, 1:, ...],
            inner * wanted[:, :, :-1, ...],
        )  # 0, which costs nothing
        none = xp.zeros_like(a[:, :, :1, ...])  # the mass below 0
        below = xp.concat([none, mass_below(low, a[:, :, 1:, ...], b[:, :, 1:, ...])], axis=2)
        until = xp.concat(
            [mass_below(high, a[:, :, :-1, ...], b[:, :, :-1, ...]), none + 1], axis=2
        )
        return xp.clip(until - below, 0.0, 1.0)

    def _confidence(self, successes: Array, failures: Array, wanted: Array) -> Array:
        """Return the confidence of judges in what they saw, shape (S, P, ...); any number where 0
        is wanted.
        """
        own = reputation(successes, failures)
        low, high = (
            (own - self.error) * wanted,
            (own + self.error) * wanted,
        )  # 0, which costs nothing
        return mass_between(low, high, successes + 1, failures + 1)


def _outcomes(evidence: Evidence) -> tuple[PerPair, PerPair]:
    """Return the successes and the failures of each pair, shape (S, P, ...) each."""
    return evidence.sums, evidence.counts - evidence.sums


def _advised(accuracy: Array, judges: slice, own: Evidence, said: Evidence) -> Array:
    """Return the trust in the providers of judges that ask others, shape (judges, P, ...).

    Args:
        accuracy: Accuracy rho of the advisers' opinions, shape (judges, S, P, ...).
        judges: Places of these judges.
        own: Services that every judge received.
        said: Ratings that every adviser delivered.
    """
    opinion = reputation(*_outcomes(said))
    spread = (opinion * (1 - opinion) / (said.counts + 3)) ** 0.5
    mean = 0.5 + accuracy * (opinion - 0.5)
    strangers = others(opinion)[judges, :, None, ...]
    evidence = strangers * (mean * (1 - mean) / (_FLAT + accuracy * (spread - _FLAT)) ** 2 - 1)
    more, less = mean * evidence - strangers, (1 - mean) * evidence - strangers
    successes, failures = _outcomes(own)
    return reputation(successes[judges] + more.sum(axis=1), failures[judges] + less.sum(axis=1))
