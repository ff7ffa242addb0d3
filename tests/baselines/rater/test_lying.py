"""Attacks by ratings, on cases worked by hand."""

from typing import Any

import numpy as np
import pytest
from refusals import refuses

from roletrust_baselines import (
    BallotStuffing,
    CamouflageRating,
    Complementary,
    FlipFlop,
    Optimistic,
    Pessimistic,
    RandomRating,
    RepTrap,
    TransitiveLying,
)
from roletrust_env import Policy
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.randomness import Random

SERVICE = [0.8, 0.4, 1.0]


def seen(
    service: Any = SERVICE, round: float = 0.0, trust: float = 0.5, published: Any = None
) -> RaterView:
    array = np.array(service, float)
    said = array if published is None else np.array(published, float)
    return RaterView(np.array(round), np.array(trust), said, array, array >= 0, array, array >= 0)


def ratings(policy: Policy, *views: RaterView) -> list[list[float]]:
    random, found = Random(np.random.default_rng(0)), []
    memory = policy.begin(random, ())
    for view in views:
        given, memory = policy.ratings(view, memory, random)
        found.append(given.tolist())
    return found


@pytest.mark.parametrize(
    ("policy", "expected"),
    [
        (Complementary(), [0.2, 0.6, 0]),
        (Complementary(targets=(1,)), [0.8, 0.6, 1]),
        (Pessimistic(), [0.4, 0.2, 0.5]),
        (Optimistic(), [0.9, 0.7, 1]),
        (BallotStuffing(), [1, 1, 1]),
        (BallotStuffing(level=0.25, accomplices=(1, 2)), [0.8, 0.55, 1]),
        (TransitiveLying(own=1), SERVICE),
        (TransitiveLying(own=0), [0.2, 0.6, 0]),
        (Complementary(start=1), SERVICE),
        (BallotStuffing(start=1), SERVICE),
    ],
    ids=str,
)
def test_lies(policy: Policy, expected: list[float]) -> None:
    assert ratings(policy, seen())[0] == pytest.approx(expected)


def test_flip_flop_takes_turns() -> None:
    views = [seen(round=round) for round in range(7)]
    assert [given[0] for given in ratings(FlipFlop(period=2, start=1), *views)] == [
        0.8,
        1,
        1,
        0,
        0,
        1,
        1,
    ]
    assert ratings(FlipFlop(targets=(1,)), *views[:2]) == [[0.8, 1, 1], [0.8, 0, 1]]


def test_random_ratings_are_anything() -> None:
    given = np.array(ratings(RandomRating(), seen(np.full(4000, 0.7)))[0])
    assert given.mean() == pytest.approx(0.5, abs=0.02)
    assert given.var() == pytest.approx(1 / 12, abs=0.005)


def test_a_sleeper_wakes_once_and_for_good() -> None:
    views = [
        seen(round=round, trust=trust) for round, trust in enumerate((0.9, 0.9, 0.5, 0.85, 0.2))
    ]
    lies = [given == [0.5] * 3 for given in ratings(CamouflageRating(start=2), *views)]
    assert lies == [False, False, False, True, True]
    lies = [
        given == [0] * 3
        for given in ratings(CamouflageRating(start=2, wakes_at=0, level=0), *views)
    ]
    assert lies == [False, False, True, True, True]


def test_transitive_lying_tells_the_truth_as_often_as_it_serves_well() -> None:
    policy = TransitiveLying(own=0.3)
    given = np.array(ratings(policy, seen(np.full(4000, 0.9)))[0])
    assert (given == 0.9).mean() == pytest.approx(0.3, abs=0.03)
    number = np.array(0.5)
    assert policy.quality(ProviderView(0 * number, *[number] * 5), None, None)[0] == 0.3  # type: ignore[arg-type]


def test_rep_trap_flips_the_verdict_that_is_easiest_to_flip() -> None:
    published = [0.9, 0.45, 0.65]
    assert ratings(RepTrap(), seen(published=published)) == [[0.8, 1, 1]]
    assert ratings(RepTrap(traps=2), seen(published=published)) == [[0.8, 1, 0]]
    assert ratings(RepTrap(targets=(0, 2)), seen(published=published)) == [[0.8, 0.4, 0]]
    absent = seen(published=published)._replace(awaiting=np.array([True, False, True]))
    assert ratings(RepTrap(), absent) == [[0.8, 0.45, 0]]


@pytest.mark.parametrize(
    "policy", [BallotStuffing(accomplices=(3,)), Complementary(targets=(3,))], ids=str
)
def test_a_place_that_is_not_there_is_refused(policy: Policy) -> None:
    with refuses(ValueError, "(3,)", "provider", "2"):
        ratings(policy, seen())


def test_the_opposite_of_neither_good_nor_bad_is_bad() -> None:
    assert ratings(RepTrap(traps=1), seen([0.5], published=[0.5])) == [[0]]


def test_a_sleeper_wakes_at_the_trust_it_waits_for() -> None:
    sleeper = CamouflageRating(start=0, wakes_at=0.5, level=0.25)
    assert ratings(sleeper, seen(trust=0.49), seen(trust=0.5), seen(trust=0.2)) == [
        SERVICE,
        [0.25] * 3,
        [0.25] * 3,
    ]
