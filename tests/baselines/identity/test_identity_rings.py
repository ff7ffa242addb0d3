"""Rings under many identities."""

import numpy as np
import pytest

from roletrust_baselines import Sybil, SybilRing, Whitewashing, WhitewashingRing
from roletrust_env import Game, JointPolicy, Scenario, record
from roletrust_env.evaluation.scripts import Space
from roletrust_env.evaluation.specs import parse_attacks
from roletrust_env.testing import check_attack

SCENARIO = Scenario(
    agents=[
        {"role": "SR", "count": 3},
        {"role": "SP", "count": 2, "ability": (0.5, 1.0)},
        {"role": "SR", "reserve": 3},
        {"role": "SP", "reserve": 3, "ability": (0.5, 1.0)},
    ],
    max_cycles=30,
)
RING = ("sr_3", "sp_2")


def played(policy, model="mean", batch=()):
    game = Game(SCENARIO, model)
    return record(JointPolicy(game, dict.fromkeys(RING, policy)), game.random(0), batch)


@pytest.mark.parametrize(
    ("ring", "alike"),
    [
        (SybilRing(reserve=3, start=4, every=5), Sybil(reserve=3, start=4, every=5)),
        (
            WhitewashingRing(reserve=2, leaves_below=0.6, threshold=0.0),
            Whitewashing(reserve=2, threshold=0.6),
        ),
    ],
    ids=repr,
)
def test_its_identities_come_as_those_of_a_single_attacker(ring, alike):
    """An attacker of whitewashing with the same low trust; the wave of a Sybil does not depend on
    trust."""
    present = {policy: played(policy).present for policy in (ring, alike)}
    assert present[ring][-1].tolist() == present[alike][-1].tolist()
    if isinstance(ring, SybilRing):
        assert (present[ring] == present[alike]).all()


def test_the_identities_lie_together():
    """All raters of the ring give the same ratings where they perceive the same, and 1 to its
    providers."""
    ring = SybilRing(reserve=3, accomplices=(2, 3, 4, 5), threshold=1.0, cut=0.0)
    history = played(ring, batch=(4,))
    mine, own = history.ratings[-1, 3:], (2, 3, 4, 5)
    assert (mine[:, own] == 1).all()
    quality = history.quality[-2, :2]
    best = quality == quality.max(axis=0)
    assert mine[:, :2] == pytest.approx(
        np.broadcast_to(np.where(best, 0, quality), mine[:, :2].shape), abs=1e-9
    )


def test_many_identities_decide_and_few_do_not():
    """Under a plain mean, four liars of seven raters lift cheating providers above the honest
    ones."""

    def trust(reserve):
        top = played(
            SybilRing(reserve=reserve, accomplices=(2, 3, 4, 5), threshold=0.0, cut=1.0), batch=(8,)
        ).top[-1]
        return top[:2].mean(), top[2].mean()

    honest, cheat = trust(3)
    assert honest < 3 / 7 < 4 / 7 == pytest.approx(cheat, abs=1e-6)
    honest, cheat = trust(1)
    assert cheat == pytest.approx(2 / 5, abs=1e-6)


@pytest.mark.parametrize("ring", [SybilRing, WhitewashingRing])
def test_it_keeps_to_the_contract_of_attacks(ring):
    check_attack(ring(start=1, threshold=0.2, accomplices=(0, 3)))


@pytest.mark.parametrize("name", ["sybil-ring", "whitewashing-ring"])
def test_all_identities_that_provide_are_accomplices(name):
    attacks = parse_attacks([f"sr_3={name}:reserve=2", f"sp_2={name}"], SCENARIO)
    providers = Game(SCENARIO).roster.provider_names
    mine = tuple(k for k, agent in enumerate(providers) if agent not in ("sp_0", "sp_1"))
    assert {policy.accomplices for policy in attacks.values()} == {mine}
    assert parse_attacks([f"sr_3={name}"], SCENARIO)["sr_3"].accomplices is None


def test_searches_take_what_they_declare():
    for ring, size in ((SybilRing, 7), (WhitewashingRing, 7)):
        space = Space(ring, (0, 1), (2, 3), 30, reserve=3)
        assert space.size == size
        assert [space.decode([x] * size).reserve for x in (0.0, 1.0)] == [1, 3]
        assert space.default.accomplices == (2, 3)
