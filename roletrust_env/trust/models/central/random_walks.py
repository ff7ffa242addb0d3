"""Models that pass trust on from agent to agent: a random walk along good ratings.

A rater and a provider that are one agent have one trust. All others are agents of one role: a rater
that cannot be rated, or a provider that does not rate. An agent's opinion of itself does not count.
"""

import math
from typing import Annotated, NamedTuple

from pydantic import PositiveInt

from roletrust_env.arrays import Array, device_of, largest, namespace, total
from roletrust_env.parameters import checked_dataclass
from roletrust_env.shapes import PerGame, PerPair, PerProvider, PerRater
from roletrust_env.trees import BALANCES, COUNTS, FLAGS, SHARES
from roletrust_env.trust.algorithms import Trusts
from roletrust_env.trust.model import Peers
from roletrust_env.trust.ratings import PROVIDER, RATER, TINY, Published, Ratings

_REST = 1e-15  # a relative step this small is rounding


def shared(peers: Peers, like: PerPair) -> PerPair:
    """Return 1 where a rater and a provider are one agent, 0 elsewhere, for every game of a batch.

    Args:
        peers: Pairs as booleans, shape (S, P).
        like: Array of shape (S, P, ...) that shows the shape and the dtype.
    """
    xp = namespace(like)
    return xp.zeros_like(like) + xp.astype(peers, like.dtype).reshape(
        *peers.shape, *[1] * (like.ndim - 2)
    )


def n_agents(pairs: Ratings, peers: PerPair) -> PerGame | int:
    """Return the number of agents N, shape (...): an agent of two roles counts once.

    Args:
        pairs: Pairs of raters and providers, on a grid or on edges.
        peers: Flag, 1 where a rater and a provider are one agent. On edges the twins tell.
    """
    if pairs.raters is None:
        return sum(peers.shape[:2]) - total(total(peers, 0), 0)
    return sum(pairs.shape) - (0 if pairs.twins is None else int((pairs.twins >= 0).sum()))


def not_self(pairs: Ratings, peers: PerPair) -> PerPair:
    """Return 1 for each pair of two agents, and 0 for an agent's pair with itself; see
    `n_agents`.
    """
    if pairs.raters is None:
        return 1 - peers
    two = pairs.raters >= 0 if pairs.twins is None else pairs.twins[pairs.providers] != pairs.raters
    return namespace(peers).astype(two, peers.dtype)


def own_role(pairs: Ratings, values: PerProvider, peers: PerPair) -> PerRater:
    """Return the provider's value of each rater that provides, and 0 of others, shape (S, ...); see
    `n_agents`.
    """
    if pairs.raters is None:
        return total(peers * values, 1)
    xp = namespace(values)
    own = xp.zeros(pairs.shape[0], dtype=values.dtype, device=device_of(values))
    if pairs.twins is not None:
        own[pairs.twins[pairs.twins >= 0]] = values[pairs.twins >= 0]
    return own


def own_rating_role(pairs: Ratings, values: PerRater, peers: PerPair) -> PerProvider:
    """Return the rater's value of each provider that rates, and 0 of others, shape (P, ...); see
    `n_agents`.
    """
    if pairs.raters is None:
        return total(peers * values[:, None, ...], 0)
    xp = namespace(values)
    if pairs.twins is None:
        return xp.zeros(pairs.shape[1], dtype=values.dtype, device=device_of(values))
    return xp.where(pairs.twins >= 0, values[pairs.twins], 0.0)


def walk(pairs: Ratings, links: PerPair, peers: PerPair, start: Trusts, a: float) -> Trusts:
    """Return where a random walker is found that follows links, or restarts with probability a:
    PageRank.

        v = (1 - a) C^T v + a start,   C[i, j] = links[i, j] / sum over j of links[i, j]

    From an agent without links, such as a provider that does not rate, the walker goes to any of
    the N agents alike. On a grid the equations are solved. On edges the walker walks until it is at
    rest.

    Args:
        pairs: Pairs of raters and providers, on a grid or on edges.
        links: Weights of at least 0, one for each pair; those of an agent to itself are ignored.
        peers: Pairs, see `n_agents`.
        start: Distribution over the agents at the start; an agent of two roles is in both arrays
            and counts once.
        a: Probability of a restart, in (0, 1].

    Returns:
        The probabilities divided by the largest, so that the most trusted agent has trust 1.
    """
    xp = namespace(links)
    links = not_self(pairs, peers) * links
    rows = pairs.reduce(links, RATER)
    links, follows = links / pairs.gather(rows + TINY, RATER), rows / (rows + TINY)
    find = _solved if pairs.raters is None else _walked
    tor, top = find(pairs, links, follows, peers, start, a)
    most = xp.maximum(largest(tor), largest(top))
    return Trusts(tor / most, top / most)


