"""Beta reputation: a provider's trust is the mean of the Beta distribution that its ratings speak for."""

from typing import NamedTuple

from roletrust_env.arrays import Array, namespace, total
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import Share
from roletrust_env.trust.algorithms import Notes, occurred
from roletrust_env.trust.beta import reputation


class BetaState(NamedTuple):
    """What Beta reputation remembers.

    Attributes:
        successes: r, shape (P, ...).
        failures: s, shape (P, ...).
        tor: trust of the raters, shape (S, ...), always 1.
    """

    successes: Array
    failures: Array
    tor: Array


@checked_dataclass
class Beta:
    """Beta reputation: all ratings of a provider counted as successes and failures, which fade.

        r[j] <- keep r[j] + sum over raters i of f[i, j],   s[j] <- keep s[j] + sum of 1 - f[i, j]
        T[j]  = (r[j] + 2 initial) / (r[j] + s[j] + 2)

    Jøsang and Ismail, "The Beta Reputation System" (2002): a rating f is f of a success and 1 - f of a failure. Their
    prior is uniform, here `initial` = 0.5; another is the base rate of Jøsang's later papers. They forget with every
    rating, one after another; a round's ratings come together here and fade together, in rounds in which the provider
    is rated. Left out is the discounting of raters by their own reputation, since the ratings are of providers only.

    Attributes:
        keep: what is left of the evidence of earlier rounds, in [0, 1]; 1 forgets nothing.
        initial: trust before any rating, in [0, 1].
    """

    keep: Share = 0.9
    initial: Share = 0.5
    rates_raters = False
    source = "Jøsang and Ismail (2002)"
    takes_full_rounds = True

    def start(self, like: Array) -> BetaState:
        """No evidence of anybody. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return BetaState(nothing[0], nothing[0], nothing[:, 0, ...] + 1)

    def update(self, state: BetaState, ratings: Array, mask: Array | None) -> BetaState:
        """One round of ratings. See `TrustModel.update`."""
        notes = Notes.of(ratings, mask)
        kept, successes = left(self.keep, notes), total(notes.values, 0)
        return BetaState(
            kept * state.successes + successes, kept * state.failures + (notes.received - successes), state.tor
        )

    def rater_trust(self, state: BetaState) -> Array:
        """1 for every rater, shape (S, ...): the model has no notion of rater trust."""
        return state.tor

    def provider_trust(self, state: BetaState) -> Array:
        """The mean of Beta(r + 2 initial, s + 2 (1 - initial)), shape (P, ...)."""
        return reputation(state.successes, state.failures, self.initial)


def left(keep: float, notes: Notes) -> Array:
    """What is left of each provider's earlier evidence, shape (P, ...): all of it if nobody rated the provider."""
    return 1 - (1 - keep) * occurred(notes.received)
