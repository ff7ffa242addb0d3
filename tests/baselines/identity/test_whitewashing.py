"""Whitewashing: low trust does not last."""

from functools import partial

import numpy as np

from roletrust_baselines import OnOff, Whitewashing
from roletrust_env import Game, JointPolicy, Policy, Scenario, make_attacker, record
from roletrust_env.evaluation.scripts import Space
from roletrust_env.game.rollout import History

GAME = Game(
    Scenario(
        agents=[
            {"role": "SR", "count": 3},
            {"role": "SP", "count": 2},
            {"role": "SP", "reserve": 3},
        ],
        max_cycles=40,
    )
)
MINE = [
    GAME.roster.names.index(name) for name, owner in GAME.roster.owners.items() if owner == "sp_2"
]


def played(policy: Policy) -> History:
    return record(JointPolicy(GAME, {"sp_2": policy}), GAME.random(0))


def test_it_leaves_when_its_trust_is_low_and_comes_back_as_a_newcomer() -> None:
    history = played(Whitewashing(threshold=0.3, reserve=2))
    there, trust = history.present[:, MINE], history.trust[:, MINE]
    assert there.sum(axis=1).max() == 1
    for k in (0, 1):
        last = np.flatnonzero(there[:, k])[-1]
        assert trust[last, k] < 0.3
        assert np.all(trust[:last, k] >= 0.3)
        assert not there[last + 1].any()  # in between it is nobody
        assert there[last + 2, k + 1]
        assert trust[last + 2, k + 1] == 0.5
    assert there[-1].tolist() == [False, False, True, False]  # the last that it takes stays
    assert trust[-1, 2] < 0.3


def test_it_cheats_as_it_is_told() -> None:
    history = played(Whitewashing(reserve=3, serves=OnOff(duty=1.0, bad=0.4)))
    served = history.served.any(axis=1)[:, 2:]
    assert served.any(axis=0).all() == bool((history.quality[:, 2:] == 0.4).any(axis=0).all())
    assert np.all(history.quality[:, 2:][served] == 0.4)


def test_it_comes_back_also_when_it_is_cut_off() -> None:
    strict = Game(GAME.scenario.change(admission={"threshold": 0.45, "rounds": 2}))
    history = record(
        JointPolicy(strict, {"sp_2": Whitewashing(threshold=0.0, reserve=3)}), strict.random(0)
    )
    assert history.present[:, MINE].any(axis=0).all()


def test_it_keeps_more_trust_than_who_stays() -> None:
    def trust(policy: Policy) -> float:
        history = played(policy)
        there = history.present[:20, MINE]
        return float(history.trust[:20, MINE][there].mean())

    assert trust(Whitewashing(threshold=0.4, reserve=3)) > trust(OnOff(duty=1.0)) + 0.1


def test_by_name() -> None:
    assert make_attacker("whitewashing", threshold=0.2, reserve=4) == Whitewashing(
        threshold=0.2, reserve=4
    )


def test_it_declares_its_range() -> None:
    space = Space(partial(Whitewashing, reserve=3), (0, 1), (2,), 40)
    assert space.decode([0.7]) == Whitewashing(threshold=0.7, reserve=3)


def test_a_newcomer_comes_though_its_trust_is_low_and_leaves_at_once() -> None:
    """Who is not there yet has the initial 0.5; only who is there is tainted by it."""
    there = played(Whitewashing(threshold=0.6, reserve=3)).present[:, MINE]
    assert there[:, 1:].any(axis=0).all()
    assert there[-1].tolist() == [False, False, False, True]
