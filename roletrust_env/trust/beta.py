"""The Beta distribution in array arithmetic, for models that hold an opinion as successes and failures.

Written for a and b of 1 up to a million, which is more than a game counts. With float64, masses are right to 1e-9 for a
and b up to a hundred and to 1e-8 beyond, and quantiles to 1e-8 (those of less than 1e-3 to 1e-6). With float32,
quantiles are right to 2e-6, and masses to 1e-5 for a and b up to a hundred, but only to 1e-3 at ten thousand, and worse
beyond. All run on NumPy and on torch, batched, in a fixed
number of operations.

The variable is the log odds, in which the density x^a (1 - x)^b / B(a, b) has one peak, at the mean x = a / (a + b), is
log-concave, and falls off at least exponentially. So a tail is an integral over an interval of known length, which
Gauss and Legendre's rule takes with a few dozen nodes, and no logarithm of a large gamma function has to be taken: the
height of the peak is known from Stirling's formula, of which only the small remainders are computed.
"""

import math

import numpy as np

from roletrust_env.arrays import Array, namespace

_NODES, _WEIGHTS = ((np.polynomial.legendre.leggauss(24) + np.array([[1.0], [0.0]])) / 2).tolist()
"""Gauss and Legendre's rule of 24 nodes on [0, 1]."""

_LOST = 16.0  # a density is neglected where it has fallen to exp(-16), 1e-7, of where a tail begins, which is little
_SHIFTS = 3  # of the argument of Stirling's series, so that it is at least 4
_TINY = 1e-30  # stands in for 0 in logarithms


def reputation(successes: Array, failures: Array, initial: float = 0.5) -> Array:
    """The mean of Beta(r + 2 initial, s + 2 (1 - initial)): `initial` is the base rate, worth two ratings.

    Args:
        successes: r, at least 0, of any shape.
        failures: s, at least 0, of the same shape.
        initial: the mean without evidence, in [0, 1]; 0.5 makes it Laplace's (r + 1) / (r + s + 2).
    """
    return (successes + 2 * initial) / (successes + failures + 2)


def mass_below(x: Array, a: Array, b: Array) -> Array:
    """The mass of Beta(a, b) below x: the regularised incomplete beta function I_x(a, b).

    Args:
        x: an array that broadcasts with a and b; what is outside [0, 1] counts as the nearer end.
        a: at least 1.
        b: at least 1, of the shape and dtype of a.

    Returns:
        An array in [0, 1], in the dtype of a.

    Example:
        >>> import numpy as np
        >>> mass_below(np.array([0.0, 0.25, 1.0]), np.array(2.0), np.array(1.0)).round(9)
        array([0.    , 0.0625, 1.    ])
    """
    xp = namespace(a)
    offset = xp.log(xp.clip(x, _TINY, 1.0)) - xp.log(xp.clip(1.0 - x, _TINY, 1.0)) - xp.log(a / b)
    above = offset > 0
    a, b = xp.where(above, b, a), xp.where(above, a, b)
    offset = -abs(offset)
    below = xp.exp(_log_height(a, b) + _fall(offset, a, b)) * _tail(offset, a, b)
    return xp.where(above, 1.0 - below, below)


def mass_between(low: Array, high: Array, a: Array, b: Array) -> Array:
    """The mass of Beta(a, b) between two bounds, low <= high, at least 0 whatever is rounded; see `mass_below`."""
    return namespace(a).clip(mass_below(high, a, b) - mass_below(low, a, b), 0.0, 1.0)


def quantile(q: float, a: Array, b: Array) -> Array:
    """The x below which a mass q of Beta(a, b) lies.

    Newton's method on the logarithm of the mass, which is concave, as the density is log-concave in the log odds:
    after one step it comes from below and cannot overshoot.

    Args:
        q: in [1e-6, 1 - 1e-6].
        a: at least 1.
        b: at least 1, of the shape and dtype of a.

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
    normal = (2.30753 + 0.27061 * t) / (1 + 0.99229 * t + 0.04481 * t * t) - t  # Abramowitz and Stegun 26.2.22
    offset, height = normal / xp.sqrt(_precision(a, b)), _log_height(a, b)
    for _ in range(4 if q >= 0.01 else 5):  # steps from the normal one
        tail = _tail(offset, a, b)
        offset = offset - (height + _fall(offset, a, b) + xp.log(tail) - math.log(q)) * tail
    odds = a / b * xp.exp(offset)
    return odds / (1.0 + odds)


def _precision(a: Array, b: Array) -> Array:
    """How sharply the density bends at its peak: one over the square of the width of the bell."""
    return a * b / (a + b)


def _fall(offset: Array, a: Array, b: Array) -> Array:
    """The logarithm of the density over that of its peak, at an offset of the log odds from the peak; 0 or less."""
    xp, mean = namespace(a), a / (a + b)
    return a * offset - (a + b) * xp.log(1.0 - mean + mean * xp.exp(offset))


def _log_height(a: Array, b: Array) -> Array:
    """The logarithm of the density in the log odds, at its peak."""
    xp = namespace(a)
    return 0.5 * xp.log(_precision(a, b) / (2 * math.pi)) + _remainder(a + b) - _remainder(a) - _remainder(b)


def _tail(offset: Array, a: Array, b: Array) -> Array:
    """The mass below an offset from the peak, over the density there.

    The interval is the sum of two that would do, of a bell and of an exponential tail.
    """
    xp = namespace(a)
    nodes, weights = (
        xp.reshape(xp.asarray(rule, dtype=a.dtype, device=a.device), (-1, *[1] * offset.ndim))
        for rule in (_NODES, _WEIGHTS)
    )
    length = xp.sqrt(2 * _LOST / _precision(a, b)) + _LOST / a
    heights = xp.exp(_fall(offset - length * nodes, a, b) - _fall(offset, a, b))
    return length * (weights * heights).sum(axis=0)


def _remainder(z: Array) -> Array:
    """What Stirling's formula leaves of ln gamma(z): ln gamma(z) - (z - 1/2) ln z + z - ln(2 pi) / 2, for z >= 1."""
    xp, remainder = namespace(z), 0.0 * z
    for _ in range(_SHIFTS):
        remainder = remainder + ((z + 0.5) * xp.log1p(1.0 / z) - 1.0)
        z = z + 1.0
    inverse = 1.0 / (z * z)
    series = 1 / 1680 - inverse * (1 / 1188 - inverse * 691 / 360360)
    series = 1 / 12 - inverse * (1 / 360 - inverse * (1 / 1260 - inverse * series))
    return remainder + series / z
