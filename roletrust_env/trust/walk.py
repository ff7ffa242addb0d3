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


def walk(links: Array, peers: Array, start: Trusts, a: float, steps: int) -> Trusts:
    """Where a walker is found who follows the links of raters, or with probability a starts anew.

        v <- (1 - a) C^T v + a start,   C[i, j] = links[i, j] / sum over j of links[i, j]

    An agent without links, such as a provider that does not rate, sends the walker to anyone of the N.

    Args:
        links: at least 0, shape (S, P, ...); those of an agent to itself are left out.
        peers: as of `shared`.
        start: where the walk begins, a distribution over the agents; an agent of two roles stands in both, once.
        a: how often it begins anew, in (0, 1].
        steps: of the walk; what is still wrong then is at most (1 - a)^steps.

    Returns:
        The probabilities as shares of the largest, so that the most trusted agent has trust 1.
    """
    links = (1 - peers) * links
    rows = total(links, 1)
    links, follows = links / (rows + _TINY)[:, None, ...], rows / (rows + _TINY)
    alone, everybody = 1 - total(peers, 1), number(peers)
    xp, (tor, top) = namespace(links), start
    for _ in range(steps):
        anyone = (
            (1 - a) * xp.clip(1 - total(follows * tor, 0), 0.0, 1.0) / everybody
        )  # of nobody, rounding may leave less
        top = (1 - a) * total(links * tor[:, None, ...], 0) + anyone + a * start.top
        tor = total(peers * top, 1) + alone * (anyone + a * start.tor)
    most = xp.maximum(largest(tor), largest(top))
    return Trusts(tor / most, top / most)
