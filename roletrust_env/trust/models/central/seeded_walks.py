"""Models in which trust flows from seeds: raters that are trusted beforehand, as walkers start from
them.

A walker at a rater goes to a provider that satisfies it, as in `eigentrust`. Where that provider is
a rater, too, the walker goes on from there. A provider that cannot rate is a dead end: in a log of
users and products, trust would end at what the seeds have rated themselves. Walkers therefore go
back from it to one of the raters that it satisfies, which trusts raters that like what the seeds
like. This has a price: to praise a good product costs nothing, so that a Sybil reaches the seeds
without any honest agent's help. Among peers it is an honest agent that must be won.

Without names of seeds, every rater is one. Then nobody is trusted beforehand, and Sybils are seeds,
too.
"""

import math
from abc import ABC, abstractmethod
from itertools import count
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import NonNegativeInt

from roletrust_env.arrays import Array, device_of, is_compiling, largest, namespace, total
from roletrust_env.parameters import Inside, Share, Size, checked_dataclass
from roletrust_env.shapes import PerPair, PerProvider, PerRater
from roletrust_env.trees import AMOUNTS, BALANCES, FLAGS, SHARES
from roletrust_env.trust.algorithms import Trusts
from roletrust_env.trust.edges import pair_keys
from roletrust_env.trust.model import Peers
from roletrust_env.trust.models.central.random_walks import (
    SatisfactionState,
    n_agents,
    not_self,
    own_rating_role,
    own_role,
    passed_on,
    satisfaction,
    shared,
)
from roletrust_env.trust.ratings import PROVIDER, RATER, TINY, Published, Ratings

_REST = 1e-15  # a relative step this small is rounding


class WalkGraph(NamedTuple):
    """Satisfied pairs, and the starts of walkers.

    Attributes:
        pairs: Pairs of raters and providers, on a grid or on edges.
        links: Satisfaction of each pair of two agents, at least 0, in the shape of the pairs.
        peers: Flag, 1 where a rater and a provider are one agent, see `random_walks.n_agents`.
        mute: Flag, 1 for a provider that cannot rate, shape (P, ...).
        seeds: Flag, 1 for a seed, shape (S, ...).
        known: Flag, 1 for a seed that is named, of agents.
        start: Share of walkers that start from each rater, shape (S, ...).
    """

    pairs: Ratings
    links: PerPair
    peers: PerPair
    mute: PerProvider
    seeds: PerRater
    known: Trusts
    start: PerRater

    def of_raters(self, values: PerRater) -> Trusts:
        """Return values of raters as values of agents: a provider that rates has that of its other
        role.
        """
        return Trusts(values, own_rating_role(self.pairs, values, self.peers))

    def joined(self, of_raters: PerRater, of_providers: PerProvider) -> Trusts:
        """Return values of agents: the sum over the roles of each, in both arrays."""
        tor = of_raters + own_role(self.pairs, of_providers, self.peers)
        return Trusts(tor, own_rating_role(self.pairs, tor, self.peers) + self.mute * of_providers)

    def backward(self) -> PerPair:
        """Return the satisfaction along which walkers go back: that of pairs with a provider that
        cannot rate.
        """
        return self.links * self.pairs.gather(self.mute, PROVIDER)


