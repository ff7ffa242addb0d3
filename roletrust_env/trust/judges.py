"""What the personal models share: every rater is a judge of its own, and what is published is the judges' mean.

A judge's trust in the providers is T, shape (S, P, ...), and its credence in the raters as advisers C, shape
(S, S, ...): axis 0 is the judge, axis 1 whom it judges. A compromised judge counts as one of S, and no more.
"""

from roletrust_env.arrays import Array, namespace


def others(like: Array) -> Array:
    """1 where judge and adviser are two, 0 where they are one, shape (S, S, 1, ...) to go with (S, S, ...).

    Args:
        like: an array of shape (S, P, ...) that shows S, the number of axes, the dtype and the array library.
    """
    xp, s = namespace(like), like.shape[0]
    return (1 - xp.eye(s, dtype=like.dtype, device=like.device)).reshape(s, s, *[1] * (like.ndim - 2))


def published_providers(trust: Array) -> Array:
    """The mean over the judges of their trust in each provider, shape (P, ...), of T, shape (S, P, ...)."""
    return trust.sum(axis=0) / trust.shape[0]


def published_raters(credence: Array) -> Array:
    """The mean over the other judges of their credence in each rater, shape (S, ...), of C, shape (S, S, ...).

    A rater that is alone is judged by nobody, and has trust 1.
    """
    s = credence.shape[0]
    if s == 1:
        return 0 * credence[0] + 1
    return (others(credence) * credence).sum(axis=0) / (s - 1)
