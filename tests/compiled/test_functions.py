"""Compiled functions are those of NumPy, to a few roundings."""

import numpy as np
import pytest

from roletrust_env.compiled.engine import CompiledGame, Program

POINTS = {
    "log": np.r_[0.0, 1e-300, 1e-30, np.linspace(0.1, 3, 57), 1e30, np.inf, np.nan, -1.0],
    "log1p": np.r_[-1.0, -0.5, -1e-12, 0.0, 1e-30, 1e-9, np.linspace(0.1, 3, 20), np.inf],
    "exp": np.r_[-np.inf, -800, -700, np.linspace(-3, 3, 50), 700, 800, np.inf, np.nan],
    "expm1": np.r_[-50, -1e-12, 0, 1e-30, np.linspace(-2, 2, 41)],
    "tanh": np.r_[-50, -1e-12, 0, np.linspace(-2, 2, 41), 50],
    "sin": np.r_[0, 1e-30, np.linspace(-7, 7, 101), 1000.0],
    "cos": np.r_[0, 1e-30, np.linspace(-7, 7, 101), 1000.0],
    "sqrt": np.r_[0, 0.3, 2.0],
    "sign": np.r_[-2.0, 0.0, 3.0],
    "floor": np.r_[-1.5, -1.0, 0.5],
}

KEY = np.zeros(4, np.uint32)


def played(function, *points):
    """Return a function of points, compiled."""
    example = tuple(np.asarray(x) for x in points)
    program = Program.record(
        lambda like: lambda state, *rest: (state, (function(*rest[:-2]),)),
        (np.zeros((), example[0].dtype),),
        (*example, KEY),
    )
    (found,) = CompiledGame(program).play(*example, KEY)
    return found.copy()


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("name", list(POINTS))
def test_function(name, dtype):
    points = POINTS[name].astype(dtype)
    if dtype == np.float32:
        points = points[~((abs(points) > 80) & np.isfinite(points)) | np.isin(name, ["sin", "cos"])]
        points = points[(points == 0) | (abs(points) > 1e-30)]
    with np.errstate(all="ignore"):
        expected = getattr(np, name)(points)
    found = played(getattr(np, name), points)
    scale = 1.0 if name in ("sin", "cos") else np.maximum(abs(expected), 1e-300)
    with np.errstate(all="ignore"):
        gap = abs(found - expected) / scale
    same = (found == expected) | (np.isnan(found) & np.isnan(expected))
    assert (same | (gap < 8 * np.finfo(dtype).eps)).all(), points[~same & ~(gap < 1e-6)]


@pytest.mark.parametrize("exponent", [0.5, 2.0, 6.0, 0.3, -1.5, 0.0])
def test_power(exponent):
    base = np.r_[0.0, 1e-9, np.linspace(0.1, 3, 30)]
    with np.errstate(all="ignore"):
        expected = base**exponent
    found = played(lambda x: x**exponent, base)
    assert np.allclose(found, expected, rtol=1e-14, atol=0)


def test_solve_takes_the_largest_pivot():
    rng = np.random.default_rng(0)
    matrix, given = rng.normal(size=(6, 6)), rng.normal(size=(6, 2))
    matrix[0, 0] = 0.0
    found = played(lambda a, b: a.__array_namespace__().linalg.solve(a, b), matrix, given)
    assert np.allclose(found, np.linalg.solve(matrix, given), rtol=1e-11)


def test_sort_and_argsort():
    values = np.random.default_rng(0).random((5, 4))
    assert (played(lambda x: np.sort(x, axis=0), values) == np.sort(values, axis=0)).all()
    order = played(lambda x: np.argsort(x, axis=1), values)
    assert (order == np.argsort(values, axis=1)).all()
    ranks = played(lambda x: np.argsort(np.argsort(x, axis=1), axis=1), values)
    assert (ranks == np.argsort(order, axis=1)).all()
