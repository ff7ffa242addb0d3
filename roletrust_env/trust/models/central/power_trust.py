"""PowerTrust: trust is handed on, and those of whom most is heard have an advance."""

from typing import NamedTuple

from pydantic import PositiveInt

from roletrust_env.arrays import Array, namespace, total
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.algorithms import Trusts
from roletrust_env.trust.random_walk import shared, walk

A = 0.15
"""How much of all trust comes from the power nodes alone."""


class PowerTrustState(NamedTuple):
    """What PowerTrust remembers.

    Attributes:
        trusts: as published.
        latest: the last rating that i gave j, shape (S, P, ...), 0 where there is none.
        heard: number of ratings that each provider has received, shape (P, ...).
        peers: 1 where a rater and a provider are one agent, shape (S, P, ...).
    """

    trusts: Trusts
    latest: Array
    heard: Array
    peers: Array


@checked_dataclass
class PowerTrust:
    """PowerTrust: as EigenTrust hands trust on, from the latest ratings, with an advance for the most rated.

    Zhou and Hwang (2007), their global aggregation without its look-ahead step and without a distributed ranking:

        r[i, j] = latest rating that i gave j / sum over j of them
        v      <- (1 - a) R^T v + a / m for each of the m power nodes,   a = 0.15

    over the N agents, solved for where v rests. Power nodes are the `power_nodes` providers with the most ratings so
    far, and all who have as many as the last of them. Agents may have one role, see `EigenTrust`; a row without ratings
    above 0 goes to all alike. Published is v as a share of the largest.

    Attributes:
        power_nodes: how many there are at least, above 0; if there are fewer providers, all are.
    """

    power_nodes: PositiveInt = 1
    rates_raters = True
    source = "Zhou and Hwang (2007)"
    cost = "S^2 P + S^3"
    smooth = False  # a rater's row may become empty at once
    takes_peers = True

    def start(self, like: Array, peers: Array) -> PowerTrustState:
        """No rating yet. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return self._trusting(nothing, 0 * nothing[0], shared(peers, like))

    def update(self, state: PowerTrustState, ratings: Array, mask: Array) -> PowerTrustState:
        """One round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings)
        heard = state.heard + total((1 - state.peers) * xp.astype(mask, ratings.dtype), 0)
        return self._trusting(xp.where(mask, ratings, state.latest), heard, state.peers)

    def _trusting(self, latest: Array, heard: Array, peers: Array) -> PowerTrustState:
        xp = namespace(latest)
        last = xp.sort(heard, axis=0)[-min(self.power_nodes, len(heard))]
        power = xp.astype(heard >= last, latest.dtype)
        top = power / total(power, 0)
        return PowerTrustState(walk(latest, peers, Trusts(total(peers * top, 1), top), A), latest, heard, peers)

    def rater_trust(self, state: PowerTrustState) -> Array:
        """The trust of the agents that rate, shape (S, ...)."""
        return state.trusts.tor

    def provider_trust(self, state: PowerTrustState) -> Array:
        """The trust of the agents that provide, shape (P, ...)."""
        return state.trusts.top
