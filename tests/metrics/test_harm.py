"""Harm, worked out by hand."""

import numpy as np
import pytest
from refusals import refuses

from roletrust_env.metrics import damage, exploitability, recovery, return_on_attack

NAN = np.nan
CALM = np.full((4, 3, 1), 0.8)
"""Four rounds, three agents, one game."""


def attacked(*rows: list[float]) -> np.ndarray:
    return np.array(rows, float)[:, :, None]


def test_damage_is_the_mean_that_was_taken_from_the_honest() -> None:
    trust = attacked([0.8, 0.8, 0.8], [0.6, 0.8, 0.0], [0.4, 0.8, 0.0], [0.6, 0.8, 0.0])
    assert damage(trust, CALM, [0, 1]).value == pytest.approx((0.2 + 0.4 + 0.2) / 8)
    assert damage(trust, CALM, [2]).value == pytest.approx(0.6)


def test_who_is_cut_off_keeps_the_trust_that_it_had() -> None:
    trust = attacked([0.8, 0.8, 0.8], [0.4, 0.8, 0.8], [NAN, 0.8, 0.8], [NAN, 0.8, 0.8])
    assert damage(trust, CALM, [0]).value == pytest.approx(3 * 0.4 / 4)


def test_damage_to_who_was_never_there_is_undefined() -> None:
    nobody = np.full_like(CALM, NAN)
    score = damage(nobody, nobody, [0])
    assert np.isnan(score.value).all()
    assert "ever present" in score.why
    assert damage(CALM, CALM, [0]).why == ""


def test_recovery_counts_rounds_from_the_end_of_the_attack() -> None:
    trust = attacked([0.8, 0.8, 0.8], [0.2, 0.4, 0.0], [0.6, 0.8, 0.0], [0.76, 0.8, 0.0])
    assert recovery(trust, CALM, [0, 1], stop=2).value == 1  # 0.1 away, then 0.02
    assert recovery(trust, CALM, [1], stop=2).value == 0
    never = recovery(trust, CALM, [2], stop=2)
    assert np.isnan(never.value).all()
    assert "did not recover" in never.why


@pytest.mark.parametrize("stop", [-1, 4])
def test_an_attack_ends_within_the_game(stop: int) -> None:
    with refuses(ValueError, "stop", "3", stop):
        recovery(CALM, CALM, [0], stop=stop)


def test_the_return_on_an_attack_that_costs_no_trust_is_undefined() -> None:
    score = return_on_attack([0.3, 0.3], [0.6, 0.0])
    assert score.value[0] == pytest.approx(0.5)
    assert np.isnan(score.value[1])
    assert "lost no trust" in score.why


def test_scores_of_other_metrics_are_taken_as_they_are() -> None:
    trust = attacked([0.8, 0.8, 0.8], [0.6, 0.8, 0.0], [0.4, 0.8, 0.0], [0.6, 0.8, 0.0])
    done, lost = damage(trust, CALM, [0]), damage(trust, CALM, [2])
    assert return_on_attack(done, lost).value == pytest.approx(0.2 / 0.6)
    assert exploitability({"a": done, "b": 0.1}) == ("a", pytest.approx(0.2))
    undefined = return_on_attack(damage(np.full_like(CALM, NAN), CALM * NAN, [0]), lost)
    assert np.isnan(undefined.value).all()
    assert "gain is undefined" in undefined.why


def test_the_worst_case_is_the_attack_with_the_highest_mean() -> None:
    found = exploitability({"a": 0.2, "b": [0.1, 0.5], "c": [NAN, 0.25]})
    assert (found.attack, found.damage) == ("b", pytest.approx(0.3))
    with refuses(ValueError, "damages"):
        exploitability({})
    with refuses(ValueError, "a"):
        exploitability({"a": NAN})


def test_trust_is_back_within_a_distance_on_either_side() -> None:
    twin = np.full((4, 1, 1), 0.5)
    for trust, rounds in (
        ([0.0, 0.25, 0.5, 0.5], 1),
        ([1.0, 0.75, 0.5, 0.5], 1),
        ([1.0, 1.0, 1.0, 0.5], 3),
    ):
        assert (
            recovery(np.array(trust)[:, None, None], twin, [0], stop=0, within=0.25).value == rounds
        )
