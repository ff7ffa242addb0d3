"""PowerTrust: agents pass trust on, and the most rated providers receive an extra share."""

from typing import NamedTuple

from pydantic import PositiveInt

from roletrust_env.arrays import Array, namespace, total
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.algorithms import Trusts
from roletrust_env.trust.random_walk import not_self, own_role, shared, walk
from roletrust_env.trust.ratings import PROVIDER, PerPair, PerProvider, Ratings

A = 0.15
"""Share of all trust that goes to the power nodes directly."""


class PowerTrustState(NamedTuple):
    """Memory of PowerTrust.

    Attributes:
        trusts: Published trust.
        latest: Latest rating that i gave j, shape (S, P, ...), 0 where there is none.
        heard: Number of ratings that each provider has received, shape (P, ...).
        peers: Flag, 1 where a rater and a provider are one agent, shape (S, P, ...).
    """

    trusts: Trusts
    latest: PerPair
    heard: PerProvider
    peers: PerPair


@checked_dataclass
class PowerTrust:
    """PowerTrust: trust passed on as in EigenTrust, by the latest ratings, with an extra share for the most rated.

    Zhou and Hwang (2007), their global aggregation without the look-ahead step and without a distributed ranking:

        r[i, j] = latest rating that i gave j / sum of the same over j
        v      <- (1 - a) R^T v + a / m for each of the m power nodes,   a = 0.15

    over the N agents. The model publishes the fixed point v, divided by its largest entry. The power nodes are the
    `power_nodes` providers with the most ratings so far, and all others with as many ratings as the last of these.
    Agents may have one role, see `EigenTrust`. A row without ratings above 0 is spread evenly over all agents.

    The term a / m is uncertain: it could not be checked against the paper, and was chosen so that v sums to 1.

    Trust is relative to the most trusted agent. If every rating is 0, providers that were rated equally often therefore
    have trust 1, however bad they are, and among peers every agent has.

    Attributes:
        power_nodes: Minimum number of power nodes, above 0. If there are fewer providers, all are power nodes.
    """

    power_nodes: PositiveInt = 1
    rates_raters = True
    source = "Zhou and Hwang (2007)"
    cost = "S^2 P + S^3"
    differentiable = False  # a rater's row may become empty in one round
    takes_peers = True

    def start(self, like: Array, peers: Array) -> PowerTrustState:
        """Return the state before any rating. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return self._trusting(Ratings(nothing), nothing, 0 * nothing[0], shared(peers, like))

    def update(self, state: PowerTrustState, ratings: Ratings) -> PowerTrustState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        pairs = ratings.pairs
        by_others = not_self(pairs, state.peers) * ratings.write(0 * state.latest, 1.0)
        heard = state.heard + pairs.reduce(by_others, PROVIDER)
        return self._trusting(pairs, ratings.write(state.latest, ratings.values), heard, state.peers)

    def _trusting(self, pairs: Ratings, latest: Array, heard: Array, peers: Array) -> PowerTrustState:
        xp = namespace(latest)
        last = xp.sort(heard, axis=0)[-min(self.power_nodes, len(heard))]
        power = xp.astype(heard >= last, latest.dtype)
        top = power / total(power, 0)
        start = Trusts(own_role(pairs, top, peers), top)
        return PowerTrustState(walk(pairs, latest, peers, start, A), latest, heard, peers)

    def rater_trust(self, state: PowerTrustState) -> Array:
        """Return the trust of the agents that rate, shape (S, ...)."""
        return state.trusts.tor

    def provider_trust(self, state: PowerTrustState) -> Array:
        """Return the trust of the agents that provide, shape (P, ...)."""
        return state.trusts.top
