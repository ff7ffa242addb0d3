"""The Beta distribution in array arithmetic, for models that count successes and failures.

The functions take a and b from 1 to a million, which is more than a game counts. In float64, masses
are accurate to 1e-9 for a and b up to a hundred and to 1e-8 beyond, and quantiles to 1e-8
(quantiles below 1e-3 to 1e-6). In float32, quantiles are accurate to 2e-6, and masses to 1e-5 for a
and b up to a hundred, to 1e-3 at ten thousand, and worse beyond. All functions run on NumPy and
torch, on batches, on torch in a fixed number of operations.

The variable is the log odds. In it the density x^a (1 - x)^b / B(a, b) has one peak, at the mean x
= a / (a + b), is log-concave, and falls off at least exponentially. A tail is therefore an integral
over an interval of known length, which the Gauss-Legendre rule computes with a few dozen nodes.
Logarithms of large gamma functions are not needed: Stirling's formula gives the height of the peak,
and only its small remainders are computed.
"""

import math
from collections.abc import Callable

import numpy as np

from roletrust_env.arrays import Array, device_of, namespace

_NODES, _WEIGHTS = ((np.polynomial.legendre.leggauss(24) + np.array([[1.0], [0.0]])) / 2).tolist()
"""The Gauss-Legendre rule with 24 nodes on [0, 1]."""

# a density is neglected where it is exp(-16), about 1e-7, of that at the start of the tail
_LOST = 16.0
_SHIFTS = 3  # shifts the argument of Stirling's series to at least 4
_TINY = 1e-30  # replaces 0 in logarithms
_UNSURE = 1e-3  # a logarithm of a density in float32 is accurate to this

_BLOCK = 1_000
"""Number of masses that NumPy computes at a time: the values at all nodes fit into a processor's
cache."""


def reputation(successes: Array, failures: Array, initial: float = 0.5) -> Array:
    """Return the mean of Beta(r + 2 initial, s + 2 (1 - initial)): `initial` is the base rate,
    worth two ratings.

    Args:
        successes: Successes r, at least 0, of any shape.
        failures: Failures s, at least 0, of the same shape.
        initial: Mean without evidence, in [0, 1]; 0.5 gives Laplace's (r + 1) / (r + s + 2).
    """
    return (successes + 2 * initial) / (successes + failures + 2)


def log_gamma(z: Array) -> Array:
    """Return the logarithm of the gamma function by Stirling's formula, accurate to rounding for z
    of at least 1.

    Example:
        >>> import numpy as np
        >>> bool(np.isclose(log_gamma(np.array(5.0)), np.log(24)))
        True
    """
    xp, far = namespace(z), z + _SHIFTS
    rising = z * (z + 1) * (z + 2)  # gamma of z + 3 over gamma of z
    return (
        (far - 0.5) * xp.log(far)
        - far
        + 0.5 * math.log(2 * math.pi)
        + _series(far)
        - xp.log(rising)
    )


def mass_below(x: Array, a: Array, b: Array) -> Array:
    """Return the mass of Beta(a, b) below x, the regularised incomplete beta function I_x(a, b).

    Args:
        x: Array that broadcasts with a and b; values outside [0, 1] count as the nearer end.
        a: First parameter, at least 1.
        b: Second parameter, at least 1, of the shape and dtype of a.

    Returns:
        An array in [0, 1], in the dtype of a.

    Example:
        >>> import numpy as np
        >>> mass_below(np.array([0.0, 0.25, 1.0]), np.array(2.0), np.array(1.0)).round(9)
        array([0.    , 0.0625, 1.    ])
    """
    tail_mass, above = _beyond(x, a, b)
    return namespace(a).where(above, 1.0 - tail_mass, tail_mass)


def mass_between(low: Array, high: Array, a: Array, b: Array) -> Array:
    """Return the mass of Beta(a, b) between two bounds, low <= high, never below 0; see
    `mass_below`.
    """
    return namespace(a).clip(mass_below(high, a, b) - mass_below(low, a, b), 0.0, 1.0)


