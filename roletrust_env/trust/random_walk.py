"""What the models share that pass trust on from agent to agent: a random walk along who thinks well of whom.

A rater and a provider that are one agent have one trust; all others are agents of one role, so that raters whom nobody
can rate stand beside providers who rate nobody. Nobody's opinion of itself counts.
"""

from roletrust_env.arrays import Array, largest, namespace, total
from roletrust_env.trust.algorithms import Trusts

_TINY = 1e-30  # a row that sums to so little is empty


def shared(peers: Array, like: Array) -> Array:
    """1 where a rater and a provider are one agent, 0 elsewhere, for every game of a batch.

    Args:
        peers: the same as booleans, shape (S, P).
        like: an array of shape (S, P, ...) that shows the shape and the dtype.
    """
    xp = namespace(like)
    return xp.zeros_like(like) + xp.astype(peers, like.dtype).reshape(*peers.shape, *[1] * (like.ndim - 2))


def number(peers: Array) -> Array:
    """The number of agents N, shape (...), of `shared` peers."""
    return sum(peers.shape[:2]) - total(total(peers, 0), 0)


def walk(links: Array, peers: Array, start: Trusts, a: float) -> Trusts:
    """Where a walker is found who follows the links of raters, or with probability a starts anew: PageRank.

        v = (1 - a) C^T v + a start,   C[i, j] = links[i, j] / sum over j of links[i, j]

    An agent without links, such as a provider that does not rate, sends the walker to anyone of the N. What so comes to
    each is one number, so the raters' part of v is that number times one solution of S linear equations, plus another.

    Args:
        links: at least 0, shape (S, P, ...); those of an agent to itself are left out.
        peers: as of `shared`.
        start: where the walk begins, a distribution over the agents; an agent of two roles stands in both, once.
        a: how often it begins anew, in (0, 1].

    Returns:
        The probabilities as shares of the largest, so that the most trusted agent has trust 1.
    """
    xp = namespace(links)
    links = (1 - peers) * links
    rows = total(links, 1)
    links, follows = links / (rows + _TINY)[:, None, ...], rows / (rows + _TINY)
    spread, restarted = _from_both(xp.ones_like(rows), a * start.tor, links, peers, 1 - a)
    lost = xp.clip(1 - total(follows * restarted, 0), 0.0, 1.0)  # of nothing, rounding leaves now and then less
    anyone = (1 - a) * lost / (number(peers) + (1 - a) * total(follows * spread, 0))
    tor = anyone * spread + restarted
    top = (1 - a) * total(links * tor[:, None, ...], 0) + anyone + a * start.top
    most = xp.maximum(largest(tor), largest(top))
    return Trusts(tor / most, top / most)


def _from_both(one: Array, other: Array, links: Array, peers: Array, on: float) -> tuple[Array, Array]:
    """What raters have of either source, (S, ...) each, if a share `on` of it is handed on to raters that are rated.

    The matrix is diagonally dominant by columns, so that rounding cannot make anything negative.
    """
    xp = namespace(links)
    here, there = (0, 1), (-2, -1)
    back = xp.moveaxis(peers, here, there) @ xp.moveaxis(links, (0, 1), (-1, -2))
    sources = xp.moveaxis(xp.stack([one, other], axis=1), here, there)
    kept = xp.eye(len(links), dtype=links.dtype, device=links.device) - on * back
    found = xp.moveaxis(xp.linalg.solve(kept, sources), there, here)
    return found[:, 0, ...], found[:, 1, ...]
