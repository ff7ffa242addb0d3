"""Models of neighbouring fields, for logs of real ratings: signed networks, analysis of variance
and machine learning.

They judge from the mean of all ratings of each pair so far, and are not in the registry, so that
suites that play all models stay as they are.
"""

from abc import ABC, abstractmethod
from typing import Annotated, Any, NamedTuple

from pydantic import Field

from roletrust_env.arrays import Array, is_compiling, namespace, total
from roletrust_env.errors import suggest
from roletrust_env.evaluation.specs import parse_named
from roletrust_env.parameters import Amount, Share, checked_dataclass
from roletrust_env.shapes import PerPair, PerProvider, PerRater
from roletrust_env.trees import COUNTS, SHARES, ValueRange
from roletrust_env.trust.model import registry
from roletrust_env.trust.ratings import PROVIDER, RATER, TINY, Published, Ratings, weighted_mean

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

    tor: Annotated[PerRater, SHARES]
    top: Annotated[PerProvider, SHARES]
    sums: Annotated[PerPair, ValueRange(0, "counts")]
    counts: Annotated[PerPair, COUNTS]


@checked_dataclass
class ByPairMeans(Published, ABC):
    """Base of trust models that are defined by equations between raters and providers, over the
    means of the pairs.

    Attributes:
        initial: Trust of an agent without ratings, in [0, 1].
    """

    initial: Share = 0.5
    rates_raters = True

    def start(self, like: Array) -> PairMeansState:
        """Return the state before any rating. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return PairMeansState(
            nothing[:, 0, ...] + self.initial, nothing[0] + self.initial, nothing, nothing
        )

    def update(self, state: PairMeansState, ratings: Ratings) -> PairMeansState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp, pairs, none = namespace(ratings.values), ratings.pairs, 0 * state.sums
        sums = state.sums + ratings.write(none, ratings.values)
        counts = state.counts + ratings.write(none, 1.0)
        rated = xp.where(counts > 0, none + 1, none)
        of_raters, of_providers = self._solved(
            pairs, sums / xp.where(counts > 0, counts, 1.0), rated
        )
        given, received = pairs.reduce(rated, RATER), pairs.reduce(rated, PROVIDER)
        tor = xp.where(given > 0, xp.clip(self._rater_score(of_raters), 0.0, 1.0), self.initial)
        top = xp.where(
            received > 0, xp.clip(self._provider_score(of_providers), 0.0, 1.0), self.initial
        )
        return PairMeansState(tor, top, sums, counts)

    def _solved(self, pairs: Ratings, means: Array, rated: Array) -> tuple[Array, Array]:
        """Return the solution of the equations: a number for each rater and one for each
        provider.
        """
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
        """Return the numbers of raters and of providers after one more iteration; `rated` is 1 for
        known pairs.
        """

    def _rater_score(self, of_raters: Array) -> Array:
        """Return the trust in raters that follows from their numbers: 1 without a bias."""
        return 1 - abs(of_raters)

    def _provider_score(self, of_providers: Array) -> Array:
        """Return the trust in providers that follows from their numbers, of a scale from -1 to
        1.
        """
        return (of_providers + 1) / 2


@checked_dataclass
class FairnessGoodness(ByPairMeans):
    """Fairness and goodness: a rater is fair as far as its ratings agree with the goodness that
    fair raters find.

    Kumar, Spezzano, Subrahmanian and Faloutsos, "Edge Weight Prediction in Weighted Signed
    Networks" (2016):

        g[j] = mean over the raters i of j of f[i] w[i, j]
        f[i] = 1 - mean over the providers j that i rated of |w[i, j] - g[j]| / 2

    with w = 2 x - 1, where x is the mean of all ratings that i gave j so far; in the paper a pair
    has one rating. The iteration starts from f = 1, and its error halves in each step. Published
    are f and (g + 1) / 2.
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