@checked_dataclass
class BySeeds(Published, ABC):
    """Base of trust models in which trust flows from seeds along satisfied ratings.

        s[i, j] = sum over the ratings that i gave j of f - (1 - f),   l[i, j] = max(s[i, j], 0)

    A seed has trust 1. The trust of others is relative to the most trusted of them. It is 1 for all
    before anybody is satisfied, and if no trust has reached any of them.

    Attributes:
        seeds: Places of the raters that are trusted beforehand, from 0. One that is not among the
            raters yet counts from when it is. Without names every rater is a seed, and none has
            trust 1 for that.
    """

    seeds: tuple[NonNegativeInt, ...] = ()
    rates_raters = True
    cost = "S^2 P + S^3"
    differentiable = False  # a pair may become satisfied in one round
    takes_peers = True

    def start(self, like: PerPair, peers: Peers) -> Any:
        """Return the state before any rating. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        state = self._blank(nothing, shared(peers, like))
        return self._after(self._graph(Ratings(nothing), state), state)

    def update(self, state: Any, ratings: Ratings) -> Any:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        scores = state.scores + ratings.write(0 * state.scores, 2 * ratings.values - 1)
        state = state._replace(scores=scores)
        return self._after(self._graph(ratings.pairs, state), state)

    def _blank(self, nothing: Array, peers: PerPair) -> Any:
        """Return a state of zeros, of which the trust is still to be found."""
        return SatisfactionState(nothing[:, 0, ...], nothing[0], nothing, peers)

    def _graph(self, pairs: Ratings, state: Any) -> WalkGraph:
        xp, peers = namespace(state.scores), state.peers
        links = not_self(pairs, peers) * satisfaction(state.scores)
        nobody = 0 * pairs.reduce(links, RATER)
        flags = np.zeros(len(nobody))
        flags[
            [place for place in self.seeds if place < len(flags)] if self.seeds else slice(None)
        ] = 1
        flag = xp.asarray(flags, dtype=links.dtype, device=device_of(links))
        seeds = nobody + flag.reshape(-1, *[1] * (nobody.ndim - 1))
        mute = 1 - own_rating_role(pairs, nobody + 1, peers)
        named = seeds if self.seeds else nobody
        known = Trusts(named, own_rating_role(pairs, named, peers))
        return WalkGraph(
            pairs, links, peers, mute, seeds, known, seeds / max(float(flags.sum()), 1.0)
        )

    def _after(self, graph: WalkGraph, state: Any) -> Any:
        """Return the state with the trust that follows from its graph."""
        return state._replace(**self._published(graph, self._reached(graph))._asdict())

    @abstractmethod
    def _reached(self, graph: WalkGraph) -> Trusts:
        """Return what reaches each agent, at least 0, by any measure."""

    def _published(self, graph: WalkGraph, reached: Trusts) -> Trusts:
        """Return 1 for seeds that are named, and for others the share of the largest; see the
        class.
        """
        xp, others = (
            namespace(graph.links),
            [(1 - sure) * x for x, sure in zip(reached, graph.known, strict=True)],
        )
        most = xp.maximum(*map(largest, others))
        most = most * xp.astype(
            largest(graph.pairs.reduce(graph.links, RATER, "max")) > 0, most.dtype
        )
        most, all_alike = xp.where(most > 0, most, most + 1), 1 - xp.astype(most > 0, most.dtype)
        shares = [x / most + all_alike + sure for x, sure in zip(others, graph.known, strict=True)]
        return Trusts(*(xp.clip(share, 0.0, 1.0) for share in shares))


def visits(graph: WalkGraph, alpha: float, back: bool) -> Trusts:
    """Return how often a walker visits each agent on average, the start included.

        v = p + (1 - alpha) C^T v,   C[i, j] = l[i, j] / sum over j of l[i, j],
                p the shares of walkers at the start

    over the agents. A provider j that cannot rate has C[j, i] = l[i, j] / sum over i of l[i, j] if
    `back`, and else an empty row. A walk ends at an agent with an empty row, and in each step with
    probability alpha. On a grid the equations are solved. On edges walkers walk until they are at
    rest.

    Args:
        graph: Graph of the agents.
        alpha: Probability that a walk ends in a step, in (0, 1).
        back: Whether walkers go back from providers that cannot rate.
    """
    pairs, links, on = graph.pairs, graph.links, 1 - alpha
    forward = links / pairs.gather(pairs.reduce(links, RATER) + TINY, RATER)
    behind = graph.backward() if back else 0 * links
    backward = behind / pairs.gather(pairs.reduce(behind, PROVIDER) + TINY, PROVIDER)
    if pairs.raters is None:
        tor = passed_on([graph.start], forward, graph.peers + on * backward, on)[0]
    else:
        tor = graph.start
        for _ in range(math.ceil(math.log(_REST) / math.log1p(-alpha))):
            before, top = tor, on * pairs.reduce(forward * pairs.gather(tor, RATER), PROVIDER)
            tor = graph.start + own_role(pairs, top, graph.peers)
            tor = tor + on * pairs.reduce(backward * pairs.gather(top, PROVIDER), RATER)
            if bool((abs(tor - before) <= _REST * tor).all()):
                break
    top = on * pairs.reduce(forward * pairs.gather(tor, RATER), PROVIDER)
    return Trusts(tor, graph.of_raters(tor).top + graph.mute * top)


@checked_dataclass
class PersonalizedPageRank(BySeeds):
    """Personalized PageRank: an agent is trusted as far as a walker from the seeds is found there.

    Page, Brin, Motwani and Winograd (1999), "The PageRank Citation Ranking", section 6:

        v = (1 - alpha) C^T v + alpha p,   C[i, j] = l[i, j] / sum over j of l[i, j]

    over the agents, with p the same for each seed and 0 for others, and l as in `eigentrust`: the
    satisfaction, at least 0. From an agent with an empty row a walker starts anew from a seed. From
    a provider that cannot rate it goes back to a rater that it satisfies, C[j, i] = l[i, j] / sum
    over i of l[i, j], as in random walks between users and items. This is not in the paper, where
    all are peers. It lets raters be trusted where nobody rates them, and lets Sybils in that praise
    what seeds like; without `back` only the ratings of seeds, and of the raters that they trust,
    count. With alpha = 1/2 and without `back` it is EigenTrust, of which the pre-trusted peers are
    the seeds.

    A seed has trust 1. The trust of others is relative to the most trusted of them. It is 1 for all
    before anybody is satisfied, and if no trust has reached any of them.

    Attributes:
        alpha: Probability that a walker starts anew in a step, in [0.001, 0.999].
        back: Whether walkers go back from providers that cannot rate.
    """

    alpha: Inside = 0.15
    back: bool = True
    source = "Page et al. (1999)"

    def _reached(self, graph: WalkGraph) -> Trusts:
        return visits(graph, self.alpha, self.back)


class Merits(NamedTuple):
    """Shares of visits of the agents, summed over epochs.

    Attributes:
        of_raters: Share of each agent that rates, shape (S, ...).
        of_providers: Share of each agent that provides, shape (P, ...).
    """

    of_raters: Annotated[PerRater, AMOUNTS]
    of_providers: Annotated[PerProvider, AMOUNTS]


class MeritRankState(NamedTuple):
    """Memory of MeritRank.

    Attributes:
        tor: Trust of the agents that rate, shape (S, ...).
        top: Trust of the agents that provide, shape (P, ...).
        scores: Satisfaction minus dissatisfaction of each pair so far, shape (S, P, ...).
        peers: Flag, 1 where a rater and a provider are one agent, shape (S, P, ...).
        merits: Merit of each agent, see `Merits`.
    """

    tor: Annotated[PerRater, SHARES]
    top: Annotated[PerProvider, SHARES]
    scores: Annotated[PerPair, BALANCES]
    peers: Annotated[PerPair, FLAGS]
    merits: Merits


@checked_dataclass
class MeritRank(BySeeds):
    """MeritRank: personalized PageRank that decays with distance, behind bridges and with time.

    Nasrulin, Ishmaev and Pouwelse (2022), over walks from the seeds:

        r[j] = visits of j after the start of a walk / all such visits of agents other than seeds
        R[j] <- (1 - gamma) R[j] + (1 - beta b[j]) r[j],   b[j] = 1 behind a bridge, else 0

    - Transitivity decay `alpha`: a walk ends in each step with this probability, and at an agent
      without links.
    - Connectivity decay `beta`: an agent is behind a bridge if all walks that reach it have passed
      one other agent that is no seed, such as an attacker with all of its Sybils behind it. Where
      every rater is a seed, nobody is.
    - Epoch decay `gamma`: an epoch is a round. With 1 only the present graph counts, in which no
      rating is forgotten.

    The authors sample walks; here r is exact and bridges are those of the graph. Their experiments
    decay an agent by the largest share of its walks that pass one other agent, if that is 1. Later
    code of their group does so above a threshold of 0.95. Walks go back from providers that cannot
    rate, as in `personalized-pagerank`, of which this is the same for named seeds with beta = 0 and
    gamma = 1.

    A seed has trust 1. The trust of others is relative to the most trusted of them. It is 1 for all
    before anybody is satisfied, and if no trust has reached any of them.

    Attributes:
        alpha: Probability that a walk ends in a step, in [0.001, 0.999].
        beta: Share of the merit that an agent behind a bridge loses, in [0, 1].
        gamma: Share of the former merit that is lost in each round, in [0, 1].
        back: Whether walkers go back from providers that cannot rate.
    """

    alpha: Inside = 0.15
    beta: Share = 0.5
    gamma: Share = 1.0
    back: bool = True
    source = "Nasrulin et al. (2022)"

    def _blank(self, nothing: Array, peers: PerPair) -> Any:
        tor, top = nothing[:, 0, ...], nothing[0]
        return MeritRankState(tor, top, nothing, peers, Merits(tor, top))

    def _after(self, graph: WalkGraph, state: Any) -> Any:
        new = zip(state.merits, self._reached(graph), strict=True)
        merits = Merits(*((1 - self.gamma) * old + gain for old, gain in new))
        return MeritRankState(
            *self._published(graph, Trusts(*merits)), state.scores, state.peers, merits
        )

    def _reached(self, graph: WalkGraph) -> Trusts:
        """Return (1 - beta b) r."""
        xp, started = namespace(graph.links), graph.of_raters(graph.start)
        reached = zip(visits(graph, self.alpha, self.back), started, graph.known, strict=True)
        tor, top = ((1 - sure) * xp.clip(x - first, 0.0, None) for x, first, sure in reached)
        visited = total(tor, 0) + total(graph.mute * top, 0) + TINY
        bridged = behind_bridges(graph, self.back) if self.seeds else Trusts(0 * tor, 0 * top)
        return Trusts(
            *((1 - self.beta * b) * x / visited for b, x in zip(bridged, (tor, top), strict=True))
        )


def behind_bridges(graph: WalkGraph, back: bool) -> Trusts:
    """Return 1 for each agent that walks from the seeds reach through one other agent only, which
    is no seed; else 0.

    It is a search from the seeds. Agents that a seed has a link to are heads: no other agent is on
    all walks to them. Each head sends its own label on, and others send on the label that has
    reached them. Where two labels meet, two walks meet that have no agent in common but seeds: this
    agent is a head, too, and the search begins again. In the end all others have the label of the
    head that all of their walks pass. Where every rater is a seed, all are heads.

    Args:
        graph: Graph of the agents.
        back: Whether walkers go back from providers that cannot rate.
    """
    pairs, xp = graph.pairs, namespace(graph.links)
    ahead = xp.astype(graph.links > 0, graph.links.dtype)
    behind = ahead * pairs.gather(graph.mute, PROVIDER) * float(back)
    n_raters, n_providers = pairs.shape
    last = n_raters + n_providers + 1.0

    def received(sent: Trusts) -> Trusts:
        """Return the largest label that is sent to each agent, and 0 where there is none."""
        top = pairs.reduce(ahead * pairs.gather(sent.tor, RATER), PROVIDER, "max")
        tor = pairs.reduce(behind * pairs.gather(sent.top, PROVIDER), RATER, "max")
        tor = xp.maximum(tor, own_role(pairs, top, graph.peers))
        return Trusts(tor, xp.maximum(graph.of_raters(tor).top, graph.mute * top))

    def numbered(like: Array, first: int) -> Array:
        places = xp.arange(len(like), dtype=like.dtype, device=device_of(like)) + first
        return 0 * like + places.reshape(-1, *[1] * (like.ndim - 1))

    seeds = graph.of_raters(graph.seeds)
    names = graph.of_raters(numbered(graph.seeds, 1))
    names = Trusts(names.tor, names.top + graph.mute * numbered(graph.mute, n_raters + 1))
    heads = Trusts(*((1 - seed) * near for seed, near in zip(seeds, received(seeds), strict=True)))
    labels = Trusts(0 * names.tor, 0 * names.top)
    for _ in range(2 * (n_raters + n_providers)) if is_compiling(graph.links) else count():
        sent = [
            xp.where(head > 0, name, label)
            for head, name, label in zip(heads, names, labels, strict=True)
        ]
        high = received(Trusts(*sent))
        low = received(Trusts(*(xp.where(x > 0, last - x, 0.0) for x in sent)))
        free = [(1 - seed) * (1 - head) for seed, head in zip(seeds, heads, strict=True)]
        met = [
            xp.where((highest > 0) & (highest + other != last), x, 0.0)
            for highest, other, x in zip(high, low, free, strict=True)
        ]
        again = xp.maximum(largest(met[0]), largest(met[1])) > 0
        after = Trusts(
            *(xp.where(again, 0.0, x * share) for x, share in zip(free, high, strict=True))
        )
        moved = xp.any(again) | xp.any(after.tor != labels.tor) | xp.any(after.top != labels.top)
        heads, labels = Trusts(*(head + x for head, x in zip(heads, met, strict=True))), after
        if not is_compiling(graph.links) and not bool(moved):
            break
    return Trusts(*(xp.astype(label > 0, label.dtype) for label in labels))


@checked_dataclass
class SybilRank(BySeeds):
    """SybilRank: short random walks from the seeds rarely cross the few edges between honest agents
    and Sybils.

    Cao, Sirivianos, Yang and Pregueiro (2012), over the undirected graph of the agents:

        T_0[v] = 1 / number of seeds for a seed, else 0
        T_k[v] = sum over the neighbours u of v of T_(k - 1)[u] / deg[u]
        trust[v] = T_w[v] / deg[v],   w = log2 of the number of agents, rounded up

    In the paper both sides have agreed to an edge. Here two agents that both can rate are
    neighbours if each is satisfied with the other. Where one of them cannot rate, the satisfaction
    of the other makes the edge: a Sybil then has as many edges to honest providers as it likes, and
    the assumption of the paper fails. Where no agent has both roles, all walkers are among the
    raters after an even number of steps, and among the providers after an odd one; the trust of
    each side is then that of the last step in which they are there.

    A seed has trust 1. The trust of others is relative to the most trusted of them. It is 1 for all
    before anybody is satisfied, and if no trust has reached any of them.

    Attributes:
        steps: Number of steps w. None is that of the paper.
    """

    steps: Size | None = None
    source = "Cao et al. (2012)"
    cost = "S^2 P"

    def _reached(self, graph: WalkGraph) -> Trusts:
        pairs, xp = graph.pairs, namespace(graph.links)
        edges = _agreed(graph)
        degrees = graph.joined(pairs.reduce(edges, RATER), pairs.reduce(edges, PROVIDER))
        trust = graph.of_raters(graph.start)
        size = n_agents(pairs, graph.peers) + 0 * total(trust.tor, 0)
        before = Trusts(0 * trust.tor, 0 * trust.top)
        for k in range(self.steps or math.ceil(math.log2(sum(pairs.shape)))):
            sent = Trusts(*(x / (degree + TINY) for x, degree in zip(trust, degrees, strict=True)))
            top = pairs.reduce(edges * pairs.gather(sent.tor, RATER), PROVIDER)
            tor = pairs.reduce(edges * pairs.gather(sent.top, PROVIDER), RATER)
            walks, after = (size > 0) if self.steps else (size > 2**k), graph.joined(tor, top)
            before = Trusts(*(xp.where(walks, x, y) for x, y in zip(trust, before, strict=True)))
            trust = Trusts(*(xp.where(walks, x, y) for x, y in zip(after, trust, strict=True)))
        two_sides = xp.astype(size == sum(pairs.shape), size.dtype)
        landed = (x + two_sides * y for x, y in zip(trust, before, strict=True))
        return Trusts(*(x / (degree + TINY) for x, degree in zip(landed, degrees, strict=True)))


def _agreed(graph: WalkGraph) -> Array:
    """Return the weight of the edge of each pair: half of that of two peers, which is in both of
    their pairs.
    """
    pairs, xp = graph.pairs, namespace(graph.links)
    linked = xp.astype(graph.links > 0, graph.links.dtype)
    provides = own_role(pairs, 1 + 0 * graph.mute, graph.peers)
    two = pairs.gather(provides, RATER) * pairs.gather(1 - graph.mute, PROVIDER)
    return linked * (1 - two + two * _returned(graph, linked) / 2)


def _returned(graph: WalkGraph, values: Array) -> Array:
    """Return, for each pair of two peers, the value of the pair in which they have the other roles;
    0 for others.
    """
    pairs, xp = graph.pairs, namespace(values)
    if pairs.raters is None or pairs.providers is None:
        here, last_axes = (0, 1), (-2, -1)
        peers, turned = (
            xp.moveaxis(graph.peers, here, last_axes),
            xp.moveaxis(values, here, (-1, -2)),
        )
        return xp.moveaxis(peers @ turned @ peers, last_axes, here)
    if pairs.twins is None or not len(values):
        return 0 * values
    provider_of = xp.zeros(pairs.shape[0], dtype=pairs.twins.dtype, device=device_of(values)) - 1
    both = xp.nonzero(pairs.twins >= 0)[0]
    provider_of[pairs.twins[both]] = both
    raters, providers = pairs.twins[pairs.providers], provider_of[pairs.raters]
    keys = pair_keys(pairs.raters, pairs.providers)
    order = xp.argsort(keys)
    wanted = pair_keys(xp.where(raters < 0, 0, raters), xp.where(providers < 0, 0, providers))
    place = xp.clip(xp.searchsorted(keys[order], wanted), 0, len(keys) - 1)
    known = (keys[order][place] == wanted) & (raters >= 0) & (providers >= 0)
    return xp.where(known, values[order][place], 0.0)
