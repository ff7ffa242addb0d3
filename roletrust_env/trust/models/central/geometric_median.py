"""The geometric median of the raters' vectors: the point with the least sum of distances."""

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.rating_vectors import ByRatingVectors
from roletrust_env.trust.ratings import PROVIDER, Ratings, weighted_mean

_NEAREST = 1e-4  # distances below this count as this; Weiszfeld's weights are otherwise without limit


@checked_dataclass
class GeometricMedian(ByRatingVectors):
    """Geometric median: the centre has the least sum of distances to the vectors of ratings of the raters.

    Pillutla, Kakade and Harchaoui, "Robust Aggregation for Federated Learning" (2022), by the smoothed algorithm of
    Weiszfeld, for vectors with missing entries:

        c[j] <- sum over the raters i of j of x[i, j] / max(d[i], 1e-4) / sum over them of 1 / max(d[i], 1e-4)

    with d, x and both trusts as in `ByRatingVectors`. At most 60 iterations start from 1/2.

    Attributes:
        initial: Trust of an agent without ratings, in [0, 1].
    """

    source = "Pillutla et al. (2022)"

    def _weight(self, distance: Array) -> Array:
        return 1 / namespace(distance).clip(distance, _NEAREST, None)

    def _moved(self, pairs: Ratings, apart: Array, rated: Array, weights: Array) -> Array:
        return weighted_mean(pairs, apart, rated * weights, PROVIDER)
