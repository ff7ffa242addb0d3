"""The common part of models that take a rater's ratings as a vector, as machine learning takes a worker's gradient."""

from abc import abstractmethod

from roletrust_env.arrays import Array
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.pair_means import ByPairMeans
from roletrust_env.trust.ratings import PROVIDER, RATER, Ratings, weighted_mean


@checked_dataclass
class ByRatingVectors(ByPairMeans):
    """Base of trust models that seek a robust centre of the raters' vectors. A missing rating agrees with the centre.

        d[i] = root of the sum over the providers j that i rated of (x[i, j] - c[j])^2
        T[j] = c[j]
        R[i] = 1 - d[i] / root of the number of providers that i rated

    where x[i, j] is the mean of all ratings that i gave j so far. The trust in raters is this project's choice.

    Attributes:
        initial: Trust of an agent without ratings, in [0, 1].
    """

    def _first(self, pairs: Ratings, rated: Array) -> tuple[Array, Array]:
        """Return what the iteration starts from: the middle of the scale."""
        of_raters, of_providers = super()._first(pairs, rated)
        return of_raters, of_providers + 0.5

    def _step(
        self, pairs: Ratings, means: Array, rated: Array, of_raters: Array, of_providers: Array
    ) -> tuple[Array, Array]:
        apart = rated * (means - pairs.gather(of_providers, PROVIDER))
        distance = pairs.reduce(apart * apart, RATER) ** 0.5
        centre = of_providers + self._moved(pairs, apart, rated, pairs.gather(self._weight(distance), RATER))
        apart = means - pairs.gather(centre, PROVIDER)
        return weighted_mean(pairs, apart * apart, rated, RATER) ** 0.5, centre

    @abstractmethod
    def _weight(self, distance: Array) -> Array:
        """Return the weight of each rater by its distance from the centre, shape (S, ...)."""

    @abstractmethod
    def _moved(self, pairs: Ratings, apart: Array, rated: Array, weights: Array) -> Array:
        """Return how far the centre moves, shape (P, ...), from the gaps between ratings and centre."""

    def _provider_score(self, of_providers: Array) -> Array:
        return of_providers
