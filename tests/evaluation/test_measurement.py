"""Scores of games: their random numbers, and the weights of their rounds."""

import numpy as np
import pytest
from refusals import refuses

from roletrust_agents.learned.policy import play_task
from roletrust_baselines import OnOff
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.measurement import (
    HELD_OUT,
    SEARCHED,
    judged_rollout,
    mean_rewards,
    random_sources,
    score,
    watch,
)
from roletrust_env.game.make_task import make_task


def test_games_that_measure_are_none_of_those_that_search() -> None:
    task = make_task("paper-3x3", ("sr_2",))
    keys = {
        tuple(one.round_key()[0])
        for kind in (SEARCHED, HELD_OUT)
        for one in random_sources(task, 0, kind)
    }
    assert len(keys) == 4


def test_a_round_counts_by_the_probability_that_it_is_played() -> None:
    """All scores are those of the games that end after 1, 2 ... rounds, by the probabilities of
    these lengths."""
    rounds, goes_on, attacker, batch = 12, 0.8, Scripted({"sp_2": OnOff(period=4)}), (1, 3)
    whole, unknown = (
        make_task(
            "crowd-10x10",
            ("sp_2",),
            objective="mislead",
            like=np.zeros(()),
            max_cycles=rounds,
            continuation=c,
        )
        for c in (1.0, goes_on)
    )
    ends = np.array([goes_on**t * (1 - goes_on * (t < rounds - 1)) for t in range(rounds)])
    length = float(ends @ np.arange(1, rounds + 1))
    assert unknown.game.scenario.mean_length == pytest.approx(length)

    def over_lengths(of_rounds: np.ndarray) -> np.ndarray:
        return np.tensordot(ends, np.cumsum(of_rounds, axis=0), axes=1)

    outcomes = [
        o[:3]
        for _, o in judged_rollout(whole, attacker, batch, *random_sources(whole, 0, HELD_OUT))
    ]
    expected = over_lengths(np.array(outcomes)) / length
    np.testing.assert_allclose(mean_rewards(unknown, attacker, 0, batch, HELD_OUT), expected)
    assert np.all(expected[0] != mean_rewards(whole, attacker, 0, batch, HELD_OUT)[0])

    full, twin = watch(whole, attacker, 0, batch), watch(whole, Scripted({}), 0, batch)
    scores = score(unknown, attacker, 0, batch).scores
    got, best, blind = (over_lengths(np.concatenate([0 * part[:1], part])) for part in full.bought)
    np.testing.assert_allclose(scores["utility"], got / best)
    np.testing.assert_allclose(scores["blind"], blind / best)
    honest = np.array([name != "sp_2" for name in whole.game.roster.names])
    lost, low = (
        (twin.trust - full.trust)[:, honest].mean(axis=1),
        (full.trust < 0.5)[:, honest].mean(axis=1),
    )
    np.testing.assert_allclose(scores["damage"], over_lengths(lost) / length)
    np.testing.assert_allclose(scores["false_alarms"], over_lengths(low) / length)
    mean = over_lengths(full.trust)[10:]
    lower = (mean[[0, 1, *range(3, 10)]] > mean[2]) + 0.5 * (mean[[0, 1, *range(3, 10)]] == mean[2])
    np.testing.assert_allclose(scores["auc"], lower.mean(axis=0))


def test_the_score_of_a_network_has_the_weights_of_the_rounds() -> None:
    first, only = (
        make_task("paper-3x3", ("sr_2",), **kind)
        for kind in ({"continuation": 1e-9}, {"max_cycles": 1})
    )
    np.testing.assert_allclose(*(play_task(task, None, games=2, seed=0) for task in (first, only)))


def test_a_game_of_one_round_has_no_choice_to_measure() -> None:
    with refuses(ValueError, "max_cycles", "1", "2"):
        watch(make_task("market", ["sp_5"], max_cycles=1), Scripted({}), 0, (1, 2))
