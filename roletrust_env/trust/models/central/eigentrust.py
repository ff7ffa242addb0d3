"""EigenTrust: trusted agents pass trust on to the agents that they rate well."""

from typing import NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.trust.algorithms import Trusts
from roletrust_env.trust.random_walk import n_agents, shared, walk
from roletrust_env.trust.ratings import PROVIDER, RATER, PerPair, Ratings

A = 0.5
"""Share of all trust that comes from pre-trusted agents."""

_ROUNDING = 1e-6  # scores below it count as 0


class EigenTrustState(NamedTuple):
    """Memory of EigenTrust.

    Attributes:
        trusts: Published trust.
        scores: Satisfaction minus dissatisfaction of each pair so far, shape (S, P, ...).
        peers: Flag, 1 where a rater and a provider are one agent, shape (S, P, ...).
    """

    trusts: Trusts
    scores: PerPair
    peers: PerPair


@checked_dataclass
class EigenTrust:
    """EigenTrust: an agent is trusted as far as trusted agents were satisfied with it.

    Kamvar, Schlosser and Garcia-Molina (2003):

        s[i, j] = sum over the ratings that i gave j of f - (1 - f)
        c[i, j] = max(s[i, j], 0) / sum over j of max(s[i, j], 0);   an empty row is p
        t      <- (1 - a) C^T t + a p,   a = 1/2

    over the N agents. The model publishes the fixed point t, divided by its largest entry. An agent with two roles has
    the same trust in both. No agent is pre-trusted more than others: p is 1 / N for each. In the paper all agents are
    peers; here an agent may have one role. An agent that only rates has the trust that p gives it, since it cannot be
    rated. An agent that only provides has an empty row.

    Trust is relative to the most trusted agent. It is therefore 1 for every agent where no score is above 0: before any
    rating, and also if every rating is 0.
    """

    rates_raters = True
    source = "Kamvar et al. (2003)"
    cost = "S^2 P + S^3"
    differentiable = False  # a rater's row may become empty in one round
    takes_peers = True

    def start(self, like: Array, peers: Array) -> EigenTrustState:
        """Return the state before any rating. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return self._trusting(Ratings(nothing), nothing, shared(peers, like))

    def update(self, state: EigenTrustState, ratings: Ratings) -> EigenTrustState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        content = ratings.write(0 * state.scores, 2 * ratings.values - 1)
        return self._trusting(ratings.pairs, state.scores + content, state.peers)

    def _trusting(self, pairs: Ratings, scores: Array, peers: Array) -> EigenTrustState:
        xp = namespace(scores)
        each = 1 / n_agents(pairs, peers)
        p = Trusts(0 * pairs.reduce(scores, RATER) + each, 0 * pairs.reduce(scores, PROVIDER) + each)
        trusts = walk(pairs, xp.where(scores > _ROUNDING, scores, 0.0), peers, p, A)
        return EigenTrustState(trusts, scores, peers)

    def rater_trust(self, state: EigenTrustState) -> Array:
        """Return the trust of the agents that rate, shape (S, ...)."""
        return state.trusts.tor

    def provider_trust(self, state: EigenTrustState) -> Array:
        """Return the trust of the agents that provide, shape (P, ...)."""
        return state.trusts.top
