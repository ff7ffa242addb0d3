"""The personalised model of Zhang and Cohen: advisers by what the judge saw of them and by what everybody sees."""

import math
from typing import NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import Inside, Lam, Share
from roletrust_env.trust.algorithms import Notes, smooth
from roletrust_env.trust.judges import (
    compared,
    credences,
    heeded,
    in_common,
    published_providers,
    published_raters,
    with_self,
)


class ZhangCohenState(NamedTuple):
    """What the personalised model remembers.

    Attributes:
        common: number of ratings of one provider in one round by both judge and adviser, shape (S, S, ...).
        agreeing: how many of them agree, shape (S, S, ...).
        checked: number of ratings of each adviser that others could be compared with, shape (S, ...).
        consistent: how many of them are near the others' mean, shape (S, ...).
        trust: of each judge in each provider, shape (S, P, ...).
    """

    common: Array
    agreeing: Array
    checked: Array
    consistent: Array
    trust: Array


@checked_dataclass
class ZhangCohen:
    """Personalised: advisers believed by their agreement with the judge, and with everybody while that is little.

        private = (agreeing + 1) / (N + 2)         over the N ratings that judge and adviser have in common
        public  = (consistent + 1) / (all + 2)     over all ratings by the adviser; near the others' mean is consistent
        w       = min(1, N / N_min),   N_min = -ln((1 - confidence) / 2) / (2 error^2)
        C       = w private + (1 - w) public
        T       = C-weighted mean of opinions, then the usual smoothing

    Zhang and Cohen (2008). Two ratings are in common if they are of one provider in one round, and agree to the share
    `1 - |f - g|`: with f of a success and 1 - f of a failure each, that is what both hold. Read into it: the others'
    mean is that of the same round, and a rating with no other beside it counts in neither; opinions are the ratings of
    the round, the judge's own among them with C = 1; the rounds are smoothed where the paper has sums that forget.

    Attributes:
        lam: weight of the newest round in the trust of a provider, in [0.5, 1).
        initial: trust of a provider before any rating, in [0, 1]; credence begins at 1/2.
        tolerance: how far from the others' mean a rating is still consistent, in [0, 1].
        confidence: that the private credence must deserve to count alone, in [0.001, 0.999].
        error: of the private credence that is put up with, in [0.001, 0.999].
    """

    lam: Lam = 0.5
    initial: Share = 0.5
    tolerance: Share = 0.1
    confidence: Inside = 0.8
    error: Inside = 0.25
    rates_raters = True
    family = "personal"
    source = "Zhang and Cohen (2008)"
    smooth = False
    cost = "S^2 P"

    @property
    def enough(self) -> float:
        """N_min: from so many ratings in common the private credence counts alone."""
        return -math.log((1 - self.confidence) / 2) / (2 * self.error**2)

    def start(self, like: Array) -> ZhangCohenState:
        """Initial trust for every provider, and nothing known of advisers. See `TrustModel.start`."""
        nothing, pairs = namespace(like).zeros_like(like), credences(like, 0.0)
        nobody = nothing[:, 0, ...]
        return ZhangCohenState(pairs, pairs, nobody, nobody, nothing + self.initial)

    def update(self, state: ZhangCohenState, ratings: Array, mask: Array) -> ZhangCohenState:
        """One round of ratings. See `TrustModel.update`."""
        notes = Notes.of(ratings, mask)
        checked, consistent = self._consistency(notes)
        evidence = (
            state.common + in_common(notes.weights),
            state.agreeing + compared(notes.values, notes.weights, lambda apart: 1 - apart),
            state.checked + checked,
            state.consistent + consistent,
        )
        credence = self._credence(*evidence)
        heard, weight = heeded(with_self(credence), notes.values, notes.weights)
        return ZhangCohenState(*evidence, smooth(heard, state.trust, self.lam, weight))

    def _consistency(self, notes: Notes) -> tuple[Array, Array]:
        """Of each rater's notes, how many have others beside them, and how many of these are near the others' mean."""
        xp = namespace(notes.values)
        beside = notes.received - notes.weights
        others_mean = (notes.values.sum(axis=0) - notes.values) / xp.where(beside > 0, beside, 1.0)
        checked = xp.where(beside > 0, notes.weights, 0.0)
        near = abs(notes.values - others_mean) <= self.tolerance
        return checked.sum(axis=1), xp.where(near, checked, 0.0).sum(axis=1)

    def _credence(self, common: Array, agreeing: Array, checked: Array, consistent: Array) -> Array:
        """C, shape (S, S, ...)."""
        private = (agreeing + 1) / (common + 2)
        public = ((consistent + 1) / (checked + 2))[None, ...]
        return public + namespace(common).clip(common / self.enough, 0.0, 1.0) * (private - public)

    def rater_trust(self, state: ZhangCohenState) -> Array:
        """The mean of the other judges' credence in each rater, shape (S, ...)."""
        return published_raters(self._credence(*state[:4]))

    def provider_trust(self, state: ZhangCohenState) -> Array:
        """The mean of the judges' trust, shape (P, ...)."""
        return published_providers(state.trust)