@checked_dataclass
class BiasDeserve(ByPairMeans):
    """Bias and deserve: a rating in the direction of its rater's bias counts less.

    Mishra and Bhattacharya, "Finding the Bias and Prestige of Nodes in Networks Based on Trust
    Scores" (2011):

        bias[i]    = mean over the providers j that i rated of (w[i, j] - deserve[j]) / 2
        deserve[j] = mean over the raters i of j of w[i, j] (1 - x[i, j])
        x[i, j]    = |bias[i]| if bias[i] w[i, j] > 0, else 0

    with w = 2 m - 1, where m is the mean of all ratings that i gave j so far. The iteration starts
    from a bias of 0. Published are 1 minus the size of the bias, which is this project's choice,
    and (deserve + 1) / 2. Later comparisons write x in two ways: as here, or with the product of
    bias and w in place of the size of the bias, which is the same where w is -1, 0 or 1.
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


@checked_dataclass
class Rev2(ByPairMeans):
    """REV2: a rating is reliable if its rater is fair and it is near to the goodness of the
    provider.

    Kumar, Hooi, Makhija, Kumar, Faloutsos and Subrahmanian, "REV2: Fraudulent User Prediction in
    Rating Platforms" (2018), without the terms of behaviour, which need texts and times:

        G[j]    = (beta mean of G + sum over the raters i of j of R[i, j] w[i, j]) / (beta + number
                of raters of j)
        R[i, j] = (F[i] + 1 - |w[i, j] - G[j]| / 2) / 2
        F[i]    = (alpha mean of F + sum over the providers j that i rated of R[i, j]) / (alpha +
                number of these)

    with w = 2 x - 1, where x is the mean of all ratings that i gave j so far; in the paper a pair
    has one rating. Means are over agents with ratings; the authors' code takes medians and names
    means as the alternative. The iteration starts from F = G = 1. Published are F and (G + 1) / 2.

    Attributes:
        alpha: Number of ratings by which a rater is drawn to the mean fairness.
        beta: Number of ratings by which a provider is drawn to the mean goodness.
    """

    alpha: Amount = 1.0
    beta: Amount = 1.0

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
        goodness = (self.beta * _mean(of_providers, received) + votes) / (
            self.beta + received + TINY
        )
        reliable = (fair + 1 - abs(weight - pairs.gather(goodness, PROVIDER)) / 2) / 2
        fairness = self.alpha * _mean(of_raters, given) + pairs.reduce(rated * reliable, RATER)
        return fairness / (self.alpha + given + TINY), goodness

    def _rater_score(self, of_raters: Array) -> Array:
        return of_raters


def _mean(values: Array, ratings: Array) -> Array:
    """Return the mean over the agents with ratings, along the first axis."""
    there = namespace(values).where(ratings > 0, 0 * values + 1, 0.0)
    return total(there * values, 0) / (total(there, 0) + TINY)


@checked_dataclass
class TwoWayMean(ByPairMeans):
    """Two-way mean: each rating is the provider's level plus the rater's generosity, and both are
    means of the rest.

        level[j]      = mean over the raters i of j of x[i, j] - generosity[i]
        generosity[i] = sum over the providers j that i rated of (x[i, j] - level[j]) / (their
                number + 1)

    where x is the mean of all ratings that i gave j so far. The 1 in the denominator stands for one
    rating without generosity, so that the level of a provider with a single rater is defined.
    Published are the level, clipped to [0, 1], and 1 minus the size of the generosity. It is the
    additive model of the analysis of variance.
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