def _walked(
    pairs: Ratings, links: Array, follows: Array, peers: Array, start: Trusts, a: float
) -> Trusts:
    """Return v after as many steps as it takes until rounding is all that moves; `follows` is 1 for
    raters with links.

    An agent of two roles is found as a provider.
    """
    xp, many = namespace(links), n_agents(pairs, peers)
    provides = own_role(pairs, xp.ones_like(start.top), peers)
    tor, top = 1 / many + 0 * start.tor, 1 / many + 0 * start.top
    for _ in range(math.ceil(math.log(_REST) / math.log1p(-a)) if a < 1 else 1):
        before = top
        anyone = (1 - a) * (1 - (follows * tor).sum()) / many
        top = (
            (1 - a) * pairs.reduce(links * pairs.gather(tor, RATER), PROVIDER)
            + anyone
            + a * start.top
        )
        alone = anyone + a * start.tor
        tor = own_role(pairs, top, peers) + (1 - provides) * alone
        if bool((abs(top - before) <= _REST * top).all()):
            break
    return Trusts(tor, top)


def _solved(
    pairs: Ratings, links: Array, follows: Array, peers: Array, start: Trusts, a: float
) -> Trusts:
    """Return v from S linear equations.

    All agents without links add the same number to each agent, so the raters' part of v is that
    number times one solution of the equations, plus another solution.
    """
    xp = namespace(links)
    spread, restarted = passed_on([xp.ones_like(follows), a * start.tor], links, peers, 1 - a)
    lost = xp.clip(1 - total(follows * restarted, 0), 0.0, 1.0)  # rounding may leave less than 0
    anyone = (1 - a) * lost / (n_agents(pairs, peers) + (1 - a) * total(follows * spread, 0))
    tor = anyone * spread + restarted
    return Trusts(
        tor, (1 - a) * total(links * pairs.gather(tor, RATER), 0) + anyone + a * start.top
    )


def passed_on(
    sources: list[PerRater], links: PerPair, onward: PerPair, on: float
) -> list[PerRater]:
    """Return what raters get in all, (S, ...) for each source, if a share `on` is passed on in each
    step; on a grid.

    The matrix is diagonally dominant by columns, so rounding cannot make a result negative.

    Args:
        sources: Numbers of at least 0 that raters have by themselves, shape (S, ...) each.
        links: Shares that go from each rater to each provider, shape (S, P, ...), at most 1 by
            rater.
        onward: Shares that go on from each provider to each rater, shape (S, P, ...), at most 1 by
            provider.
        on: Share that is passed on.
    """
    xp = namespace(links)
    here, last_axes = (0, 1), (-2, -1)
    back = xp.moveaxis(onward, here, last_axes) @ xp.moveaxis(links, (0, 1), (-1, -2))
    given = xp.moveaxis(xp.stack(sources, axis=1), here, last_axes)
    matrix = xp.eye(len(links), dtype=links.dtype, device=device_of(links)) - on * back
    solution = xp.moveaxis(xp.linalg.solve(matrix, given), last_axes, here)
    return [solution[:, k, ...] for k in range(len(sources))]


PRE_TRUSTED = 0.5
"""Share a of all trust that comes from pre-trusted agents in EigenTrust."""

_ROUNDING = 1e-6  # scores below it count as 0


class SatisfactionState(NamedTuple):
    """Memory of a model that judges by the satisfaction of each rater with each provider.

    Attributes:
        tor: Trust of the agents that rate, shape (S, ...).
        top: Trust of the agents that provide, shape (P, ...).
        scores: Satisfaction minus dissatisfaction of each pair so far, shape (S, P, ...).
        peers: Flag, 1 where a rater and a provider are one agent, shape (S, P, ...).
    """

    tor: Annotated[PerRater, SHARES]
    top: Annotated[PerProvider, SHARES]
    scores: Annotated[PerPair, BALANCES]
    peers: Annotated[PerPair, FLAGS]


def satisfaction(scores: PerPair) -> PerPair:
    """Return the satisfaction of each pair: the score if it is above 0 by more than rounding, and
    else 0.
    """
    return namespace(scores).where(scores > _ROUNDING, scores, 0.0)


