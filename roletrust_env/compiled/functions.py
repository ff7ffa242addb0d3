"""Mathematical functions, written with arithmetic that a processor does on many numbers at once.

Each is accurate to a few roundings, in float64 and in float32. Numbers are reduced to a short
interval around 0, where a power series converges fast. Subnormal numbers count as 0.
"""

import math
from collections.abc import Callable
from functools import reduce
from typing import Any

import numpy as np

# Parts whose multiples by small whole numbers are exact, and the rest.
_LOG_2 = 0.693145751953125, 1.4286068203094173e-06
_PI = 3.140625, 9.67502593994140625e-4, 1.5099579909783765e-07


def _series(x: Any, most: float, coefficients: list[float]) -> Any:
    """Return the value of a power series for |x| up to `most`, to the rounding of x."""
    least = np.finfo(x.dtype).eps / 4
    used = [c for k, c in enumerate(coefficients) if abs(c) * most**k > least]
    return reduce(lambda value, c: value * x + c, used[-2::-1], used[-1])


def _bits(x: Any) -> Any:
    """Return the dtype of whole numbers of the size of x."""
    return np.dtype(f"i{x.dtype.itemsize}")


def log(x: Any) -> Any:
    """Return the natural logarithm."""
    xp, facts = x.__array_namespace__(), np.finfo(x.dtype)
    bits, bias = xp.bitcast(x, _bits(x)), facts.maxexp - 1
    mantissa = (bits & ((1 << facts.nmant) - 1)) | (bias << facts.nmant)
    m = xp.bitcast(mantissa, x.dtype)
    high = m > math.sqrt(2)
    exponent = xp.astype(bits >> facts.nmant, np.int32) - bias + xp.astype(high, np.int32)
    f = xp.where(high, m * 0.5, m) - 1.0
    s = f / (2.0 + f)
    found = s * _series(s * s, 0.03, [2 / (2 * k + 1) for k in range(12)])
    found = xp.astype(exponent, x.dtype) * math.log(2) + found
    found = xp.where(x < facts.tiny, -np.inf, xp.where(x < np.inf, found, x))
    return xp.where(x < 0, np.nan, found)


def log1p(x: Any) -> Any:
    """Return the natural logarithm of 1 + x, accurate for small x."""
    xp, sum_ = x.__array_namespace__(), 1.0 + x
    lost = xp.where((sum_ > 0) & (sum_ < np.inf), ((sum_ - 1.0) - x) / sum_, 0.0)
    return xp.log(sum_) - lost


def _small_expm1(x: Any) -> Any:
    return x * _series(x, 0.4, [1 / math.factorial(k) for k in range(1, 15)])


def exp(x: Any) -> Any:
    """Return the exponential."""
    xp, facts = x.__array_namespace__(), np.finfo(x.dtype)
    low, high = math.ceil(np.log(facts.tiny)), math.floor(np.log(facts.max))
    bounded = xp.clip(x, low, high)
    power = xp.rint(bounded * (1 / math.log(2)))
    r = reduce(lambda rest, part: rest - power * part, _LOG_2, bounded)
    bits = (xp.astype(xp.astype(power, np.int32), _bits(x)) + (facts.maxexp - 1)) << facts.nmant
    found = (1.0 + _small_expm1(r)) * xp.bitcast(bits, x.dtype)
    return xp.where(x > high, np.inf, xp.where(x < low, 0.0, found))


def expm1(x: Any) -> Any:
    """Return the exponential less 1, accurate for small x."""
    xp = x.__array_namespace__()
    return xp.where(abs(x) < 0.4, _small_expm1(x), xp.exp(x) - 1.0)


def tanh(x: Any) -> Any:
    """Return the hyperbolic tangent."""
    twice = x.__array_namespace__().expm1(-2.0 * abs(x))
    return -sign(x) * twice / (2.0 + twice)


def _sine(x: Any, turn: float) -> Any:
    """Return the sine of x after a part of half a circle, for |x| below 10,000."""
    xp = x.__array_namespace__()
    turns = xp.rint(x * (1 / math.pi) + turn)
    r = reduce(lambda rest, part: rest - (turns - turn) * part, _PI, x)
    odd = turns - 2.0 * xp.floor(turns * 0.5)
    signs = [(-1) ** k / math.factorial(2 * k + 1) for k in range(12)]
    return (1.0 - 2.0 * odd) * r * _series(r * r, (math.pi / 2) ** 2, signs)


def sin(x: Any) -> Any:
    """Return the sine, for |x| below 10,000."""
    return _sine(x, 0.0)


def cos(x: Any) -> Any:
    """Return the cosine, for |x| below 10,000."""
    return _sine(x, 0.5)


def power(x: Any, y: Any) -> Any:
    """Return x to the power y; NaN for x below 0 unless y is whole."""
    xp = x.__array_namespace__()
    exponent = y.data.flat[0] if y.op == "constant" and np.ptp(y.data) == 0 else math.nan
    if exponent in range(1, 17):
        return math.prod([x] * int(exponent))
    size = xp.exp(y * xp.log(abs(x)))
    if x.op == "constant" and (x.data >= 0).all():
        return xp.where(y == 0, 1.0, size)
    half = y * 0.5
    signed = xp.where(half == xp.floor(half), size, xp.where(y == xp.floor(y), -size, math.nan))
    return xp.where(y == 0, 1.0, xp.where(x < 0, signed, size))


def floor_divide(x: Any, y: Any) -> Any:
    """Return the quotient, rounded down."""
    xp = x.__array_namespace__()
    return xp.astype(xp.floor(x / y), x.dtype)


def sign(x: Any) -> Any:
    """Return the sign, -1, 0 or 1."""
    xp = x.__array_namespace__()
    return xp.astype(x > 0, x.dtype) - xp.astype(x < 0, x.dtype)


EXPANDED: dict[str, Callable[..., Any]] = {
    **{f.__name__: f for f in (log, log1p, exp, expm1, tanh, sin, cos, power, floor_divide, sign)},
    "square": lambda x: x * x,
    "remainder": lambda x, y: x - (x // y) * y,
    "negative": lambda x: x * -1,
    "invert": lambda x: x ^ np.asarray(-1).astype(x.dtype),
    "logical_not": lambda x: x ^ True,
    "isnan": lambda x: x != x,
    "isfinite": lambda x: x - x == 0,
}
"""Functions of NumPy that are computed by others."""