@checked_dataclass
class ByRatingVectors(ByPairMeans):
    """Base of trust models that seek a robust centre of the raters' vectors. A missing rating
    agrees with the centre.

        d[i] = root of the sum over the providers j that i rated of (x[i, j] - c[j])^2
        T[j] = c[j]
        R[i] = 1 - d[i] / root of the number of providers that i rated

    where x[i, j] is the mean of all ratings that i gave j so far. The trust in raters is this
    project's choice.
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
        centre = of_providers + self._moved(
            pairs, apart, rated, pairs.gather(self._weight(distance), RATER)
        )
        apart = means - pairs.gather(centre, PROVIDER)
        return weighted_mean(pairs, apart * apart, rated, RATER) ** 0.5, centre

    @abstractmethod
    def _weight(self, distance: Array) -> Array:
        """Return the weight of each rater by its distance from the centre, shape (S, ...)."""

    @abstractmethod
    def _moved(self, pairs: Ratings, apart: Array, rated: Array, weights: Array) -> Array:
        """Return how far the centre moves, shape (P, ...), from the gaps between ratings and
        centre.
        """

    def _provider_score(self, of_providers: Array) -> Array:
        return of_providers


_NEAREST = (
    1e-4  # distances below this count as this; Weiszfeld's weights are otherwise without limit
)


@checked_dataclass
class GeometricMedian(ByRatingVectors):
    """Geometric median: the centre has the least sum of distances to the vectors of ratings of the
    raters.

    Pillutla, Kakade and Harchaoui, "Robust Aggregation for Federated Learning" (2022), by the
    smoothed algorithm of Weiszfeld, for vectors with missing entries:

        c[j] <- sum over the raters i of j of x[i, j] / max(d[i], 1e-4) / sum over them of 1 /
                max(d[i], 1e-4)

    with d, x and both trusts as in `ByRatingVectors`. At most 60 iterations start from 1/2.
    """

    source = "Pillutla et al. (2022)"

    def _weight(self, distance: Array) -> Array:
        return 1 / namespace(distance).clip(distance, _NEAREST, None)

    def _moved(self, pairs: Ratings, apart: Array, rated: Array, weights: Array) -> Array:
        return weighted_mean(pairs, apart, rated * weights, PROVIDER)


@checked_dataclass
class CentredClipping(ByRatingVectors):
    """Centred clipping: each rater pulls the centre with its gap to it, cut to the length of a
    radius.

    Karimireddy, He and Jaggi, "Learning from History for Byzantine Robust Optimization" (2021), for
    vectors with missing entries:

        c[j] <- c[j] + mean over the raters i of j of (x[i, j] - c[j]) min(1, radius / d[i])

    with d, x and both trusts as in `ByRatingVectors`. At most 60 iterations start from 1/2; the
    paper takes one or a few from the result of the round before.

    Attributes:
        radius: Greatest length of a pull, above 0, where a single rating has a gap of at most 1.
    """

    radius: Annotated[float, Field(ge=0.01, le=100)] = 0.5

    source = "Karimireddy et al. (2021)"

    def _weight(self, distance: Array) -> Array:
        return self.radius / namespace(distance).clip(distance, self.radius, None)

    def _moved(self, pairs: Ratings, apart: Array, rated: Array, weights: Array) -> Array:
        return weighted_mean(pairs, apart * weights, rated, PROVIDER)


class AllTimeMeanState(NamedTuple):
    """Memory of the all-time mean.

    Attributes:
        tor: Trust of the raters, shape (S, ...), always 1, since the model has no notion of it.
        sums: Sum of all ratings of each provider, shape (P, ...).
        counts: Number of these ratings, shape (P, ...).
    """

    tor: Annotated[PerRater, SHARES]
    sums: Annotated[PerProvider, ValueRange(0, "counts")]
    counts: Annotated[PerProvider, COUNTS]


@checked_dataclass
class AllTimeMean(Published):
    """All-time mean: a provider's average rating so far, in which all ratings count alike and none
    is forgotten.

        T[j] = sum of all ratings of j / their number

    Attributes:
        initial: Trust before any rating, in [0, 1].
    """

    initial: Share = 0.5
    rates_raters = False
    local = True

    def start(self, like: Array) -> AllTimeMeanState:
        """Return the state before any rating. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return AllTimeMeanState(nothing[:, 0, ...] + 1, nothing[0], nothing[0])

    def update(self, state: AllTimeMeanState, ratings: Ratings) -> AllTimeMeanState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        sums = state.sums + ratings.reduce(ratings.values, PROVIDER)
        return AllTimeMeanState(state.tor, sums, state.counts + ratings.count(PROVIDER))

    def provider_trust(self, state: AllTimeMeanState) -> Array:
        """Return the mean of all ratings, shape (P, ...)."""
        xp = namespace(state.sums)
        return xp.where(state.counts > 0, state.sums / xp.clip(state.counts, 1, None), self.initial)


LOG_MODELS: dict[str, Any] = {
    "all-time-mean": AllTimeMean,
    "two-way-mean": TwoWayMean,
    "fairness-goodness": FairnessGoodness,
    "bias-deserve": BiasDeserve,
    "rev2": Rev2,
    "geometric-median": GeometricMedian,
    "centred-clipping": CentredClipping,
}
"""Classes by name. Elsewhere they are written
`roletrust_env.logs.models:FairnessGoodness`."""


def make_log_model(name: str) -> Any:
    """Return a trust model by its name: one of `LOG_MODELS` with its default values, or else see
    `parse_named`.

    Raises:
        ValueError: There is no such model.
    """
    if ":" not in name and name not in registry and name not in LOG_MODELS:
        raise ValueError(
            f"unknown trust model {name!r}{suggest(name, [*registry.names(), *LOG_MODELS])}"
        )
    return LOG_MODELS[name]() if name in LOG_MODELS else parse_named(registry, name)
