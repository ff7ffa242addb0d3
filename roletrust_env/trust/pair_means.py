"""The common part of models that judge from the mean of all ratings of each pair so far."""

from abc import abstractmethod
from typing import NamedTuple

from roletrust_env.arrays import Array, is_compiling, namespace
from roletrust_env.parameters import Share, checked_dataclass
from roletrust_env.trust.ratings import PROVIDER, RATER, PerPair, PerProvider, PerRater, Ratings

STEPS = 60
"""Maximum number of iterations. NumPy stops when only rounding moves."""

_REST = 1e-15


class PairMeansState(NamedTuple):
    """Memory of a model that judges from the means of pairs.

    Attributes:
        tor: Trust of the raters, shape (S, ...).
        top: Trust of the providers, shape (P, ...).
        sums: Sum of the ratings of each pair, shape (S, P, ...).
        counts: Number of ratings of each pair, shape (S, P, ...).
    """

    tor: PerRater
    top: PerProvider
    sums: PerPair
    counts: PerPair


@checked_dataclass
class ByPairMeans:
    """Base of trust models that are defined by equations between raters and providers, over the means of the pairs.

    Attributes:
        initial: Trust of an agent without ratings, in [0, 1].
    """

    initial: Share = 0.5
    rates_raters = True

    def start(self, like: Array) -> PairMeansState:
        """Return the state before any rating. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return PairMeansState(nothing[:, 0, ...] + self.initial, nothing[0] + self.initial, nothing, nothing)

    def update(self, state: PairMeansState, ratings: Ratings) -> PairMeansState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp, pairs, none = namespace(ratings.values), ratings.pairs, 0 * state.sums
        sums = state.sums + ratings.write(none, ratings.values)
        counts = state.counts + ratings.write(none, 1.0)
        rated = xp.where(counts > 0, none + 1, none)
        of_raters, of_providers = self._solved(pairs, sums / xp.where(counts > 0, counts, 1.0), rated)
        given, received = pairs.reduce(rated, RATER), pairs.reduce(rated, PROVIDER)
        tor = xp.where(given > 0, xp.clip(self._rater_score(of_raters), 0.0, 1.0), self.initial)
        top = xp.where(received > 0, xp.clip(self._provider_score(of_providers), 0.0, 1.0), self.initial)
        return PairMeansState(tor, top, sums, counts)

    def _solved(self, pairs: Ratings, means: Array, rated: Array) -> tuple[Array, Array]:
        """Return the solution of the equations: a number for each rater and one for each provider."""
        xp = namespace(means)
        of_raters, of_providers = self._first(pairs, rated)
        for _ in range(STEPS):
            before = of_providers
            of_raters, of_providers = self._step(pairs, means, rated, of_raters, of_providers)
            if not is_compiling(means) and bool(xp.all(abs(of_providers - before) <= _REST)):
                break
        return of_raters, of_providers

    def _first(self, pairs: Ratings, rated: Array) -> tuple[Array, Array]:
        """Return what the iteration starts from."""
        return 0 * pairs.reduce(rated, RATER), 0 * pairs.reduce(rated, PROVIDER)

    @abstractmethod
    def _step(
        self, pairs: Ratings, means: Array, rated: Array, of_raters: Array, of_providers: Array
    ) -> tuple[Array, Array]:
        """Return the numbers of raters and of providers after one more iteration; `rated` is 1 for known pairs."""

    def _rater_score(self, of_raters: Array) -> Array:
        """Return the trust in raters that follows from their numbers: 1 without a bias."""
        return 1 - abs(of_raters)

    def _provider_score(self, of_providers: Array) -> Array:
        """Return the trust in providers that follows from their numbers, of a scale from -1 to 1."""
        return (of_providers + 1) / 2

    def rater_trust(self, state: PairMeansState) -> Array:
        """Return the trust of the raters, shape (S, ...)."""
        return state.tor

    def provider_trust(self, state: PairMeansState) -> Array:
        """Return the trust of the providers, shape (P, ...)."""
        return state.top