def quantile(q: float, a: Array, b: Array) -> Array:
    """Return the x below which a mass q of Beta(a, b) lies.

    Newton's method is applied to the logarithm of the mass, which is concave since the density is
    log-concave in the log odds. After one step it approaches from below and cannot overshoot.

    Args:
        q: Mass, in [1e-6, 1 - 1e-6].
        a: First parameter, at least 1.
        b: Second parameter, at least 1, of the shape and dtype of a.

    Returns:
        An array in [0, 1], of the shape and dtype of a.

    Example:
        >>> import numpy as np
        >>> quantile(0.01, np.array([1.0, 11.0]), np.array([1.0, 1.0])).round(3)
        array([0.01 , 0.658])
    """
    if q > 0.5:
        return 1.0 - quantile(1.0 - q, b, a)
    xp = namespace(a)
    t = math.sqrt(-2 * math.log(q))
    normal = (2.30753 + 0.27061 * t) / (
        1 + 0.99229 * t + 0.04481 * t * t
    ) - t  # Abramowitz and Stegun 26.2.22
    offset, height = normal / xp.sqrt(_precision(a, b)), _log_height(a, b)
    for _ in range(4 if q >= 0.01 else 5):  # steps from the quantile of the normal distribution
        tail = _tail(offset, a, b)
        offset = offset - (height + _fall(offset, a, b) + xp.log(tail) - math.log(q)) * tail
    odds = a / b * xp.exp(offset)
    return odds / (1.0 + odds)


def between_quantiles(q: float, a: Array, b: Array) -> Callable[[Array], Array]:
    """Return a function that says whether x lies between the q and the 1 - q quantile of Beta(a,
    b), boolean.

    On NumPy it compares the mass beyond x, seen from the mean, with q, which takes few integrals:
    by Chernoff's bound the mass is at most the density relative to its peak. And it is above q if
    the logarithm of that density is above 1 + ln(y) - y, y = -ln(q) > 1, which holds in the limit a
    = 1, b without end, and by a margin elsewhere; this was checked on a grid. Elsewhere the
    quantiles are computed, once for all x, since a compiler has to unroll the calls.

    Args:
        q: Mass, in [1e-6, 0.5).
        a: First parameter, at least 1.
        b: Second parameter, at least 1, of the shape and dtype of a.

    Example:
        >>> import numpy as np
        >>> between_quantiles(0.01, np.array(1.0), np.array(1.0))(np.array([0.005, 0.5, 0.995]))
        array([False,  True, False])
    """
    if isinstance(a, np.ndarray):
        total, most = a + b, -math.log(q)
        peak = a * np.log(a / total) + b * np.log(b / total)
        least = 1 + math.log(most) - most if most > 1 else math.inf

        def is_between(x: Array) -> Array:
            x = np.clip(x, _TINY, 1 - np.finfo(a.dtype).epsneg)
            fall = a * np.log(x) + b * np.log1p(-x) - peak
            between = np.asarray(fall > least)
            unclear = (fall > -most - _UNSURE) & ~between
            if unclear.any():
                tail_mass, _ = _beyond(*(array[unclear] for array in np.broadcast_arrays(x, a, b)))
                between[unclear] = (q <= tail_mass) & (tail_mass <= 1.0 - q)
            return between

        return is_between
    xp = namespace(a)
    low, below_one = quantile(
        q, xp.stack([a, b]), xp.stack([b, a])
    )  # compiles faster than two calls
    return lambda x: (low <= x) & (x <= 1 - below_one)


