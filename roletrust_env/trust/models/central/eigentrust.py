"""EigenTrust: trust is handed on by those who have it."""

from typing import NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.algorithms import Trusts
from roletrust_env.trust.random_walk import number, shared, walk

A = 0.5
"""How much of all trust comes from the pre-trusted."""

_ROUNDING = 1e-6  # scores below it are no better than 0


class EigenTrustState(NamedTuple):
    """What EigenTrust remembers.

    Attributes:
        trusts: as published.
        scores: satisfaction less dissatisfaction of each pair so far, shape (S, P, ...).
        peers: 1 where a rater and a provider are one agent, shape (S, P, ...).
    """

    trusts: Trusts
    scores: Array
    peers: Array


@checked_dataclass
class EigenTrust:
    """EigenTrust: an agent is trusted as far as the agents that are trusted were content with it.

    Kamvar, Schlosser and Garcia-Molina (2003):

        s[i, j] = sum over the ratings that i gave j of f - (1 - f)
        c[i, j] = max(s[i, j], 0) / sum over j of max(s[i, j], 0);   an empty row is p
        t      <- (1 - a) C^T t + a p,   a = 1/2

    over the N agents, solved for where t rests. Nobody here is pre-trusted more than others: p is 1 / N for each. In
    the paper all agents are peers; here an agent may have one role. Who only rates is trusted as far as p goes, since
    nobody can rate it, and who only provides has an empty row. Published is t as a share of the largest, for
    an agent of two roles in both: trust is in relation to the most trusted, and 1 for all before any rating.
    """

    rates_raters = True
    source = "Kamvar et al. (2003)"
    cost = "S^2 P + S^3"
    smooth = False  # a rater's row may become empty at once
    takes_peers = True

    def start(self, like: Array, peers: Array) -> EigenTrustState:
        """No rating yet. See `TrustModel.start`."""
        return self._trusting(namespace(like).zeros_like(like), shared(peers, like))

    def update(self, state: EigenTrustState, ratings: Array, mask: Array) -> EigenTrustState:
        """One round of ratings. See `TrustModel.update`."""
        content = namespace(ratings).where(mask, 2 * ratings - 1, 0.0)
        return self._trusting(state.scores + content, state.peers)

    def _trusting(self, scores: Array, peers: Array) -> EigenTrustState:
        xp = namespace(scores)
        each = 1 / number(peers)
        p = Trusts(xp.zeros_like(scores[:, 0, ...]) + each, xp.zeros_like(scores[0]) + each)
        trusts = walk(xp.where(scores > _ROUNDING, scores, 0.0), peers, p, A)
        return EigenTrustState(trusts, scores, peers)

    def rater_trust(self, state: EigenTrustState) -> Array:
        """The trust of the agents that rate, shape (S, ...)."""
        return state.trusts.tor

    def provider_trust(self, state: EigenTrustState) -> Array:
        """The trust of the agents that provide, shape (P, ...)."""
        return state.trusts.top
