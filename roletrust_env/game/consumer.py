"""A consumer that goes by trust: in every round to the most trusted provider."""

from typing import NamedTuple

from roletrust_env.arrays import Array, namespace


class Bought(NamedTuple):
    """Qualities in one round or in many.

    Attributes:
        got: by a consumer that goes to the most trusted provider; of equals each is as likely.
        best: the best that there was.
        blind: by one that goes to any provider, each as likely.
    """

    got: Array
    best: Array
    blind: Array


def buy(trust: Array, offered: Array, axis: int = 0) -> Bought:
    """What consumers get who choose among the providers that serve and have a trust; 0 where there is none.

    Args:
        trust: of the providers, as published when the service is chosen; NaN where one is absent.
        offered: the quality of each for whoever comes, of the same shape; NaN where one does not serve. With an axis
            more, that of the raters before the providers', it is what each rater could have: the mean over them counts.
        axis: of the providers.

    Example:
        >>> import numpy as np
        >>> buy(np.array([0.9, 0.2, 0.9]), np.array([0.5, 1.0, 0.1]))._asdict()
        {'got': np.float64(0.3), 'best': np.float64(1.0), 'blind': np.float64(0.5333333333333333)}
    """
    xp = namespace(offered)
    if offered.ndim > trust.ndim:
        of_each = buy(xp.expand_dims(trust, axis=axis), offered, axis + 1)
        return Bought(*(xp.mean(part, axis=axis) for part in of_each))
    there = (offered == offered) & (trust == trust)
    quality, known = xp.where(there, offered, 0 * there), xp.where(there, trust, 0 * there - 1)
    chosen = there & (known == xp.max(known, axis=axis, keepdims=True))
    return Bought(_mean(quality, chosen, axis), xp.max(quality, axis=axis), _mean(quality, there, axis))


def _mean(values: Array, where: Array, axis: int) -> Array:
    """The mean of some values; 0 of none."""
    xp = namespace(values)
    count = xp.sum(where, axis=axis, dtype=values.dtype)
    return xp.sum(values * where, axis=axis) / xp.where(count > 0, count, count + 1)
