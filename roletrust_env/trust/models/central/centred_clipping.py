"""Centred clipping of the raters' vectors: nobody pulls the centre further than a radius."""

from typing import Annotated

from pydantic import Field

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.rating_vectors import ByRatingVectors
from roletrust_env.trust.ratings import PROVIDER, Ratings, weighted_mean


@checked_dataclass
class CentredClipping(ByRatingVectors):
    """Centred clipping: each rater pulls the centre with its gap to it, cut to the length of a radius.

    Karimireddy, He and Jaggi, "Learning from History for Byzantine Robust Optimization" (2021), for vectors with
    missing entries:

        c[j] <- c[j] + mean over the raters i of j of (x[i, j] - c[j]) min(1, radius / d[i])

    with d, x and both trusts as in `ByRatingVectors`. At most 60 iterations start from 1/2; the paper takes one or a
    few from the result of the round before.

    Attributes:
        initial: Trust of an agent without ratings, in [0, 1].
        radius: Greatest length of a pull, above 0, where a single rating has a gap of at most 1.
    """

    radius: Annotated[float, Field(ge=0.01, le=100)] = 0.5

    source = "Karimireddy et al. (2021)"

    def _weight(self, distance: Array) -> Array:
        return self.radius / namespace(distance).clip(distance, self.radius, None)

    def _moved(self, pairs: Ratings, apart: Array, rated: Array, weights: Array) -> Array:
        return weighted_mean(pairs, apart * weights, rated, PROVIDER)
