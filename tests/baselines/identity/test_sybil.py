"""Sybil: many identities, one mind."""

import numpy as np
import pytest

from roletrust_baselines import BadMouthing, Sybil
from roletrust_env import Game, JointPolicy, Policy, Scenario, make_attacker, record
from roletrust_env.evaluation.scripts import Space
from roletrust_env.game.rollout import History

GAME = Game(
    Scenario(
        agents=[
            {"role": "SR", "count": 3},
            {"role": "SR", "reserve": 5},
            {"role": "SP", "count": 2},
        ],
        max_cycles=30,
    ),
    "mean",
)
MINE = [
    GAME.roster.names.index(name) for name, owner in GAME.roster.owners.items() if owner == "sr_3"
]


def played(policy: Policy) -> History:
    return record(JointPolicy(GAME, {"sr_3": policy}), GAME.random(0))


@pytest.mark.parametrize(
    ("attack", "arrivals"),
    [
        (Sybil(reserve=5), [0, 0, 0, 0, 0]),
        (Sybil(reserve=5, start=7), [7, 7, 7, 7, 7]),
        (Sybil(reserve=3, start=2, every=4), [2, 6, 10]),
    ],
    ids=str,
)
def test_they_come_all_at_once_or_in_a_wave(attack: Sybil, arrivals: list[int]) -> None:
    there = played(attack).present[:, MINE]
    assert there[:, 0].all()
    assert [int(there[:, k].argmax()) for k in range(1, 6) if there[:, k].any()] == arrivals
    assert np.all(there[1:] >= there[:-1])


def test_the_more_identities_the_less_a_mean_trusts_the_honest() -> None:
    def trust(policy: Policy) -> float:
        return float(played(policy).top[-1].mean())

    assert trust(BadMouthing(level=0.0)) == pytest.approx(3 / 4, abs=1e-3)
    assert trust(Sybil(reserve=1)) == pytest.approx(3 / 5, abs=1e-3)
    assert trust(Sybil(reserve=5)) == pytest.approx(3 / 9, abs=1e-3)


def test_camouflage_is_a_later_start_of_what_it_does() -> None:
    history = played(Sybil(reserve=5, rates=BadMouthing(level=0.0, start=15)))
    assert np.all(history.ratings[:15][history.rated[:15]] == 1)
    assert history.top[14].mean() > 0.99
    assert history.top[-1].mean() == pytest.approx(3 / 9, abs=1e-3)


def test_by_name() -> None:
    assert make_attacker("sybil", reserve=4, every=2) == Sybil(reserve=4, every=2)


def test_it_declares_its_ranges() -> None:
    space = Space(Sybil, (0,), (1,), 30, reserve=6)
    assert [space.decode([x] * 3) for x in (0.0, 1.0)] == [
        Sybil(),
        Sybil(reserve=6, start=100, every=10),
    ]
