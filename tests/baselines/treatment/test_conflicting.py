"""Conflicting behaviour, on cases worked by hand and in what it does to honest raters."""

import numpy as np
import pytest
from refusals import refuses

from roletrust_baselines import Conflicting, Discrimination
from roletrust_env import Game, JointPolicy, evaluate, make_scenario, record
from roletrust_env.evaluation.specs import parse_attacks
from roletrust_env.game.views import ProviderView

PAPER = make_scenario("paper-3x3").change(noise=0.0, perturbations=(), max_cycles=40)


def treated(
    attack: Conflicting | Discrimination, raters: int, round: int = 0, trust: float = 0.0
) -> list[float]:
    zero = np.zeros(raters)
    view = ProviderView(np.array(round), np.array(trust), *[np.array(0.0)] * 2, zero, zero > 0)
    treatment = attack.treats(view, None, None)[0]  # type: ignore[arg-type]
    return treatment.tolist()


def test_half_of_the_raters_or_those_that_are_named() -> None:
    assert treated(Conflicting(), 4) == [0, 0, 1, 1]
    assert treated(Conflicting(bad=0.2), 3) == [0.2, 0.2, 1]
    assert treated(Conflicting(raters=(1, 3)), 4) == [1, 0, 1, 0]
    assert (
        treated(Conflicting(start=3, stop=5), 2, round=2)
        == treated(Conflicting(start=3, stop=5), 2, 5)
        == [1, 1]
    )


def test_all_but_one_from_a_trust_on() -> None:
    attack = Conflicting(raters=(1, 2), threshold=0.8)
    assert treated(attack, 3, trust=0.79) == [1, 1, 1]
    assert treated(attack, 3, trust=0.8) == [1, 0, 0]


def test_a_few_raters() -> None:
    assert treated(Discrimination(), 10) == [0] * 3 + [1] * 7
    assert treated(Discrimination(share=0.05, bad=0.5), 4) == [0.5, 1, 1, 1]
    assert treated(Discrimination(stop=5), 2, 5) == [1, 1]


def test_a_filter_takes_the_few_for_liars() -> None:
    crowd = [
        {"role": "SR", "count": 10, "noise": 0.05},
        {"role": "SP", "count": 10, "ability": [0.3, 1.0]},
    ]
    scenario = make_scenario("crowd-10x10").change(max_cycles=50, agents=crowd)
    few, half = (
        evaluate("beta-filtered", name, scenario, games=60, share=0.3).utility
        for name in ("discrimination", "conflicting")
    )
    assert few.mean + few.half < half.mean - half.half


def test_a_named_rater_that_tells_the_truth_looks_like_a_liar() -> None:
    """By hand, in a plain mean: ToP is the mean of 0, 1 and 1, and nobody else is touched."""
    attack = parse_attacks(["sp_0=conflicting:raters=sr_1"], PAPER)
    assert attack == {"sp_0": Conflicting(raters=(1,))}
    game = Game(PAPER, "mean")
    mean = record(JointPolicy(game, attack), game.random(0))
    assert mean.top[-1] == pytest.approx([2 / 3, 1, 1])
    game = Game(PAPER)
    tor = record(JointPolicy(game, attack), game.random(0)).tor[-1]
    assert tor[1] < tor[0] - 0.05
    assert tor[0] == tor[2]


def test_a_rater_that_is_not_there_is_refused_by_name() -> None:
    with refuses(ValueError, "sp_1", "sr_0", "sr_2"):
        parse_attacks(["sp_0=conflicting:raters=[sp_1]"], PAPER)
