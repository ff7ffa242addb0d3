"""The common part of models that pass trust on from agent to agent: a random walk along good ratings.

A rater and a provider that are one agent have one trust. All others are agents of one role: a rater that cannot be
rated, or a provider that does not rate. An agent's opinion of itself does not count.
"""

from roletrust_env.arrays import Array, largest, namespace, total
from roletrust_env.trust.algorithms import Trusts

_TINY = 1e-30  # a row with a sum this small is empty


def shared(peers: Array, like: Array) -> Array:
    """Return 1 where a rater and a provider are one agent, 0 elsewhere, for every game of a batch.

    Args:
        peers: Pairs as booleans, shape (S, P).
        like: Array of shape (S, P, ...) that shows the shape and the dtype.
    """
    xp = namespace(like)
    return xp.zeros_like(like) + xp.astype(peers, like.dtype).reshape(*peers.shape, *[1] * (like.ndim - 2))


def number(peers: Array) -> Array:
    """Return the number of agents N, shape (...), for peers from `shared`."""
    return sum(peers.shape[:2]) - total(total(peers, 0), 0)


def walk(links: Array, peers: Array, start: Trusts, a: float) -> Trusts:
    """Return where a random walker is found that follows links, or restarts with probability a: PageRank.

        v = (1 - a) C^T v + a start,   C[i, j] = links[i, j] / sum over j of links[i, j]

    From an agent without links, such as a provider that does not rate, the walker goes to any of the N agents alike.
    This adds the same number to each agent, so the raters' part of v is that number times one solution of S linear
    equations, plus another solution.

    Args:
        links: Weights of at least 0, shape (S, P, ...); those of an agent to itself are ignored.
        peers: Pairs, see `shared`.
        start: Distribution over the agents at the start; an agent of two roles is in both arrays and counts once.
        a: Probability of a restart, in (0, 1].

    Returns:
        The probabilities divided by the largest, so that the most trusted agent has trust 1.
    """
    xp = namespace(links)
    links = (1 - peers) * links
    rows = total(links, 1)
    links, follows = links / (rows + _TINY)[:, None, ...], rows / (rows + _TINY)
    spread, restarted = _from_both(xp.ones_like(rows), a * start.tor, links, peers, 1 - a)
    lost = xp.clip(1 - total(follows * restarted, 0), 0.0, 1.0)  # rounding may leave less than 0
    anyone = (1 - a) * lost / (number(peers) + (1 - a) * total(follows * spread, 0))
    tor = anyone * spread + restarted
    top = (1 - a) * total(links * tor[:, None, ...], 0) + anyone + a * start.top
    most = xp.maximum(largest(tor), largest(top))
    return Trusts(tor / most, top / most)


def _from_both(one: Array, other: Array, links: Array, peers: Array, on: float) -> tuple[Array, Array]:
    """Return the raters' part of either source, (S, ...) each, if a share `on` is passed on along links to raters.

    The matrix is diagonally dominant by columns, so rounding cannot make a result negative.
    """
    xp = namespace(links)
    here, there = (0, 1), (-2, -1)
    back = xp.moveaxis(peers, here, there) @ xp.moveaxis(links, (0, 1), (-1, -2))
    sources = xp.moveaxis(xp.stack([one, other], axis=1), here, there)
    kept = xp.eye(len(links), dtype=links.dtype, device=links.device) - on * back
    found = xp.moveaxis(xp.linalg.solve(kept, sources), there, here)
    return found[:, 0, ...], found[:, 1, ...]
