"""The way of ratings to the trust manager."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch

from roletrust_env.world import RatingDelivery
from roletrust_env.world.rating_delivery import deliver, start

NAMESPACES = pytest.mark.parametrize("asarray", [np.asarray, torch.asarray], ids=["numpy", "torch"])
ONE = np.ones((1, 1))
SENT = np.ones((1, 1), bool)


def arrivals(rule: RatingDelivery, lates: list[float], asarray: Callable = np.asarray) -> list[Any]:
    """Ratings 0.1, 0.2, ... are sent in turn; what arrives in each round, None if nothing does."""
    transit, found = start(rule, asarray(ONE)), []
    for t, late in enumerate(lates):
        ratings, rated, transit = deliver(
            rule, transit, asarray((t + 1) / 10 * ONE), asarray(SENT), None, asarray(late * ONE)
        )
        found.append(round(float(ratings[0, 0]), 1) if rated[0, 0] else None)
    return found


@NAMESPACES
@pytest.mark.parametrize(
    ("delay", "lates", "expected"),
    [
        (1, [9, 9, 9], [0.1, 0.2, 0.3]),
        (1, [0, 0, 0], [None, 0.1, 0.2]),
        (3, [0, 0, 0, 0, 0], [None, None, None, 0.1, 0.2]),
        (2, [0, 9, 0, 9], [None, 0.2, 0.1, 0.4]),
        (2, [0, 9, 9, 0, 0], [None, 0.2, 0.3, None, None]),  # 0.1 yields to 0.3
        (9, [0, 0], [None, None]),
    ],
)
def test_late_ratings_arrive_later_and_yield_to_newer_ones(
    asarray: Callable, delay: int, lates: list[float], expected: list[Any]
) -> None:
    assert arrivals(RatingDelivery(late=0.5, delay=delay), lates, asarray) == expected


@NAMESPACES
def test_losses_are_as_likely_as_told(asarray: Callable) -> None:
    lost, late = np.random.default_rng(0).random((2, 100, 100))
    sent = np.random.default_rng(1).random((100, 100)) < 0.5
    rule = RatingDelivery(lost=0.3, late=0.4)
    inputs = map(asarray, (lost, sent, lost, late))
    _, rated, transit = deliver(rule, start(rule, asarray(lost)), *inputs)
    rated, waiting = np.asarray(rated), np.asarray(transit.sent[0])
    assert not (rated & waiting).any()
    assert not ((rated | waiting) & ~sent).any()
    assert np.array_equal(rated | waiting, sent & (lost >= 0.3))
    assert waiting.sum() / sent.sum() == pytest.approx(0.7 * 0.4, abs=0.02)


def test_a_channel_without_faults_delivers_what_was_sent() -> None:
    ratings, sent = np.array([[0.3, 0.9]]), np.array([[True, False]])
    assert deliver(RatingDelivery(), None, ratings, sent, None, None) == (ratings, sent, None)


@pytest.mark.parametrize("probability", [0.0, 1.0])
def test_certainty(probability: float) -> None:
    """Luck lies in [0, 1), so 0 never happens and 1 always does."""
    for luck in (0.0, np.nextafter(1.0, 0.0)):
        _, rated, _ = deliver(RatingDelivery(lost=probability), None, ONE, SENT, luck * ONE, None)
        assert bool(rated) == (probability == 0)
