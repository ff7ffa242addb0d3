"""Mathematical functions, written with arithmetic that a processor does on many numbers at once.

Each is accurate to a few roundings. The coefficients of float64 and of the logarithm of float32 are
those of FDLIBM (Sun Microsystems), those of float32 those of Cephes (Moshier). Subnormal numbers
count as 0.
"""

import math
from functools import reduce
from typing import Any, NamedTuple

import numpy as np


class _Numbers(NamedTuple):
    """Constants of a precision."""

    whole: Any  # dtype of the bits
    digits: int  # number of bits of the mantissa
    bias: int  # exponent of 1
    least: float  # least normal number
    log: tuple[float, ...]
    ln2: tuple[float, float]
    exp: tuple[float, ...]
    exp_range: tuple[float, float]
    quarter: tuple[float, ...]  # a quarter of a circle in parts
    sin: tuple[float, ...]
    cos: tuple[float, ...]


_NUMBERS = {
    "d": _Numbers(
        whole=np.int64,
        digits=52,
        bias=1023,
        least=2.0**-1022,
        log=(
            6.666666666666735130e-01,
            3.999999999940941908e-01,
            2.857142874366239149e-01,
            2.222219843214978396e-01,
            1.818357216161805012e-01,
            1.531383769920937332e-01,
            1.479819860511658591e-01,
        ),
        ln2=(6.93147180369123816490e-01, 1.90821492927058770002e-10),
        exp=(
            1.66666666666666019037e-01,
            -2.77777777770155933842e-03,
            6.61375632143793436117e-05,
            -1.65339022054652515390e-06,
            4.13813679705723846039e-08,
        ),
        exp_range=(-708.0, 709.0),
        quarter=(1.57079632673412561417e00, 6.07710050650619224932e-11),
        sin=(
            -1.66666666666666324348e-01,
            8.33333333332248946124e-03,
            -1.98412698298579493134e-04,
            2.75573137070700676789e-06,
            -2.50507602534068634195e-08,
            1.58969099521155010221e-10,
        ),
        cos=(
            4.16666666666666019037e-02,
            -1.38888888888741095749e-03,
            2.48015872894767294178e-05,
            -2.75573143513906633035e-07,
            2.08757232129817482790e-09,
            -1.13596475577881948265e-11,
        ),
    ),
    "f": _Numbers(
        whole=np.int32,
        digits=23,
        bias=127,
        least=2.0**-126,
        log=(0.66666662693, 0.40000972152, 0.28498786688, 0.24279078841),
        ln2=(6.9313812256e-01, 9.0580006145e-06),
        exp=(1.6666625440e-1, -2.7667332906e-3),
        exp_range=(-87.0, 88.0),
        quarter=(1.5703125, 4.837512969970703125e-4, 7.54978995489188216e-8),
        sin=(-1.6666654611e-1, 8.3321608736e-3, -1.9515295891e-4),
        cos=(4.166664568298827e-2, -1.388731625493765e-3, 2.443315711809948e-5),
    ),
}


def _polynomial(x: Any, coefficients: tuple[float, ...]) -> Any:
    """Return the value of a polynomial, the constant coefficient first."""
    return reduce(lambda value, c: value * x + c, reversed(coefficients[:-1]), coefficients[-1])


def log(x: Any) -> Any:
    """Return the natural logarithm."""
    xp, n = x.__array_namespace__(), _NUMBERS[x.dtype.char]
    bits = xp.bitcast(x, n.whole)
    mantissa = (bits & ((1 << n.digits) - 1)) | (n.bias << n.digits)
    m = xp.bitcast(mantissa, x.dtype)
    magic = 2.0**n.digits  # the sum with it has a whole number in its lowest bits
    exponent = (bits >> n.digits) | int(np.asarray(magic, x.dtype).view(n.whole))
    high = m > math.sqrt(2)
    e = xp.bitcast(exponent, x.dtype) - (magic + n.bias) + xp.astype(high, x.dtype)
    f = xp.where(high, m * 0.5, m) - 1.0
    s = f / (2.0 + f)
    z, half = s * s, 0.5 * f * f
    rest = s * (half + z * _polynomial(z, n.log))
    found = e * n.ln2[0] - ((half - (rest + e * n.ln2[1])) - f)
    found = xp.where(x < n.least, -np.inf, xp.where(x < np.inf, found, x))
    return xp.where(x < 0, np.nan, found)


