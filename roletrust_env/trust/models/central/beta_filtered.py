"""Beta reputation without the raters that are unlikely given the ratings of the others."""

from typing import NamedTuple

from roletrust_env.arrays import Array, cast, is_compiling, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import Share, Tail
from roletrust_env.trust.algorithms import MaskedRatings
from roletrust_env.trust.beta import between_quantiles, reputation
from roletrust_env.trust.models.central.beta import left

_PASSES = 12
"""Maximum number of filter passes. Each drops some raters and none drops all, so S - 1 suffice; 30 raters took 9."""


class BetaFilteredState(NamedTuple):
    """Memory of filtered Beta reputation.

    Attributes:
        successes: Evidence r, by rater and provider, shape (S, P, ...).
        failures: Evidence s, shape (S, P, ...).
        top: Trust of the providers, shape (P, ...).
        tor: Trust of the raters, shape (S, ...).
    """

    successes: Array
    failures: Array
    top: Array
    tor: Array


@checked_dataclass
class BetaFiltered:
    """Filtered Beta reputation: raters whose ratings make the overall mean too unlikely do not count.

    Whitby, Jøsang and Indulska, "Filtering Out Unfair Ratings in Bayesian Reputation Systems" (2004). A rater's ratings
    of a provider give Beta(1 + r, 1 + s). For each provider, the filter drops all raters whose distribution has its `q`
    quantile above the aggregate mean or its 1 - `q` quantile below it. It repeats this with the mean of the remaining
    raters until it drops no more, at most 12 times. Only crowds may need more. All raters take part again in the next
    round.

    Evidence is counted, fades and has a base rate as in `Beta`. Where no rater is dropped, the model equals `Beta`.

    The paper leaves two things open. It has no trust in raters: here, that is the share of the providers rated by a
    rater for which the filter did not drop it. And a pass that would drop all raters ends the filter and drops none: in
    a crowd of over a hundred raters with perfect ratings, the mean is nearer to 1 than the upper quantile of any rater.

    Attributes:
        keep: Share of the evidence of earlier rounds that is kept each round, in [0, 1]; 1 forgets nothing.
        initial: Trust before any rating, in [0, 1].
        q: Probability that is cut off at either end of a rater's distribution, in [1e-6, 0.5).
    """

    keep: Share = 0.9
    initial: Share = 0.5
    q: Tail = 0.01
    rates_raters = True
    source = "Whitby, Jøsang and Indulska (2004)"
    differentiable = False
    takes_full_rounds = True

    def start(self, like: Array) -> BetaFilteredState:
        """Return the state without evidence. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return BetaFilteredState(nothing, nothing, nothing[0] + self.initial, nothing[:, 0, ...] + self.initial)

    def update(self, state: BetaFilteredState, ratings: Array, mask: Array | None) -> BetaFilteredState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        masked = MaskedRatings.of(ratings, mask)
        kept = left(self.keep, masked)
        successes = kept * state.successes + masked.values
        failures = kept * state.failures + ((1 if masked.weights is None else masked.weights) - masked.values)
        heard = self._filter(successes, failures)
        top = reputation((heard * successes).sum(axis=0), (heard * failures).sum(axis=0), self.initial)
        return BetaFilteredState(successes, failures, top, self._share(heard, successes + failures))

    def _filter(self, successes: Array, failures: Array) -> Array:
        """Return 1 for each rater that counts for a provider and 0 for each that is dropped, shape (S, P, ...)."""
        xp = namespace(successes)
        is_likely = between_quantiles(self.q, 1 + successes, 1 + failures)
        evident = successes + failures > 0
        heard = xp.ones_like(successes)
        for _ in range(min(successes.shape[0] - 1, _PASSES)):
            before = heard
            mean = reputation((heard * successes).sum(axis=0), (heard * failures).sum(axis=0), self.initial)
            still = heard * cast(is_likely(mean), heard.dtype)
            heard = xp.where(xp.any((still > 0) & evident, axis=0), still, heard)
            if not is_compiling(heard) and bool(xp.all(heard == before)):
                break  # all other passes would do the same
        return heard

    def _share(self, heard: Array, evidence: Array) -> Array:
        """Return the share of the providers rated by each rater for which it was not dropped, shape (S, ...)."""
        xp = namespace(heard)
        rated = cast(evidence > 0, heard.dtype)
        count = rated.sum(axis=1)
        return xp.where(count > 0, (heard * rated).sum(axis=1) / xp.clip(count, 1, None), self.initial)

    def rater_trust(self, state: BetaFilteredState) -> Array:
        """Return the share of providers for which a rater counts, shape (S, ...); `initial` if it rated none."""
        return state.tor

    def provider_trust(self, state: BetaFilteredState) -> Array:
        """Return the Beta reputation by the raters that count, shape (P, ...)."""
        return state.top
