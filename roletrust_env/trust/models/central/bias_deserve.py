"""Bias and deserve: what a provider deserves, once the praise and blame of biased raters is taken back."""

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.pair_means import ByPairMeans
from roletrust_env.trust.ratings import PROVIDER, RATER, Ratings, weighted_mean


@checked_dataclass
class BiasDeserve(ByPairMeans):
    """Bias and deserve: a rating in the direction of its rater's bias counts less.

    Mishra and Bhattacharya, "Finding the Bias and Prestige of Nodes in Networks Based on Trust Scores" (2011):

        bias[i]    = mean over the providers j that i rated of (w[i, j] - deserve[j]) / 2
        deserve[j] = mean over the raters i of j of w[i, j] (1 - x[i, j])
        x[i, j]    = |bias[i]| if bias[i] w[i, j] > 0, else 0

    with w = 2 m - 1, where m is the mean of all ratings that i gave j so far. The iteration starts from a bias of 0.
    Published are 1 minus the size of the bias, which is this project's choice, and (deserve + 1) / 2. Later comparisons
    write x in two ways: as here, or with the product of bias and w in place of the size of the bias, which is the same
    where w is -1, 0 or 1.

    Attributes:
        initial: Trust of an agent without ratings, in [0, 1].
    """

    source = "Mishra and Bhattacharya (2011)"

    def _step(
        self, pairs: Ratings, means: Array, rated: Array, of_raters: Array, of_providers: Array
    ) -> tuple[Array, Array]:
        xp, weight = namespace(means), 2 * means - 1
        bias = pairs.gather(of_raters, RATER)
        taken = xp.where(bias * weight > 0, abs(bias), 0.0)
        deserve = weighted_mean(pairs, weight * (1 - taken), rated, PROVIDER)
        apart = (weight - pairs.gather(deserve, PROVIDER)) / 2
        return weighted_mean(pairs, apart, rated, RATER), deserve
