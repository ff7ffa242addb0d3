"""Beta reputation that leaves out raters whom the others' ratings make unlikely."""

from typing import NamedTuple

from roletrust_env.arrays import Array, cast, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import Share, Tail
from roletrust_env.trust.algorithms import Notes
from roletrust_env.trust.beta import quantile, reputation
from roletrust_env.trust.models.central.beta import left

_PASSES = 12
"""Most passes of the filter. Each drops somebody and none drops all, so S - 1 end it; 30 raters took 9 at most."""


class BetaFilteredState(NamedTuple):
    """What filtered Beta reputation remembers.

    Attributes:
        successes: r, by rater and provider, shape (S, P, ...).
        failures: s, shape (S, P, ...).
        top: trust of the providers, shape (P, ...).
        tor: trust of the raters, shape (S, ...).
    """

    successes: Array
    failures: Array
    top: Array
    tor: Array


@checked_dataclass
class BetaFiltered:
    """Filtered Beta reputation: ratings by whom the majority's mean would be too unlikely do not count.

    Whitby, Jøsang and Indulska, "Filtering Out Unfair Ratings in Bayesian Reputation Systems" (2004). A rater's ratings
    of a provider speak for Beta(1 + r, 1 + s). For each provider, all raters whose distribution has its `q` quantile
    above or its 1 - `q` quantile below the aggregate mean are dropped, and so again with the mean of those that are
    left, until nobody is dropped; after 12 passes, of which only crowds may need more, whoever is left stays. Everybody
    is heard again in the next round.

    Evidence is counted, fades and has a base rate as in `Beta`, which this model is where nobody is dropped.

    Read into the paper: a rater's trust, of which it has none, is the share of the providers it has rated for which it
    was kept. And a pass that would drop everybody ends the filter and drops nobody: in a crowd of over a hundred
    raters who find a provider perfect, the mean comes nearer to 1 than the upper quantile of any of them.

    Attributes:
        keep: what is left of the evidence of earlier rounds, in [0, 1]; 1 forgets nothing.
        initial: trust before any rating, in [0, 1].
        q: the probability cut off at either end of a rater's distribution, in [1e-6, 0.5); the less, the more pass.
    """

    keep: Share = 0.9
    initial: Share = 0.5
    q: Tail = 0.01
    rates_raters = True
    source = "Whitby, Jøsang and Indulska (2004)"
    smooth = False
    takes_full_rounds = True

    def start(self, like: Array) -> BetaFilteredState:
        """No evidence of anybody. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return BetaFilteredState(nothing, nothing, nothing[0] + self.initial, nothing[:, 0, ...] + self.initial)

    def update(self, state: BetaFilteredState, ratings: Array, mask: Array | None) -> BetaFilteredState:
        """One round of ratings. See `TrustModel.update`."""
        notes = Notes.of(ratings, mask)
        kept = left(self.keep, notes)
        successes = kept * state.successes + notes.values
        failures = kept * state.failures + ((1 if notes.weights is None else notes.weights) - notes.values)
        heard = self._filter(successes, failures)
        top = reputation((heard * successes).sum(axis=0), (heard * failures).sum(axis=0), self.initial)
        return BetaFilteredState(successes, failures, top, self._share(heard, successes + failures))

    def _filter(self, successes: Array, failures: Array) -> Array:
        """1 for each rater that is kept for a provider and 0 for each that is dropped, shape (S, P, ...)."""
        xp = namespace(successes)
        a, b = 1 + successes, 1 + failures
        low, below_one = quantile(self.q, xp.stack([a, b]), xp.stack([b, a]))  # for a compiler, one is half of two
        evident = successes + failures > 0
        heard = xp.ones_like(successes)
        for _ in range(min(successes.shape[0] - 1, _PASSES)):
            mean = reputation((heard * successes).sum(axis=0), (heard * failures).sum(axis=0), self.initial)
            still = heard * cast((low <= mean) & (mean <= 1 - below_one), heard.dtype)
            heard = xp.where(xp.any((still > 0) & evident, axis=0), still, heard)
        return heard

    def _share(self, heard: Array, evidence: Array) -> Array:
        """Of the providers that each rater has rated, the share for which it was kept, shape (S, ...)."""
        xp = namespace(heard)
        rated = cast(evidence > 0, heard.dtype)
        count = rated.sum(axis=1)
        return xp.where(count > 0, (heard * rated).sum(axis=1) / xp.clip(count, 1, None), self.initial)

    def rater_trust(self, state: BetaFilteredState) -> Array:
        """The share of providers for which a rater is kept, shape (S, ...); `initial` for one that has rated nobody."""
        return state.tor

    def provider_trust(self, state: BetaFilteredState) -> Array:
        """The Beta reputation by the raters that are kept, shape (P, ...)."""
        return state.top
