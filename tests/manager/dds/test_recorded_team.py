"""The scenario of a game is inferred from its recording."""

import numpy as np
import pytest
from recorded_games import PERIOD, spoken
from refusals import refuses

from roletrust_baselines import BadMouthing, OnOff
from roletrust_env import Scenario, make_scenario
from roletrust_manager.dds.perception_estimates import estimate_perception
from roletrust_manager.dds.recorded_team import infer_scenario, observe_team

TEAM = Scenario(
    agents=[
        {"role": "SR", "count": 2, "noise": 0.03},
        {"role": "SR", "noise": 0.01, "bias": -0.1},
        {"role": "SR", "noise": 0.02, "joins": 60},
        {"role": "SR", "noise": 0.02, "leaves": 130},
        {"role": "SP", "count": 2},
        {"role": "SP", "ability": 0.8},
        {"role": "SP", "joins": 80},
    ],
    perturbations=[{"start": 36, "stop": 40, "strength": 0.5}],
    ratings={"lost": 0.15},
    max_cycles=200,
)

PAPER = make_scenario("paper-3x3")


@pytest.fixture(scope="module")
def found():
    return [infer_scenario(observe_team(spoken(TEAM, seed)), "again") for seed in range(4)]


def within(interval, true):
    return interval.low <= true <= interval.high


def test_true_values_are_in_their_intervals(found):
    lost = [one.lost for one in found]
    assert sum(within(one, 0.15) for one in lost) >= 3
    assert max(one.high - one.low for one in lost) < 0.04
    for name, true in (
        ("noise", [0.03, 0.03, 0.01, 0.02, 0.02]),
        ("bias", [0, 0, -0.1, 0, 0]),
        ("ability", [1, 1, 0.8, 1]),
    ):
        pairs = [
            pair for one in found for pair in zip(getattr(one.perception, name), true, strict=True)
        ]
        assert np.mean([within(*pair) for pair in pairs]) >= 0.8
        assert [value.value for value, _ in pairs] == pytest.approx(
            [value for _, value in pairs], abs=0.01
        )


def test_the_scenario_has_presence_and_disturbances(found):
    for scenario in (one.scenario for one in found):
        joins = [(group.role, group.joins, group.leaves) for group in scenario.agents]
        assert [role for role, _, _ in joins] == ["SR"] * 5 + ["SP"] * 4
        np.testing.assert_allclose(
            [start for _, start, _ in joins], [0, 0, 0, 60, 0, 0, 0, 0, 80], atol=2
        )
        assert [stop for _, _, stop in joins[:4] + joins[5:]] == [None] * 8
        assert joins[4][2] == pytest.approx(130, abs=2)
        (disturbance,) = scenario.perturbations
        assert (disturbance.start, disturbance.stop) == (36, 40)
        assert disturbance.strength == pytest.approx(0.5, abs=0.03)
        assert (scenario.period_s, scenario.max_cycles) == (
            0.5,
            199,
        )  # nobody rated the last services


def test_late_ratings_count_as_lost():
    scenario = PAPER.change(ratings={"lost": 0.1}, max_cycles=120)
    found = infer_scenario(observe_team(spoken(scenario, late=0.2)), "late")
    assert within(found.lost, 0.1 + 0.9 * 0.2)
    assert found.late == pytest.approx(0.2, abs=0.05)


def test_short_attacks_do_not_change_the_estimates():
    attackers = {"sr_2": BadMouthing(start=40, stop=90), "sp_1": OnOff(start=100, stop=180)}
    found = infer_scenario(observe_team(spoken(PAPER, attackers=attackers)), "attacked")
    assert [value.value for value in found.perception.noise] == pytest.approx([0.005] * 3, rel=0.2)
    assert all(group.ability == 1 and group.bias == 0 for group in found.scenario.agents)
    assert len(found.scenario.perturbations) == 2


def test_absence_is_reported_and_is_no_loss():
    def there(one):
        round = one.time // PERIOD - 1000
        return not (one.topic == "/sr_1/ratings" and 50 <= round < 100)

    found = infer_scenario(
        observe_team(filter(there, spoken(PAPER.change(max_cycles=140)))), "away"
    )
    assert found.away == ("sr_1",)
    assert found.lost.value < 0.01
    assert found.scenario.agents[1].leaves is None


def test_clipped_ratings_of_a_rater_with_positive_bias():
    random = np.random.default_rng(0)
    bias, noise = np.array([0.0, 0.0, 0.05]), np.array([0.05, 0.1, 0.03])
    ratings = (
        np.array([1.0, 0.7]) + bias[:, None] + noise[:, None] * random.standard_normal((400, 3, 2))
    )
    seen = estimate_perception(np.clip(ratings, 0, 1), np.ones((400, 2), bool))
    assert [one.value for one in seen.noise] == pytest.approx(noise, rel=0.12)
    assert [one.value for one in seen.bias] == pytest.approx(bias, abs=0.015)
    assert [one.value for one in seen.ability] == pytest.approx([1, 0.7], abs=0.015)


def test_a_recording_without_two_rounds_is_refused():
    with refuses(ValueError, "recording"):
        observe_team([])
