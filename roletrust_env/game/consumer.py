"""A consumer that chooses the most trusted provider in every round."""

from typing import NamedTuple

from roletrust_env.arrays import Array, namespace


class Bought(NamedTuple):
    """Qualities that consumers got, in one round or in many.

    Attributes:
        got: Quality from the most trusted provider; providers with equal trust are equally likely.
        best: Best quality on offer.
        blind: Mean quality of a blind choice among all providers.
    """

    got: Array
    best: Array
    blind: Array


def buy(trust: Array, offered: Array, axis: int = 0, temperature: float = 0.0) -> Bought:
    """Return the qualities that consumers get from the providers that serve and have trust; 0 where
    there is none.

    Args:
        trust: Trust of the providers at the time of the choice; NaN where a provider is absent.
        offered: Quality on offer, of the same shape; NaN where a provider does not serve. It may
            have an axis of raters before that of providers, for providers that treat raters
            differently; then the mean over raters counts.
        axis: Axis of the providers.
        temperature: Above 0, the choice is at random in proportion to exp(trust / temperature),
            which has a slope for gradients.

    Example:
        >>> import numpy as np
        >>> buy(np.array([0.9, 0.2, 0.9]), np.array([0.5, 1.0, 0.1]))._asdict()
        {'got': np.float64(0.3), 'best': np.float64(1.0), 'blind': np.float64(0.5333333333333333)}
    """
    xp = namespace(offered)
    if offered.ndim > trust.ndim:
        of_each = buy(xp.expand_dims(trust, axis=axis), offered, axis + 1, temperature)
        return Bought(*(xp.mean(part, axis=axis) for part in of_each))
    on_offer = (offered == offered) & (trust == trust)
    quality, known = (
        xp.where(on_offer, offered, 0 * on_offer),
        xp.where(on_offer, trust, 0 * on_offer - 1),
    )
    highest = xp.max(known, axis=axis, keepdims=True)
    chosen = (
        on_offer * xp.exp((known - highest) / temperature) if temperature > 0 else known == highest
    )
    return Bought(
        _mean(quality, chosen, axis), xp.max(quality, axis=axis), _mean(quality, on_offer, axis)
    )


def _mean(values: Array, where: Array, axis: int) -> Array:
    """Return the mean of the values where `where` is true; 0 where it is nowhere true."""
    xp = namespace(values)
    count = xp.sum(where, axis=axis, dtype=values.dtype)
    return xp.sum(values * where, axis=axis) / xp.where(count > 0, count, count + 1)
