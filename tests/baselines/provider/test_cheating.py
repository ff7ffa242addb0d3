"""Attacks by services, on cases worked by hand."""

import numpy as np
import pytest
from refusals import refuses

from roletrust_baselines import (
    Camouflage,
    Exit,
    Opportunistic,
    ReputationLag,
    ThresholdSurfing,
    ValueImbalance,
)
from roletrust_env import Game, JointPolicy, make_attacker, make_scenario, record
from roletrust_env.game.views import ProviderView
from roletrust_env.randomness import Random


def seen(trust=0.5, round=0.0, value=1.0, quality=0.0, ratings=(), rated=()):
    numbers = (np.array(float(x)) for x in (round, trust, value, quality))
    return ProviderView(*numbers, np.array(ratings, float), np.array(rated, bool))


def qualities(policy, *views):
    memory, found = policy.begin(Random(np.random.default_rng(0)), ()), []
    for view in views:
        quality, memory = policy.quality(view, memory, None)
        found.append(float(quality))
    return found


def test_opportunistic_is_bad_from_the_threshold_on():
    views = [seen(trust) for trust in (0.69, 0.7, 0.9)]
    assert qualities(Opportunistic(bad=0.2), *views) == [1, 0.2, 0.2]
    assert qualities(Opportunistic(threshold=0.8), *views) == [1, 1, 0]


def test_value_imbalance_cheats_on_dear_services():
    views = [seen(value=value) for value in (0.2, 0.5, 0.6, 1)]
    assert qualities(ValueImbalance(), *views) == [1, 1, 0, 0]
    assert qualities(ValueImbalance(threshold=0.1, bad=0.3), *views) == [0.3] * 4


def test_exit_cheats_in_the_last_rounds():
    views = [seen(round=round) for round in range(6)]
    assert qualities(Exit(length=6, last=2), *views) == [1, 1, 1, 1, 0, 0]
    with refuses(ValueError, "exit", "length"):
        make_attacker("exit")


def test_reputation_lag_cheats_until_it_is_told():
    policy = ReputationLag()
    trusted = [
        seen(0.9, ratings=[0, 0], rated=[False, False]),
        seen(0.9, ratings=[0.9, 0.8], rated=[True, True]),
        seen(0.9, ratings=[0, 0.8], rated=[False, True]),
        seen(0.9, ratings=[0.1, 0.8], rated=[True, True]),
        seen(0.9, ratings=[0, 0.4], rated=[True, False]),
    ]
    assert qualities(policy, *trusted) == [0, 0, 0, 1, 1]
    assert qualities(policy, seen(0.69, ratings=[1, 1], rated=[True, True])) == [1]


def test_camouflage_wakes_once_and_for_good():
    views = [seen(trust, round) for round, trust in enumerate((0.9, 0.9, 0.5, 0.85, 0.2, 0.1))]
    assert qualities(Camouflage(start=2), *views) == [1, 1, 1, 0, 0, 0]
    assert qualities(Camouflage(start=2, wakes_at=0), *views) == [1, 1, 0, 0, 0, 0]
    assert qualities(Camouflage(start=0, stop=5), *views) == [0, 0, 0, 0, 0, 1]


@pytest.mark.parametrize(
    ("view", "expected"),
    [
        # Its trust will be (0.5 + 1) / 2 = 0.75; half of that and half of q are 0.45 where q =
        # 0.15.
        (seen(trust=0.5, quality=1), 0.15),
        (seen(trust=0.5, quality=0.3), 0.5),  # 0.4 to come; 0.2 + q / 2 = 0.45
        (seen(trust=0.9, quality=0.9), 0),  # -0.
        (seen(trust=0.05, quality=0), 0.875),
        (seen(trust=0, quality=0), 0.9),
    ],
)
def test_threshold_surfing_serves_what_brings_it_to_the_mark(view, expected):
    assert qualities(ThresholdSurfing(threshold=0.4), view) == pytest.approx([expected])


@pytest.mark.parametrize("lam", [0.5, 0.7])
def test_threshold_surfing_stays_on_the_mark(lam):
    scenario = make_scenario("paper-3x3").change(
        noise=0.0, perturbations=(), max_cycles=20, lam=lam
    )
    game = Game(scenario, "mean")
    history = record(
        JointPolicy(game, {"sp_0": ThresholdSurfing(threshold=0.3, margin=0.1, lam=lam)}),
        game.random(0),
    )
    assert history.top[6:, 0] == pytest.approx(0.4)
    assert history.top[:, 0].min() > 0.3
