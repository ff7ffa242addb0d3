"""The algebra of opinions: what subjective logic says of each operator."""

from functools import reduce

import numpy as np
import pytest

from roletrust_env.trust.models.personal.opinions import Opinion


def some_opinions(count: int) -> Opinion:
    return Opinion.of(*10 * np.random.default_rng(0).random((2, count)))


def assert_same(one: Opinion, other: Opinion) -> None:
    np.testing.assert_allclose(np.stack(one), np.stack(other), rtol=0, atol=1e-12)


def test_every_operator_gives_an_opinion() -> None:
    one, other = some_opinions(8).at(slice(4)), some_opinions(8).at(slice(4, 8))
    for made in (one, one.discounted(other), one.fused(other), one.fused_along(0)):
        np.testing.assert_allclose(sum(made), 1, rtol=0, atol=1e-12)
        assert all(np.all(part >= 0) for part in made)


def test_fusing_adds_evidence() -> None:
    assert_same(Opinion.of(3.0, 1.0).fused(Opinion.of(0.5, 2.0)), Opinion.of(3.5, 3.0))


def test_fusing_along_an_axis_is_fusing_one_after_the_other() -> None:
    many = some_opinions(6)
    assert_same(many.fused_along(0), reduce(Opinion.fused, [many.at(k) for k in range(6)]))


def test_the_vacuous_opinion_changes_nothing_and_an_unknown_adviser_makes_one() -> None:
    one, nothing = some_opinions(3), Opinion.of(0.0, 0.0)
    assert_same(one.fused(nothing), one)
    assert one.discounted(adviser=nothing) == pytest.approx((0, 0, 1))
    assert_same(one.discounted(adviser=Opinion(1.0, 0.0, 0.0)), one)


def test_certain_opinions_are_fused_to_their_mean_the_limit_of_equally_certain_ones() -> None:
    certain = Opinion(1.0, 0.0, 0.0).fused(Opinion(0.0, 1.0, 0.0))
    assert certain == (0.5, 0.5, 0.0)
    nearly = Opinion(1 - 1e-9, 0.0, 1e-9).fused(Opinion(0.0, 1 - 1e-9, 1e-9))
    assert tuple(nearly) == pytest.approx(certain, abs=1e-8)
    assert Opinion(1.0, 0.0, 0.0).fused(Opinion(0.0, 0.5, 0.5)) == (1.0, 0.0, 0.0)


def test_the_expectation_of_evidence_is_the_mean_of_its_beta_distribution() -> None:
    assert Opinion.of(3.0, 1.0).expectation(0.5) == pytest.approx(4 / 6)
    assert Opinion.of(0.0, 0.0).expectation(0.2) == 0.2
