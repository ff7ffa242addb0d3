"""Masses and quantiles of Beta distributions, against SciPy, which has them."""

import math
from collections.abc import Callable

import numpy as np
import pytest
import torch
from scipy import special

from roletrust_env.trust import beta_distribution as beta


def parameters(
    count: int = 5_000, most: int = 1_000_000
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A and b of 1 to a greatest, every tenth at its least, and x, of which more lie where the mass
    is."""
    rng = np.random.default_rng(0)
    a, b = np.exp(rng.uniform(0, math.log(most), (2, count)))
    a[::10], b[5::10], a[:50], b[:100] = 1, 1, most, most
    return a, b, np.where(rng.random(count) < 0.7, rng.beta(a, b), rng.random(count))


def test_masses_are_those_of_scipy() -> None:
    a, b, x = parameters()
    np.testing.assert_allclose(
        beta.mass_below(x, a, b), special.betainc(a, b, x), rtol=0, atol=1e-8
    )


def test_masses_of_little_evidence_are_nearer_still() -> None:
    a, b, x = parameters(most=100)
    np.testing.assert_allclose(
        beta.mass_below(x, a, b), special.betainc(a, b, x), rtol=0, atol=1e-9
    )


def test_masses_of_torch_are_those_of_scipy() -> None:
    a, b, x = parameters()
    tensors = map(torch.asarray, (x, a, b))
    np.testing.assert_allclose(
        beta.mass_below(*tensors).numpy(), special.betainc(a, b, x), rtol=0, atol=1e-8
    )


@pytest.mark.parametrize("asarray", [np.asarray, torch.asarray], ids=["numpy", "torch"])
@pytest.mark.parametrize(("most", "within"), [(100, 1e-5), (10_000, 1e-3)])
def test_single_precision_is_as_good_as_it_gets(
    asarray: Callable, most: int, within: float
) -> None:
    single = [array.astype(np.float32) for array in parameters(most=most)]
    a, b, x = (array.astype(float) for array in single)
    tensors = [asarray(array) for array in single]
    mass, found = beta.mass_below(tensors[2], *tensors[:2]), beta.quantile(0.01, *tensors[:2])
    assert mass.dtype == found.dtype == tensors[0].dtype
    np.testing.assert_allclose(np.asarray(mass), special.betainc(a, b, x), rtol=0, atol=within)
    np.testing.assert_allclose(np.asarray(found), special.betaincinv(a, b, 0.01), rtol=0, atol=2e-6)
    between = beta.between_quantiles(0.01, *tensors[:2])(tensors[2])
    assert_between(np.asarray(between), special.betainc(a, b, x), 0.01, within)


@pytest.mark.parametrize("q", [1e-6, 1e-3, 0.01, 0.2, 0.45, 0.5, 0.8, 0.99, 1 - 1e-6])
def test_quantiles_are_those_of_scipy(q: float) -> None:
    a, b, _ = parameters(2_000)
    within = 1e-8 if 1e-3 <= q <= 1 - 1e-3 else 1e-6
    np.testing.assert_allclose(
        beta.quantile(q, a, b), special.betaincinv(a, b, q), rtol=0, atol=within
    )


@pytest.mark.parametrize("asarray", [np.asarray, torch.asarray], ids=["numpy", "torch"])
@pytest.mark.parametrize("q", [1e-6, 1e-3, 0.01, 0.2, 0.36, 0.37, 0.45, 0.4999])
def test_places_between_quantiles_are_those_of_scipy(q: float, asarray: Callable) -> None:
    a, b, x = parameters()
    near = special.betaincinv(a, b, np.random.default_rng(1).choice([q, 1 - q], a.shape))
    x[::2] = (near * np.random.default_rng(2).normal(1, 0.01, a.shape))[::2]
    found = beta.between_quantiles(q, asarray(a), asarray(b))(asarray(x))
    assert_between(np.asarray(found), special.betainc(a, b, x), q, 1e-8)


def assert_between(found: np.ndarray, mass: np.ndarray, q: float, within: float) -> None:
    """See that a mass below is found to be between q and 1 - q or not; nearer to these than
    `within`, both will do."""
    clear = np.minimum(abs(mass - q), abs(1 - q - mass)) > within
    assert np.array_equal(found[clear], ((q <= mass) & (mass <= 1 - q))[clear])
    assert 0 < found[clear].sum() < clear.sum() > 0.9 * len(clear)


def test_the_bounds_that_spare_integrals_hold() -> None:
    """See that a density relative to its peak tells the mass beyond x from q where
    `between_quantiles` says so."""
    a, b, x = parameters(20_000)
    a[::3], b[1::3] = 1, np.exp(8)  # the bounds are nearest to the mass of a steep end
    below, mean = special.betainc(a, b, x), a / (a + b)
    beyond = np.where(x > mean, special.betainc(b, a, 1 - x), below)
    fall = special.xlogy(a, x / mean) + special.xlogy(b, (1 - x) / (1 - mean))
    for q in (1e-6, 1e-3, 0.01, 0.2, 0.36):
        y = -math.log(q)
        assert (beyond <= np.exp(fall) + 1e-8).all()
        assert (beyond[fall > 1 + math.log(y) - y] >= q * (1 - 1e-6)).all()


def test_the_ends_hold_nothing_and_all() -> None:
    a, b, _ = parameters(1_000)
    for x, mass in ((0.0, 0), (-0.2, 0), (1.0, 1), (1.2, 1)):
        assert np.array_equal(
            beta.mass_below(np.full(1_000, x), a, b).round(15), np.full(1_000, mass)
        )


def test_cases_by_hand() -> None:
    """Beta(2, 1) has density 2x, so mass x^2; Beta(1, 3) has density 3 (1 - x)^2, so mass 1 - (1 -
    x)^3."""
    x = np.array([0.1, 0.5, 0.9])
    assert beta.mass_below(x, np.array(2.0), np.array(1.0)) == pytest.approx(
        [0.01, 0.25, 0.81], abs=1e-9
    )
    assert beta.mass_below(x, np.array(1.0), np.array(3.0)) == pytest.approx(
        [0.271, 0.875, 0.999], abs=1e-9
    )
    assert beta.mass_between(np.array(0.1), x[1:], np.array(2.0), np.array(1.0)) == pytest.approx(
        [0.24, 0.8], abs=1e-9
    )
    assert beta.quantile(0.25, np.array(2.0), np.array(1.0)) == pytest.approx(0.5)
    found = beta.between_quantiles(0.25, np.array(2.0), np.array(1.0))(
        np.array([0.49, 0.51, 0.86, 0.87])
    )
    assert found.tolist() == [False, True, True, False]
    assert beta.reputation(3.0, 1.0) == pytest.approx(4 / 6)
    assert beta.reputation(3.0, 1.0, initial=0.2) == pytest.approx(3.4 / 6)


@pytest.mark.slow
def test_both_compile_into_one_graph() -> None:
    a, b, x = map(torch.asarray, parameters(100))
    for function, given in (
        (beta.mass_below, (x, a, b)),
        (lambda a, b: beta.quantile(0.01, a, b), (a, b)),
    ):
        compiled = torch.compile(function, fullgraph=True, backend="eager")
        assert torch.equal(compiled(*given), function(*given))


def test_the_logarithm_of_the_gamma_function_is_scipys() -> None:
    z = np.concatenate([np.linspace(1, 20, 500), np.geomspace(20, 1e6, 100)])
    np.testing.assert_allclose(beta.log_gamma(z), special.gammaln(z), rtol=1e-10, atol=1e-10)
