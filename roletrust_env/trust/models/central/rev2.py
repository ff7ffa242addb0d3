"""REV2: fairness of raters, reliability of ratings and goodness of providers, each drawn to the mean of all."""

from pydantic import NonNegativeFloat

from roletrust_env.arrays import Array, namespace, total
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.pair_means import ByPairMeans
from roletrust_env.trust.ratings import PROVIDER, RATER, TINY, Ratings


@checked_dataclass
class Rev2(ByPairMeans):
    """REV2: a rating is reliable if its rater is fair and it is near to the goodness of the provider.

    Kumar, Hooi, Makhija, Kumar, Faloutsos and Subrahmanian, "REV2: Fraudulent User Prediction in Rating Platforms"
    (2018), without the terms of behaviour, which need texts and times:

        G[j]    = (beta mean of G + sum over the raters i of j of R[i, j] w[i, j]) / (beta + number of raters of j)
        R[i, j] = (F[i] + 1 - |w[i, j] - G[j]| / 2) / 2
        F[i]    = (alpha mean of F + sum over the providers j that i rated of R[i, j]) / (alpha + number of these)

    with w = 2 x - 1, where x is the mean of all ratings that i gave j so far; in the paper a pair has one rating. Means
    are over agents with ratings; the authors' code takes medians and names means as the alternative. The iteration
    starts from F = G = 1. Published are F and (G + 1) / 2.

    Attributes:
        initial: Trust of an agent without ratings, in [0, 1].
        alpha: Number of ratings by which a rater is drawn to the mean fairness.
        beta: Number of ratings by which a provider is drawn to the mean goodness.
    """

    alpha: NonNegativeFloat = 1.0
    beta: NonNegativeFloat = 1.0

    source = "Kumar et al. (2018)"

    def _first(self, pairs: Ratings, rated: Array) -> tuple[Array, Array]:
        of_raters, of_providers = super()._first(pairs, rated)
        return of_raters + 1, of_providers + 1

    def _step(
        self, pairs: Ratings, means: Array, rated: Array, of_raters: Array, of_providers: Array
    ) -> tuple[Array, Array]:
        weight, fair = 2 * means - 1, pairs.gather(of_raters, RATER)
        given, received = pairs.reduce(rated, RATER), pairs.reduce(rated, PROVIDER)
        reliable = (fair + 1 - abs(weight - pairs.gather(of_providers, PROVIDER)) / 2) / 2
        votes = pairs.reduce(rated * reliable * weight, PROVIDER)
        goodness = (self.beta * _mean(of_providers, received) + votes) / (self.beta + received + TINY)
        reliable = (fair + 1 - abs(weight - pairs.gather(goodness, PROVIDER)) / 2) / 2
        fairness = self.alpha * _mean(of_raters, given) + pairs.reduce(rated * reliable, RATER)
        return fairness / (self.alpha + given + TINY), goodness

    def _rater_score(self, of_raters: Array) -> Array:
        return of_raters


def _mean(values: Array, ratings: Array) -> Array:
    """Return the mean over the agents with ratings, along the first axis."""
    there = namespace(values).where(ratings > 0, 0 * values + 1, 0.0)
    return total(there * values, 0) / (total(there, 0) + TINY)
