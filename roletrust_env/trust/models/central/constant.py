"""The control: trust that never changes."""

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import Share, checked_dataclass
from roletrust_env.trust.algorithms import Trusts
from roletrust_env.trust.ratings import Ratings


@checked_dataclass
class Constant:
    """Control: all agents keep the initial trust, so no attack does harm and no choice by trust is informed.

    Attributes:
        initial: Trust of all agents, in [0, 1].
    """

    initial: Share = 0.5
    rates_raters = True
    differentiable = False  # it has no gradient at all
    cost = "S + P"
    local = True

    def start(self, like: Array) -> Trusts:
        """Return the initial trust of all agents. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return Trusts(nothing[:, 0, ...] + self.initial, nothing[0] + self.initial)

    def update(self, state: Trusts, ratings: Ratings) -> Trusts:
        """Return the state unchanged. See `TrustModel.update`."""
        return state

    def rater_trust(self, state: Trusts) -> Array:
        """Return the initial trust, shape (S, ...)."""
        return state.tor

    def provider_trust(self, state: Trusts) -> Array:
        """Return the initial trust, shape (P, ...)."""
        return state.top
