"""Beta reputation: a provider's trust is the mean of the Beta distribution that follows from its
ratings.
"""

from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, cast, is_compiling, namespace
from roletrust_env.parameters import Share, Tail, checked_dataclass
from roletrust_env.shapes import PerPair, PerProvider, PerRater
from roletrust_env.trees import AMOUNTS, SHARES
from roletrust_env.trust.beta_distribution import between_quantiles, reputation
from roletrust_env.trust.ratings import PROVIDER, RATER, Published, Ratings, occurred


class BetaState(NamedTuple):
    """Memory of Beta reputation.

    Attributes:
        successes: Evidence for a provider, r, shape (P, ...).
        failures: Evidence against it, s, shape (P, ...).
        tor: Trust of the raters, shape (S, ...), always 1, since the model has no notion of it.
    """

    successes: Annotated[PerProvider, AMOUNTS]
    failures: Annotated[PerProvider, AMOUNTS]
    tor: Annotated[PerRater, SHARES]


@checked_dataclass
class Beta(Published):
    """Beta reputation: ratings of a provider count as successes and failures, which fade.

        r[j] <- keep r[j] + sum over raters i of f[i, j],   s[j] <- keep s[j] + sum of 1 - f[i, j]
        T[j]  = (r[j] + 2 initial) / (r[j] + s[j] + 2)

    Jøsang and Ismail, "The Beta Reputation System" (2002): a rating f is f of a success and 1 - f
    of a failure. Their prior is uniform, here `initial` = 0.5; another value is the base rate of
    Jøsang's later papers. In the paper evidence fades with every rating. Here the ratings of a
    round arrive together, and evidence fades once in each round in which the provider is rated. The
    discounting of raters by their own reputation is left out, since only providers are rated.

    Where ratings are K equally spaced levels f[1] = 0 to f[K] = 1, this is also Dirichlet
    reputation, Jøsang and Haller (2007), with their prior weight C = 2 and equal base rates: the
    point estimate, the sum over the levels of f[k] (R[k] + C / K) / (C + sum of R), where R[k] is
    the number of ratings of level k, faded.

    Attributes:
        keep: Share of the evidence of earlier rounds that is kept each round, in [0, 1]; 1 forgets
            nothing.
        initial: Trust before any rating, in [0, 1].
    """

    keep: Share = 0.9
    initial: Share = 0.5
    rates_raters = False
    source = "Jøsang and Ismail (2002)"
    local = True

    def start(self, like: PerPair) -> BetaState:
        """Return the state without evidence. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return BetaState(nothing[0], nothing[0], nothing[:, 0, ...] + 1)

    def update(self, state: BetaState, ratings: Ratings) -> BetaState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        remains, successes = remaining(self.keep, ratings), ratings.reduce(ratings.values, PROVIDER)
        return BetaState(
            remains * state.successes + successes,
            remains * state.failures + (ratings.count(PROVIDER) - successes),
            state.tor,
        )

    def provider_trust(self, state: BetaState) -> PerProvider:
        """Return the mean of Beta(r + 2 initial, s + 2 (1 - initial)), shape (P, ...)."""
        return reputation(state.successes, state.failures, self.initial)


def remaining(keep: float, ratings: Ratings) -> PerProvider | float:
    """Return the share of each provider's earlier evidence that is kept, shape (P, ...); 1 for an
    unrated provider.
    """
    return 1 - (1 - keep) * occurred(ratings.count(PROVIDER))


_PASSES = 12
"""Maximum number of filter passes. Each drops some raters and none drops all, so S - 1 suffice; 30
raters took 9."""


class BetaFilteredState(NamedTuple):
    """Memory of filtered Beta reputation.

    Attributes:
        successes: Evidence r, by rater and provider, shape (S, P, ...).
        failures: Evidence s, shape (S, P, ...).
        top: Trust of the providers, shape (P, ...): Beta reputation by the raters that count.
        tor: Trust of the raters, shape (S, ...): share of the providers for which a rater counts,
            and `initial` if it rated none.
    """

    successes: Annotated[PerPair, AMOUNTS]
    failures: Annotated[PerPair, AMOUNTS]
    top: Annotated[PerProvider, SHARES]
    tor: Annotated[PerRater, SHARES]


@checked_dataclass
class BetaFiltered(Published):
    """Filtered Beta reputation: raters whose ratings make the overall mean too unlikely do not
    count.

    Whitby, Jøsang and Indulska, "Filtering Out Unfair Ratings in Bayesian Reputation Systems"
    (2004). A rater's ratings of a provider give Beta(1 + r, 1 + s). For each provider, the filter
    drops all raters whose distribution has its `q` quantile above the aggregate mean or its 1 - `q`
    quantile below it. It repeats this with the mean of the remaining raters until it drops no more,
    at most 12 times. Only crowds may need more. All raters take part again in the next round.

    Evidence is counted, fades and has a base rate as in `Beta`. Where no rater is dropped, the
    model equals `Beta`.

    The paper leaves two things open. It has no trust in raters: here, that is the share of the
    providers rated by a rater for which the filter did not drop it. And a pass that would drop all
    raters ends the filter and drops none: in a crowd of over a hundred raters with perfect ratings,
    the mean is nearer to 1 than the upper quantile of any rater.

    Attributes:
        keep: Share of the evidence of earlier rounds that is kept each round, in [0, 1]; 1 forgets
            nothing.
        initial: Trust before any rating, in [0, 1].
        q: Probability that is cut off at either end of a rater's distribution, in [1e-6, 0.5).
    """

    keep: Share = 0.9
    initial: Share = 0.5
    q: Tail = 0.01
    rates_raters = True
    source = "Whitby, Jøsang and Indulska (2004)"
    differentiable = False

    def start(self, like: PerPair) -> BetaFilteredState:
        """Return the state without evidence. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return BetaFilteredState(
            nothing, nothing, nothing[0] + self.initial, nothing[:, 0, ...] + self.initial
        )

    def update(self, state: BetaFilteredState, ratings: Ratings) -> BetaFilteredState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        pairs = ratings.pairs
        remains = pairs.gather(remaining(self.keep, ratings), PROVIDER)
        none = 0 * state.successes
        count, values = ratings.write(none, 1.0), ratings.write(none, ratings.values)
        successes = remains * state.successes + values
        failures = remains * state.failures + (count - values)
        heard, top = self._filter(pairs, successes, failures)
        return BetaFilteredState(
            successes, failures, top, self._share_heard(pairs, heard, successes + failures)
        )

    def _reputation(self, pairs: Ratings, heard: Array, successes: Array, failures: Array) -> Array:
        """Return the Beta reputation of each provider by the raters that count, shape (P, ...)."""
        return reputation(
            pairs.reduce(heard * successes, PROVIDER),
            pairs.reduce(heard * failures, PROVIDER),
            self.initial,
        )

    def _filter(self, pairs: Ratings, successes: Array, failures: Array) -> tuple[Array, Array]:
        """Return 1 for each pair whose rater counts for the provider, 0 for the others; and the
        providers' trust.
        """
        xp = namespace(successes)
        is_likely = between_quantiles(self.q, 1 + successes, 1 + failures)
        evident = cast(successes + failures > 0, successes.dtype)
        heard = xp.ones_like(successes)
        mean = self._reputation(pairs, heard, successes, failures)
        for _ in range(min(pairs.shape[0] - 1, _PASSES)):
            before, still = (
                heard,
                heard * cast(is_likely(pairs.gather(mean, PROVIDER)), heard.dtype),
            )
            anyone = pairs.reduce(still * evident, PROVIDER) > 0
            heard = xp.where(pairs.gather(anyone, PROVIDER), still, heard)
            if not is_compiling(heard) and bool(xp.all(heard == before)):
                break  # all other passes would do the same
            mean = self._reputation(pairs, heard, successes, failures)
        return heard, mean

    def _share_heard(self, pairs: Ratings, heard: Array, evidence: Array) -> Array:
        """Return the share of the providers rated by each rater for which it was not dropped, shape
        (S, ...).
        """
        xp = namespace(heard)
        rated = cast(evidence > 0, heard.dtype)
        count = pairs.reduce(rated, RATER)
        return xp.where(
            count > 0, pairs.reduce(heard * rated, RATER) / xp.clip(count, 1, None), self.initial
        )
