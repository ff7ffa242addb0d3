"""A wave of fresh liars: strangers who join at once, as in the preset, or one mind under many
names."""

import pytest

from roletrust_baselines import BadMouthing, Sybil
from roletrust_env import Game, JointPolicy, make_scenario, record
from roletrust_env.evaluation.specs import parse_attacks

WAVE = make_scenario("newcomers").change(max_cycles=100, noise=0.0)


def test_the_newcomers_are_those_that_the_readme_names() -> None:
    wave = parse_attacks(["sr_1?=bad-mouthing", "sr_2?=bad-mouthing"], WAVE)
    assert list(wave) == [f"sr_{n}" for n in range(10, 25)]


def test_the_wave_outvotes_who_was_there_before() -> None:
    """In a plain mean, by hand: 1 until the wave comes, then 10 truths and 15 lies, (10 x 1 + 15 x
    0) / 25."""
    game = Game(WAVE, "mean")
    wave = dict.fromkeys([f"sr_{n}" for n in range(10, 25)], BadMouthing(level=0.0))
    history = record(JointPolicy(game, wave), game.random(0))
    assert history.present[:59].sum(axis=1).max() == 20
    assert history.top[60] == pytest.approx(1.0, abs=1e-9)
    assert history.top[-1] == pytest.approx(0.4, abs=1e-6)


def test_one_mind_under_many_names_does_the_same() -> None:
    agents = [
        {"role": "SR", "count": 10},
        {"role": "SP", "count": 10},
        {"role": "SR", "joins": 60, "reserve": 14},
    ]
    game = Game(WAVE.change(agents=agents), "mean")
    history = record(JointPolicy(game, {"sr_10": Sybil(reserve=14)}), game.random(0))
    assert history.top[-1] == pytest.approx(0.4, abs=1e-6)