def _beyond(x: Array, a: Array, b: Array) -> tuple[Array, Array]:
    """Return the mass beyond x, seen from the mean, and whether x is above the mean.

    NumPy leaves out integrals. Beyond 0 and 1 the mass is 0. By Chernoff's bound, it is at most the
    density relative to its peak; where that is lost in the rounding of 1, it is 0 as well.
    """
    xp = namespace(a)
    if isinstance(a, np.ndarray) and ((x <= 0) | (x >= 1)).any():
        x, a, b = np.broadcast_arrays(x, a, b)
        tail_mass, above, inside = np.zeros_like(a), x >= 1, ~((x <= 0) | (x >= 1))
        tail_mass[inside], above[inside] = _beyond(x[inside], a[inside], b[inside])
        return tail_mass, above
    offset = xp.log(xp.clip(x, _TINY, 1.0)) - xp.log(xp.clip(1.0 - x, _TINY, 1.0)) - xp.log(a / b)
    above = offset > 0
    a, b = xp.where(above, b, a), xp.where(above, a, b)
    offset = -abs(offset)
    fall = _fall(offset, a, b)
    if not isinstance(fall, np.ndarray):
        return xp.exp(_log_height(a, b) + fall) * _tail(offset, a, b), above
    tail_mass, tails = xp.zeros_like(fall), fall > math.log(xp.finfo(fall.dtype).eps)
    offset, a, b = offset[tails], a[tails], b[tails]
    tail_mass[tails] = xp.exp(_log_height(a, b) + fall[tails]) * _tail(offset, a, b)
    return tail_mass, above


def _precision(a: Array, b: Array) -> Array:
    """Return the curvature of the density at its peak: one over the square of the width of the
    bell.
    """
    return a * b / (a + b)


def _fall(offset: Array, a: Array, b: Array) -> Array:
    """Return the log of the density relative to its peak, at an offset of the log odds from the
    peak; 0 or less.
    """
    xp, mean = namespace(a), a / (a + b)
    return a * offset - (a + b) * xp.log(1.0 - mean + mean * xp.exp(offset))


def _log_height(a: Array, b: Array) -> Array:
    """Return the logarithm of the density in the log odds, at its peak."""
    xp = namespace(a)
    return (
        0.5 * xp.log(_precision(a, b) / (2 * math.pi))
        + _remainder(a + b)
        - _remainder(a)
        - _remainder(b)
    )


def _tail(offset: Array, a: Array, b: Array) -> Array:
    """Return the mass below an offset from the peak, relative to the density there.

    The length of the interval is the sum of two sufficient ones, of a bell and of an exponential
    tail.
    """
    if isinstance(a, np.ndarray) and a.size > _BLOCK:
        blocks = (slice(at, at + _BLOCK) for at in range(0, len(a), _BLOCK))
        return np.concatenate([_tail(offset[block], a[block], b[block]) for block in blocks])
    xp = namespace(a)
    nodes, weights = (
        xp.reshape(xp.asarray(rule, dtype=a.dtype, device=device_of(a)), (-1, *[1] * offset.ndim))
        for rule in (_NODES, _WEIGHTS)
    )
    length = xp.sqrt(2 * _LOST / _precision(a, b)) + _LOST / a
    heights = xp.exp(_fall(offset - length * nodes, a, b) - _fall(offset, a, b))
    return length * (weights * heights).sum(axis=0)


def _remainder(z: Array) -> Array:
    """Return the remainder of Stirling's formula: ln gamma(z) - (z - 1/2) ln z + z - ln(2 pi) / 2,
    for z >= 1.
    """
    xp, remainder = namespace(z), 0.0 * z
    for _ in range(_SHIFTS):
        remainder = remainder + ((z + 0.5) * xp.log1p(1.0 / z) - 1.0)
        z = z + 1.0
    return remainder + _series(z)


def _series(z: Array) -> Array:
    """Return the remainder of Stirling's formula as its series, for z >= 4."""
    inverse = 1.0 / (z * z)
    series = 1 / 1680 - inverse * (1 / 1188 - inverse * 691 / 360360)
    series = 1 / 12 - inverse * (1 / 360 - inverse * (1 / 1260 - inverse * series))
    return series / z