def log1p(x: Any) -> Any:
    """Return the natural logarithm of 1 + x, accurate for small x."""
    xp, sum_ = x.__array_namespace__(), 1.0 + x
    lost = xp.where((sum_ > 0) & (sum_ < np.inf), ((sum_ - 1.0) - x) / sum_, 0.0)
    return xp.log(sum_) - lost


def exp(x: Any) -> Any:
    """Return the exponential."""
    xp, n = x.__array_namespace__(), _NUMBERS[x.dtype.char]
    low, high = n.exp_range
    bounded = xp.clip(x, low, high)
    power = xp.rint(bounded * (1 / math.log(2)))
    r_high, r_low = bounded - power * n.ln2[0], power * n.ln2[1]
    r = r_high - r_low
    t = r * r
    c = r - t * _polynomial(t, n.exp)
    found = 1.0 - ((r_low - (r * c) / (2.0 - c)) - r_high)
    magic = 2.0**n.digits + n.bias
    found = found * xp.bitcast(xp.bitcast(power + magic, n.whole) << n.digits, x.dtype)
    return xp.where(x > high + 0.5, np.inf, xp.where(x < low, 0.0, found))


def expm1(x: Any) -> Any:
    """Return the exponential less 1, accurate for small x."""
    xp = x.__array_namespace__()
    series = x * _polynomial(x, tuple(1 / math.factorial(k) for k in range(1, 14)))
    return xp.where(abs(x) < 0.5, series, xp.exp(x) - 1.0)


def tanh(x: Any) -> Any:
    """Return the hyperbolic tangent."""
    xp = x.__array_namespace__()
    twice = xp.expm1(-2.0 * abs(x))
    return xp.where(x < 0, twice, -twice) / (2.0 + twice)


def _of_circle(x: Any, quarters: int) -> Any:
    """Return the sine of x after so many quarters of a circle."""
    xp, n = x.__array_namespace__(), _NUMBERS[x.dtype.char]
    turns = xp.rint(x * (2 / math.pi))
    r = reduce(lambda rest, part: rest - turns * part, n.quarter, x)
    z = r * r
    sine = r + r * z * _polynomial(z, n.sin)
    cosine = 1.0 - (0.5 * z - z * z * _polynomial(z, n.cos))
    place = xp.astype(turns, np.int32) + quarters
    found = xp.where((place & 1) != 0, cosine, sine)
    return xp.where((place & 2) != 0, -found, found)


def sin(x: Any) -> Any:
    """Return the sine, for |x| below 10,000."""
    return _of_circle(x, 0)


def cos(x: Any) -> Any:
    """Return the cosine, for |x| below 10,000."""
    return _of_circle(x, 1)


def square(x: Any) -> Any:
    """Return the square."""
    return x * x


def power(x: Any, y: Any) -> Any:
    """Return x to the power y, for x of at least 0 or a constant whole y; NaN for others."""
    xp = x.__array_namespace__()
    exponent = float(y.data.flat[0]) if y.op == "constant" and np.ptp(y.data) == 0 else math.nan
    if exponent == 0.5:
        return xp.sqrt(x)
    if 0 < exponent <= 16 and exponent == int(exponent):
        return reduce(
            lambda found, bit: found * found * x if bit == "1" else found * found,
            f"{int(exponent):b}"[1:],
            x,
        )
    raised = xp.exp(y * xp.log(x))
    raised = xp.where((x == 0) & (y < 0), np.inf, xp.where((x == 0) & (y > 0), 0.0, raised))
    return xp.where(y == 0, 1.0, raised)


def floor_divide(x: Any, y: Any) -> Any:
    """Return the whole quotient of whole numbers of at least 0, or of floats, rounded down."""
    xp = x.__array_namespace__()
    if x.dtype.kind == "f":
        return xp.floor(x / y)
    return xp.astype(xp.floor(xp.astype(x, np.float64) / xp.astype(y, np.float64)), x.dtype)


def remainder(x: Any, y: Any) -> Any:
    """Return what is left of x after whole multiples of y."""
    return x - (x // y) * y


def sign(x: Any) -> Any:
    """Return the sign, -1, 0 or 1."""
    xp = x.__array_namespace__()
    return xp.astype(x > 0, x.dtype) - xp.astype(x < 0, x.dtype)
