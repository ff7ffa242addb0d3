"""Plain arithmetic for XLA: as exact as float32 allows, whatever the arguments."""

import numpy as np
import pytest

jax = pytest.importorskip("jax")
jnp = jax.numpy
from roletrust_env.envs.xla import games_last  # noqa: E402

pytestmark = pytest.mark.slow  # a compiler


def of_batch(function, *arguments):
    return jax.jit(jax.vmap(games_last(function)))(*arguments)


def test_sines_are_those_of_the_rounded_angle():
    angles = np.concatenate(
        [np.linspace(-10, 10, 9999), np.linspace(-5e4, 5e4, 9999), [0, 1e-20]]
    ).astype(np.float32)
    sines, cosines = of_batch(lambda angle: (jnp.sin(angle), jnp.cos(angle)), angles)
    exact, allowed = angles.astype(float), 2e-7 * (1 + abs(angles))
    assert (abs(sines - np.sin(exact)) < allowed).all()
    assert (abs(cosines - np.cos(exact)) < allowed).all()
    assert sines[-1] == np.float32(1e-20)


def test_powers_are_those_of_any_base():
    listed = [-3, -2, -0.5, 0, 0.5, 1, 2, 3, 7, 8]
    bases, exponents = (
        x.ravel().astype(np.float32) for x in np.meshgrid(np.arange(-20, 21) / 10, listed)
    )
    with np.errstate(all="ignore"):
        exact = bases.astype(float) ** exponents
    np.testing.assert_allclose(of_batch(jnp.power, bases, exponents), exact, rtol=2e-6)


def test_reductions_are_those_of_numpy_at_any_length():
    values = np.random.default_rng(0).random((5, 3, 50, 2)).astype(np.float32)
    for name in ("sum", "max", "min", "mean"):
        found = of_batch(lambda x: [getattr(x, name)(axis) for axis in (0, 1, (0, 2))], values)  # noqa: B023
        for part, axis in zip(found, (1, 2, (1, 3)), strict=True):
            np.testing.assert_allclose(part, getattr(values, name)(axis), rtol=1e-5)
    flags = of_batch(lambda x: ((x > 0.9).any(0), (x > 0.1).all(0)), values)
    np.testing.assert_array_equal(flags[0], (values > 0.9).any(1))
    np.testing.assert_array_equal(flags[1], (values > 0.1).all(1))
