"""The control: trust that nothing moves."""

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import Share
from roletrust_env.trust.algorithms import Trusts


@checked_dataclass
class Constant:
    """Control: everybody keeps the initial trust whatever is rated, so that no attack does harm and no choice is good.

    Attributes:
        initial: the trust of everybody, in [0, 1].
    """

    initial: Share = 0.5
    rates_raters = True
    smooth = False  # it has no gradient at all
    cost = "S + P"
    takes_full_rounds = True

    def start(self, like: Array) -> Trusts:
        """Initial trust for everyone. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return Trusts(nothing[:, 0, ...] + self.initial, nothing[0] + self.initial)

    def update(self, state: Trusts, ratings: Array, mask: Array | None) -> Trusts:
        """The same state, whatever the round. See `TrustModel.update`."""
        return state

    def rater_trust(self, state: Trusts) -> Array:
        """The initial trust, shape (S, ...)."""
        return state.tor

    def provider_trust(self, state: Trusts) -> Array:
        """The initial trust, shape (P, ...)."""
        return state.top
