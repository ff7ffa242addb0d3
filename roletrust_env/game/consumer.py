"""What consumers get: from the provider that they trust most, and from those that served them."""

from collections.abc import Sequence
from typing import NamedTuple

from roletrust_env.arrays import Array, cast, namespace
from roletrust_env.shapes import PairFlags, PerPair, PerProvider


class Bought(NamedTuple):
    """Qualities that consumers got, in one round or in many.

    Attributes:
        got: Quality that consumers got.
        best: Quality of the best choice.
        blind: Mean quality of a blind choice among all providers.
    """

    got: Array
    best: Array
    blind: Array


def buy(trust: Array, offered: Array, axis: int = 0) -> Bought:
    """Return the qualities that consumers get from the most trusted of the providers that serve and
    have trust; 0 where there is none. Providers with equal trust are equally likely.

    Args:
        trust: Trust of the providers at the time of the choice; NaN where a provider is absent.
        offered: Quality on offer, of the same shape; NaN where a provider does not serve. It may
            have an axis of raters before that of providers, for providers that treat raters
            differently; then the mean over raters counts.
        axis: Axis of the providers.

    Example:
        >>> import numpy as np
        >>> buy(np.array([0.9, 0.2, 0.9]), np.array([0.5, 1.0, 0.1]))._asdict()
        {'got': np.float64(0.3), 'best': np.float64(1.0), 'blind': np.float64(0.5333333333333333)}
    """
    xp = namespace(offered)
    if offered.ndim > trust.ndim:
        of_each = buy(xp.expand_dims(trust, axis=axis), offered, axis + 1)
        return Bought(*(xp.mean(part, axis=axis) for part in of_each))
    on_offer = (offered == offered) & (trust == trust)
    quality, known = (
        xp.where(on_offer, offered, 0 * on_offer),
        xp.where(on_offer, trust, 0 * on_offer - 1),
    )
    chosen = known == xp.max(known, axis=axis, keepdims=True)
    return Bought(
        _mean(quality, chosen, axis), xp.max(quality, axis=axis), _mean(quality, on_offer, axis)
    )


def receive(
    served: PairFlags,
    offered: PerProvider | PerPair,
    ability: PerProvider,
    consumers: Sequence[int],
    honest: Sequence[int],
    providers: int = 1,
) -> Bought:
    """Return the qualities that consumers received in a round, as means over the consumers, shape
    (...).

        got   = mean quality of the services that a consumer received
        best  = mean of the `providers` largest abilities of the honest providers that serve
        blind = mean ability of the honest providers that serve

    The yardsticks, best and blind, depend on nothing that a trust model or an attacker does. All
    three are 0 for a consumer without a service, and where no honest provider serves.

    Args:
        served: Whether a provider served a rater, boolean, shape (S, P, ...).
        offered: Quality on offer, see `Game.offered`, shape (P, ...) or (S, P, ...).
        ability: Ability of the providers, shape (P, ...).
        consumers: Indices of the raters that consume.
        honest: Indices of the honest providers.
        providers: Number of services that a consumer chooses in a round.

    Example:
        >>> import numpy as np
        >>> served, ability = np.array([[True, False], [False, True]]), np.array([0.9, 0.3])
        >>> receive(served, ability, ability, [0, 1], [0, 1])._asdict()
        {'got': np.float64(0.6), 'best': np.float64(0.9), 'blind': np.float64(0.6)}
    """
    xp = namespace(ability)
    mine = served[list(consumers), ...]
    quality = offered[list(consumers), ...] if offered.ndim == served.ndim else offered[None, ...]
    serves = offered == offered
    serves = (serves.any(axis=0) if offered.ndim == served.ndim else serves)[list(honest), ...]
    able = xp.where(serves, ability[list(honest), ...], -1 + 0 * ability[list(honest), ...])
    largest = xp.sort(able, axis=0)[-providers:, ...]
    best, blind = _mean(largest, largest >= 0, 0), _mean(able, serves, 0)
    counts = cast(mine.any(axis=1) & serves.any(axis=0)[None, ...], ability.dtype)
    got = _mean(xp.where(mine, quality, 0 * ability), mine, 1)
    return Bought(*(xp.mean(counts * part, axis=0) for part in (got, best, blind)))


def _mean(values: Array, where: Array, axis: int) -> Array:
    """Return the mean of the values where `where` is true; 0 where it is nowhere true."""
    xp = namespace(values)
    count = xp.sum(where, axis=axis, dtype=values.dtype)
    return xp.sum(values * where, axis=axis) / xp.where(count > 0, count, count + 1)
