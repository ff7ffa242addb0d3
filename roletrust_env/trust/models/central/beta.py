"""Beta reputation: a provider's trust is the mean of the Beta distribution that follows from its ratings."""

from typing import NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import Share, checked_dataclass
from roletrust_env.trust.beta import reputation
from roletrust_env.trust.ratings import PROVIDER, PerProvider, PerRater, Ratings, occurred


class BetaState(NamedTuple):
    """Memory of Beta reputation.

    Attributes:
        successes: Evidence for a provider, r, shape (P, ...).
        failures: Evidence against it, s, shape (P, ...).
        tor: Trust of the raters, shape (S, ...), always 1.
    """

    successes: PerProvider
    failures: PerProvider
    tor: PerRater


@checked_dataclass
class Beta:
    """Beta reputation: ratings of a provider count as successes and failures, which fade.

        r[j] <- keep r[j] + sum over raters i of f[i, j],   s[j] <- keep s[j] + sum of 1 - f[i, j]
        T[j]  = (r[j] + 2 initial) / (r[j] + s[j] + 2)

    Jøsang and Ismail, "The Beta Reputation System" (2002): a rating f is f of a success and 1 - f of a failure. Their
    prior is uniform, here `initial` = 0.5; another value is the base rate of Jøsang's later papers. In the paper
    evidence fades with every rating. Here the ratings of a round arrive together, and evidence fades once in each round
    in which the provider is rated. The discounting of raters by their own reputation is left out, since only providers
    are rated.

    Attributes:
        keep: Share of the evidence of earlier rounds that is kept each round, in [0, 1]; 1 forgets nothing.
        initial: Trust before any rating, in [0, 1].
    """

    keep: Share = 0.9
    initial: Share = 0.5
    rates_raters = False
    source = "Jøsang and Ismail (2002)"
    local = True

    def start(self, like: Array) -> BetaState:
        """Return the state without evidence. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return BetaState(nothing[0], nothing[0], nothing[:, 0, ...] + 1)

    def update(self, state: BetaState, ratings: Ratings) -> BetaState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        kept, successes = left(self.keep, ratings), ratings.reduce(ratings.values, PROVIDER)
        return BetaState(
            kept * state.successes + successes, kept * state.failures + (ratings.count(PROVIDER) - successes), state.tor
        )

    def rater_trust(self, state: BetaState) -> Array:
        """Return 1 for every rater, shape (S, ...), since the model has no notion of rater trust."""
        return state.tor

    def provider_trust(self, state: BetaState) -> Array:
        """Return the mean of Beta(r + 2 initial, s + 2 (1 - initial)), shape (P, ...)."""
        return reputation(state.successes, state.failures, self.initial)


def left(keep: float, ratings: Ratings) -> Array:
    """Return the share of each provider's earlier evidence that is kept, shape (P, ...); 1 for an unrated provider."""
    return 1 - (1 - keep) * occurred(ratings.count(PROVIDER))
