"""The undefended baseline: believe what the raters say, on average."""

from typing import NamedTuple

from pydantic.dataclasses import dataclass

from roletrust_env.arrays import Array, namespace
from roletrust_env.ranges import Lam, Share
from roletrust_env.trust.algorithms import masked_mean, smooth


class MeanState(NamedTuple):
    """What the mean remembers: the trust of the providers, shape (P, ...), and of the raters, (S, ...), always 1."""

    top: Array
    tor: Array


@dataclass(frozen=True)
class Mean:
    """Undefended baseline: an exponential mean of a provider's average notes, every rater believed alike.

    Attributes:
        lam: weight of the newest round, in [0.5, 1).
        initial: trust before any rating, in [0, 1].
    """

    lam: Lam = 0.5
    initial: Share = 0.5
    rates_raters = False
    takes_full_rounds = True

    def start(self, like: Array) -> MeanState:
        """Initial trust for every provider. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return MeanState(nothing[0] + self.initial, nothing[:, 0, ...] + 1)

    def update(self, state: MeanState, ratings: Array, mask: Array | None) -> MeanState:
        """One round of ratings. See `TrustModel.update`."""
        average, raters = masked_mean(ratings, mask, axis=0)
        return MeanState(smooth(average, state.top, self.lam, raters), state.tor)

    def rater_trust(self, state: MeanState) -> Array:
        """1 for every rater, shape (S, ...): the model has no notion of rater trust."""
        return state.tor

    def provider_trust(self, state: MeanState) -> Array:
        """The exponential mean, shape (P, ...)."""
        return state.top