@checked_dataclass
class EigenTrust(Published):
    """EigenTrust: an agent is trusted as far as trusted agents were satisfied with it.

    Kamvar, Schlosser and Garcia-Molina (2003):

        s[i, j] = sum over the ratings that i gave j of f - (1 - f)
        c[i, j] = max(s[i, j], 0) / sum over j of max(s[i, j], 0);   an empty row is p
        t      <- (1 - a) C^T t + a p,   a = 1/2

    over the N agents. The model publishes the fixed point t, divided by its largest entry. An agent
    with two roles has the same trust in both. No agent is pre-trusted more than others: p is 1 / N
    for each. In the paper all agents are peers; here an agent may have one role. An agent that only
    rates has the trust that p gives it, since it cannot be rated. An agent that only provides has
    an empty row.

    Trust is relative to the most trusted agent. It is therefore 1 for every agent where no score is
    above 0: before any rating, and also if every rating is 0.
    """

    rates_raters = True
    source = "Kamvar et al. (2003)"
    cost = "S^2 P + S^3"
    differentiable = False  # a rater's row may become empty in one round
    takes_peers = True

    def start(self, like: PerPair, peers: Peers) -> SatisfactionState:
        """Return the state before any rating. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return self._trusting(Ratings(nothing), nothing, shared(peers, like))

    def update(self, state: SatisfactionState, ratings: Ratings) -> SatisfactionState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        content = ratings.write(0 * state.scores, 2 * ratings.values - 1)
        return self._trusting(ratings.pairs, state.scores + content, state.peers)

    def _trusting(self, pairs: Ratings, scores: Array, peers: Array) -> SatisfactionState:
        each = 1 / n_agents(pairs, peers)
        p = Trusts(
            0 * pairs.reduce(scores, RATER) + each, 0 * pairs.reduce(scores, PROVIDER) + each
        )
        trusts = walk(pairs, satisfaction(scores), peers, p, PRE_TRUSTED)
        return SatisfactionState(*trusts, scores, peers)


POWER = 0.15
"""Share a of all trust that goes to the power nodes directly in PowerTrust."""


class PowerTrustState(NamedTuple):
    """Memory of PowerTrust.

    Attributes:
        tor: Trust of the agents that rate, shape (S, ...).
        top: Trust of the agents that provide, shape (P, ...).
        latest: Latest rating that i gave j, shape (S, P, ...), 0 where there is none.
        heard: Number of ratings that each provider has received, shape (P, ...).
        peers: Flag, 1 where a rater and a provider are one agent, shape (S, P, ...).
    """

    tor: Annotated[PerRater, SHARES]
    top: Annotated[PerProvider, SHARES]
    latest: Annotated[PerPair, SHARES]
    heard: Annotated[PerProvider, COUNTS]
    peers: Annotated[PerPair, FLAGS]


@checked_dataclass
class PowerTrust(Published):
    """PowerTrust: trust passed on as in EigenTrust, by the latest ratings, with an extra share for
    the most rated.

    Zhou and Hwang (2007), their global aggregation without the look-ahead step and without a
    distributed ranking:

        r[i, j] = latest rating that i gave j / sum of the same over j
        v      <- (1 - a) R^T v + a / m for each of the m power nodes,   a = 0.15

    over the N agents. The model publishes the fixed point v, divided by its largest entry. The
    power nodes are the `power_nodes` providers with the most ratings so far, and all others with as
    many ratings as the last of these. Agents may have one role, see `EigenTrust`. A row without
    ratings above 0 is spread evenly over all agents.

    The term a / m is uncertain: it could not be checked against the paper, and was chosen so that v
    sums to 1.

    Trust is relative to the most trusted agent. If every rating is 0, providers that were rated
    equally often therefore have trust 1, however bad they are, and among peers every agent has.

    Attributes:
        power_nodes: Minimum number of power nodes, above 0. If there are fewer providers, all are
            power nodes.
    """

    power_nodes: PositiveInt = 1
    rates_raters = True
    source = "Zhou and Hwang (2007)"
    cost = "S^2 P + S^3"
    differentiable = False  # a rater's row may become empty in one round
    takes_peers = True

    def start(self, like: PerPair, peers: Peers) -> PowerTrustState:
        """Return the state before any rating. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return self._trusting(Ratings(nothing), nothing, 0 * nothing[0], shared(peers, like))

    def update(self, state: PowerTrustState, ratings: Ratings) -> PowerTrustState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        pairs = ratings.pairs
        by_others = not_self(pairs, state.peers) * ratings.write(0 * state.latest, 1.0)
        heard = state.heard + pairs.reduce(by_others, PROVIDER)
        return self._trusting(
            pairs, ratings.write(state.latest, ratings.values), heard, state.peers
        )

    def _trusting(
        self, pairs: Ratings, latest: Array, heard: Array, peers: Array
    ) -> PowerTrustState:
        xp = namespace(latest)
        last = xp.sort(heard, axis=0)[-min(self.power_nodes, len(heard))]
        power = xp.astype(heard >= last, latest.dtype)
        top = power / total(power, 0)
        start = Trusts(own_role(pairs, top, peers), top)
        return PowerTrustState(*walk(pairs, latest, peers, start, POWER), latest, heard, peers)
