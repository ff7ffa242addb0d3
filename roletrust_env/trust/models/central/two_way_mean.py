"""The two-way mean: a provider's mean rating, once the generosity of its raters is taken off."""

from roletrust_env.arrays import Array
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.pair_means import ByPairMeans
from roletrust_env.trust.ratings import PROVIDER, RATER, Ratings, weighted_mean


@checked_dataclass
class TwoWayMean(ByPairMeans):
    """Two-way mean: each rating is the provider's level plus the rater's generosity, and both are means of the rest.

        level[j]      = mean over the raters i of j of x[i, j] - generosity[i]
        generosity[i] = sum over the providers j that i rated of (x[i, j] - level[j]) / (their number + 1)

    where x is the mean of all ratings that i gave j so far. The 1 in the denominator stands for one rating without
    generosity, so that the level of a provider with a single rater is defined. Published are the level, clipped to
    [0, 1], and 1 minus the size of the generosity. It is the additive model of the analysis of variance.

    Attributes:
        initial: Trust of an agent without ratings, in [0, 1].
    """

    source = "Koren et al. (2009)"

    def _step(
        self, pairs: Ratings, means: Array, rated: Array, of_raters: Array, of_providers: Array
    ) -> tuple[Array, Array]:
        level = weighted_mean(pairs, means - pairs.gather(of_raters, RATER), rated, PROVIDER)
        rest = pairs.reduce(rated * (means - pairs.gather(level, PROVIDER)), RATER)
        return rest / (pairs.reduce(rated, RATER) + 1), level

    def _provider_score(self, of_providers: Array) -> Array:
        return of_providers
