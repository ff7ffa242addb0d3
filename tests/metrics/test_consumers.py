"""What consumers get, worked out by hand and read off a game."""

import numpy as np
import pytest

from roletrust_baselines.provider import OnOff
from roletrust_env import Game, JointPolicy, make_scenario, record
from roletrust_env.metrics import (
    auc,
    blind_utility,
    damage,
    false_alarms,
    present_trust,
    robustness,
    skill,
    utility,
)


def test_utility_goes_by_the_trust_of_the_round_before() -> None:
    trust = np.array([[0.9, 0.1], [0.2, 0.8], [0.5, 0.5]])[:, :, None]
    quality = np.array([[0.0, 0.0], [0.4, 0.8], [0.6, 1.0]])[:, :, None]
    assert utility(trust, quality).value == pytest.approx((0.4 + 1.0) / (0.8 + 1.0))
    equal = utility(np.full_like(trust, 0.5), quality)
    assert equal.value == pytest.approx((0.6 + 0.8) / 1.8)
    assert "served well" in utility(trust, 0 * quality).why


def test_utility_is_that_of_every_consumer_where_they_are_treated_differently() -> None:
    trust = np.array([[0.9, 0.1], [0.2, 0.8], [0.5, 0.5]])[:, :, None]
    quality = np.array([[[0.0, 0.0]] * 2, [[0.4, 0.8], [1.0, 0.8]], [[0.6, 1.0], [0.2, 0.0]]])[
        ..., None
    ]
    assert utility(trust, quality).value == pytest.approx(
        (0.4 + 1.0 + 1.0 + 0.0) / (0.8 + 1.0 + 1.0 + 0.2)
    )
    alike = quality[:, :1]
    assert utility(trust, np.repeat(alike, 2, axis=1)).value == utility(trust, alike[:, 0]).value


def test_skill_is_1_for_the_best_choice_and_0_for_a_blind_one() -> None:
    by_trust, blind = np.array([0.9, 0.5, np.nan]), np.array([0.6, 0.4, 0.1])
    assert np.nanmean(skill(by_trust, blind)) == pytest.approx((1.4 - 1.0) / (2 - 1.0))
    assert np.nanmean(skill(blind, blind)) == 0
    assert np.nanmean(skill(0 * blind + 1, blind)) == pytest.approx(1)
    assert skill(blind - 0.1, blind).max() < 0
    for best in (1.0, 1 - 1e-12):  # but for rounding
        assert np.isnan(skill(np.ones(2), np.full(2, best))).all()


def test_the_interval_of_skill_is_that_of_the_quotient_of_means() -> None:
    random = np.random.default_rng(0)
    blind = random.uniform(0.4, 0.9, (2000, 40))
    by_trust = 1 - random.uniform(0, 0.1, blind.shape) * (
        1 - blind
    )  # differs little where blind differs much
    means = np.array([skill(*pair).mean() for pair in zip(by_trust, blind, strict=True)])
    errors = [skill(*pair).std(ddof=1) / 40**0.5 for pair in zip(by_trust, blind, strict=True)]
    assert np.mean(errors) == pytest.approx(means.std(), rel=0.05)


def test_robustness_is_1_where_no_liar_sells_and_below_0_where_they_sell_most() -> None:
    served = np.zeros((2, 2, 3, 1), bool)
    served[:, 0, 0] = served[0, 1, 1] = served[1, 1, 2] = True
    assert robustness(served, [0, 1], [0, 1, 2]).value == 1
    assert robustness(served, [0, 1], [0]).value == 0
    assert robustness(served, [1], [0]).value == -1
    assert "never" not in robustness(served, [0], [0]).why
    assert "ever served" in robustness(served, [], [0]).why
    assert robustness(served[:1], [0], [0]).value == 1  # of a single service


def test_metrics_take_recorded_games() -> None:
    game = Game(make_scenario("paper-3x3").change(max_cycles=40))
    attacked, twin = (
        record(JointPolicy(game, policies), game.random(0), (5,))
        for policies in ({"sp_2": OnOff()}, {})
    )
    trust = present_trust(attacked)
    assert damage(trust, present_trust(twin), [0, 1, 2, 3, 4]).value.shape == (5,)
    assert (auc(trust[-1, 3:], [2]).value == 1).all()
    assert (utility(attacked.top, attacked.offered).value > 0.9).all()
    assert robustness(attacked.served, [0, 1, 2], [0, 1]).value == pytest.approx(1 / 3)


def test_rounds_count_by_their_weights() -> None:
    random = np.random.default_rng(0)
    trust, other, offered = (random.random((6, 3, 2)) for _ in range(3))
    trust[4:, 1] = np.nan
    metrics = (
        lambda part, **weights: damage(trust[part], other[part], [0, 1], **weights),
        lambda part, **weights: false_alarms(trust[part], [0, 1], **weights),
        lambda part, **weights: utility(trust[part], offered[part], **weights),
        lambda part, **weights: blind_utility(trust[part], offered[part], **weights),
    )
    for metric in metrics:
        first, whole = (metric(slice(0, end)).value for end in (3, 6))
        assert np.all(first != whole)
        np.testing.assert_array_equal(
            metric(slice(0, 6), weights=np.array([1.0, 1, 1, 0, 0, 0])).value, first
        )
        np.testing.assert_array_equal(metric(slice(0, 6), weights=np.ones(6)).value, whole)


def test_nobody_goes_to_who_is_absent() -> None:
    trust = np.array([[np.nan, 0.0], [np.nan, 0.0]])[:, :, None]
    quality = np.array([[1.0, 0.5], [1.0, 0.5]])[:, :, None]
    assert utility(trust, quality).value == 1  # of those that there were to go to, it is the best
    assert utility(np.full_like(trust, np.nan), quality).why == "no provider ever served well"


def test_who_is_not_there_has_no_trust() -> None:
    game = Game(make_scenario("open-system").change(max_cycles=8))
    history = record(JointPolicy(game, {}), game.random(0), (3,))
    assert (np.isnan(present_trust(history)) == ~history.present).all()
    assert not history.present.all()
