"""Fairness and goodness: providers are as good as fair raters say, and raters as fair as they are near to it."""

from roletrust_env.arrays import Array
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.pair_means import ByPairMeans
from roletrust_env.trust.ratings import PROVIDER, RATER, Ratings, weighted_mean


@checked_dataclass
class FairnessGoodness(ByPairMeans):
    """Fairness and goodness: a rater is fair as far as its ratings agree with the goodness that fair raters find.

    Kumar, Spezzano, Subrahmanian and Faloutsos, "Edge Weight Prediction in Weighted Signed Networks" (2016):

        g[j] = mean over the raters i of j of f[i] w[i, j]
        f[i] = 1 - mean over the providers j that i rated of |w[i, j] - g[j]| / 2

    with w = 2 x - 1, where x is the mean of all ratings that i gave j so far; in the paper a pair has one rating. The
    iteration starts from f = 1, and its error halves in each step. Published are f and (g + 1) / 2.

    Attributes:
        initial: Trust of an agent without ratings, in [0, 1].
    """

    source = "Kumar et al. (2016)"

    def _first(self, pairs: Ratings, rated: Array) -> tuple[Array, Array]:
        of_raters, of_providers = super()._first(pairs, rated)
        return of_raters + 1, of_providers

    def _step(
        self, pairs: Ratings, means: Array, rated: Array, of_raters: Array, of_providers: Array
    ) -> tuple[Array, Array]:
        weight = 2 * means - 1
        goodness = weighted_mean(pairs, pairs.gather(of_raters, RATER) * weight, rated, PROVIDER)
        apart = abs(weight - pairs.gather(goodness, PROVIDER)) / 2
        return 1 - weighted_mean(pairs, apart, rated, RATER), goodness

    def _rater_score(self, of_raters: Array) -> Array:
        return of_raters
