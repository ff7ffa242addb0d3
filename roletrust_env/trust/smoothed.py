"""The common part of models that remember nothing but trust."""

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import Lam, Share, checked_dataclass
from roletrust_env.trust.algorithms import Trusts


@checked_dataclass
class Smoothed:
    """Base of trust models that remember nothing but trust: initial state and read-outs.

    Attributes:
        lam: Weight of the newest round, in [0.5, 1).
        initial: Trust before any rating, in [0, 1].
    """

    lam: Lam = 0.5
    initial: Share = 0.5
    rates_raters = True
    local = True

    def start(self, like: Array) -> Trusts:
        """Return the initial trust of all agents. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return Trusts(nothing[:, 0, ...] + self.initial, nothing[0] + self.initial)

    def rater_trust(self, state: Trusts) -> Array:
        """Return the trust of the raters, shape (S, ...)."""
        return state.tor

    def provider_trust(self, state: Trusts) -> Array:
        """Return the trust of the providers, shape (P, ...)."""
        return state.top
