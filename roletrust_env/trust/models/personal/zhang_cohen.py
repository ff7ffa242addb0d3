"""The personalised model of Zhang and Cohen: advisers weighted by private and by public
evidence.
"""

import math
from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import Inside, Lam, Share, checked_dataclass
from roletrust_env.shapes import PerAdviser, PerPair, PerRater
from roletrust_env.trees import COUNTS, SHARES, ValueRange
from roletrust_env.trust.personal import (
    Evidence,
    Personal,
    compare_opinions,
    credences,
    in_common,
    published_raters,
    weighted_advice,
)
from roletrust_env.trust.ratings import PROVIDER, Ratings, smooth


class ZhangCohenState(NamedTuple):
    """Memory of the personalised model.

    Attributes:
        common: Number of ratings of an adviser of providers that served the judge in the same
            round, shape (S, S, ...).
        agreeing: Number of these that agree, shape (S, S, ...).
        checked: Number of ratings of each adviser that others could be compared with, shape (S,
            ...).
        consistent: Number of these near the others' mean, shape (S, ...).
        trust: Trust of each judge in each provider, shape (S, P, ...).
    """

    common: Annotated[PerAdviser, COUNTS]
    agreeing: Annotated[PerAdviser, ValueRange(0, "common")]
    checked: Annotated[PerRater, COUNTS]
    consistent: Annotated[PerRater, ValueRange(0, "checked")]
    trust: Annotated[PerPair, SHARES]


@checked_dataclass
class ZhangCohen(Personal):
    """Zhang-Cohen: advisers weighted by agreement with the judge, and with all raters while
    evidence is scarce.

        private = (agreeing + 1) / (N + 2)
                over the N ratings that the adviser has in common with the judge
        public  = (consistent + 1) / (all + 2)
                over all ratings by the adviser; near the others' mean is consistent
        w       = min(1, N / N_min),   N_min = -ln((1 - confidence) / 2) / (2 error^2)
        C       = w private + (1 - w) public
        T       = C-weighted mean of opinions, then the usual smoothing

    Zhang and Cohen (2008). A rating of an adviser and a service of the judge are in common if they
    are of one provider in one round, and agree to the share `1 - |f - g|`: with f of a success and
    1 - f of a failure each, that is what both hold. Added where the paper leaves something open:
    the others' mean is that of the same round, and a rating with no other beside it counts in
    neither; opinions are the ratings of the round, and with C = 1 the services of the judge itself;
    the rounds are smoothed where the paper has sums that forget.

    Attributes:
        lam: Weight of the newest round in the trust of a provider, in [0.5, 1).
        initial: Trust of a provider before any rating, in [0, 1]; credence begins at 1/2.
        tolerance: Maximum distance of a consistent rating from the others' mean, in [0, 1].
        confidence: Confidence at which the private credence counts alone, in [0.001, 0.999].
        error: Tolerated error of the private credence, in [0.001, 0.999].
    """

    lam: Lam = 0.5
    initial: Share = 0.5
    tolerance: Share = 0.1
    confidence: Inside = 0.8
    error: Inside = 0.25
    rates_raters = True
    source = "Zhang and Cohen (2008)"
    differentiable = False
    cost = "S^2 P"

    @property
    def enough(self) -> float:
        """Number of common ratings N_min from which the private credence counts alone."""
        return -math.log((1 - self.confidence) / 2) / (2 * self.error**2)

    def start(self, like: PerPair) -> ZhangCohenState:
        """Return the state with initial trust and without evidence about advisers. See
        `TrustModel.start`.
        """
        nothing, pairs = namespace(like).zeros_like(like), credences(like, 0.0)
        nobody = nothing[:, 0, ...]
        return ZhangCohenState(pairs, pairs, nobody, nobody, nothing + self.initial)

    def update(self, state: ZhangCohenState, ratings: Ratings) -> ZhangCohenState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        checked, consistent = self._consistency(ratings)
        evidence = (
            state.common + in_common(ratings),
            state.agreeing + compare_opinions(ratings, lambda apart: 1 - apart),
            state.checked + checked,
            state.consistent + consistent,
        )
        credence = self._credence(*evidence)
        advice, weight = weighted_advice(
            credence, Evidence.of(ratings), Evidence.of(ratings.experience)
        )
        return ZhangCohenState(*evidence, smooth(advice, state.trust, self.lam, weight))

    def _consistency(self, ratings: Ratings) -> tuple[Array, Array]:
        """Return how many of each rater's ratings can be compared with others, and how many of
        these are consistent.
        """
        xp = namespace(ratings.values)
        beside = ratings.count(PROVIDER) - ratings.weights
        others_mean = (ratings.values.sum(axis=0) - ratings.values) / xp.where(
            beside > 0, beside, 1.0
        )
        checked = xp.where(beside > 0, ratings.weights, 0.0)
        near = abs(ratings.values - others_mean) <= self.tolerance
        return checked.sum(axis=1), xp.where(near, checked, 0.0).sum(axis=1)

    def _credence(self, common: Array, agreeing: Array, checked: Array, consistent: Array) -> Array:
        """Return the credence C, shape (S, S, ...)."""
        private = (agreeing + 1) / (common + 2)
        public = ((consistent + 1) / (checked + 2))[None, ...]
        return public + namespace(common).clip(common / self.enough, 0.0, 1.0) * (private - public)

    def rater_trust(self, state: ZhangCohenState) -> PerRater:
        """Return the other judges' mean credence in each rater, shape (S, ...)."""
        return published_raters(self._credence(*state[:4]))
