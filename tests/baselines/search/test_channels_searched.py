"""Attacks on channels that a task's action does not have: they are searched all the same."""

from functools import partial
from typing import Any

import numpy as np
import pytest
from refusals import refuses

from roletrust_baselines import BadMouthing, Conflicting, OnOff, Silent, Sybil, Whitewashing
from roletrust_baselines.search import CmaEs, PaperAttacks, RandomSearch
from roletrust_env import JointPolicy, record
from roletrust_env.evaluation.attackers import Both, OpenLoop, Scripted, side_by_side
from roletrust_env.evaluation.measurement import (
    SEARCHED,
    exact_task,
    judged_rollout,
    mean_rewards,
    random_sources,
)
from roletrust_env.evaluation.scripts import Scripts
from roletrust_env.evaluation.search import find
from roletrust_env.world.presence import LEFT, PRESENT

AGENTS = [{"role": "SR", "count": 4}, {"role": "SP", "count": 2}, {"role": "SP", "reserve": 3}]
SELLER: dict[str, Any] = {
    "scenario": "paper-3x3",
    "agents": AGENTS,
    "perturbations": (),
    "max_cycles": 20,
    "compromised": ("sp_2",),
    "objective": "exploit",
}
PEER = SELLER | {
    "agents": [{"role": "SR+SP", "count": 4, "noise": 0.01}, {"role": "SR+SP", "reserve": 2}],
    "compromised": ("srsp_4",),
}
RATER = SELLER | {"compromised": ("sr_3",), "objective": "damage", "noise": 0.05}
ATTACKS = {
    "seller": (
        SELLER,
        [
            {"sp_2": Whitewashing(threshold=0.4, reserve=3)},
            {"sp_2": OnOff()},
            {"sp_2": Sybil(start=4)},
        ],
    ),
    "treats": (
        SELLER,
        [{"sp_2": Conflicting()}, {"sp_2": OnOff()}, {"sp_2": Conflicting(raters=(3,), bad=0.5)}],
    ),
    "peer": (
        PEER,
        [{"srsp_4": Both(Sybil(), Silent())}, {"srsp_4": Both(OnOff(), Sybil(reserve=2, every=2))}],
    ),
    "rater": (
        RATER,
        [{"sr_3": Silent(targets=(0,))}, {"sr_3": BadMouthing()}, {"sr_3": Silent(start=5)}],
    ),
}


def nobody(rounds: int) -> None:
    """Tells nobody."""


def test_the_number_of_identities_is_a_coordinate() -> None:
    space = Scripts.of(exact_task(SELLER), (Whitewashing,))
    assert space.size == 2
    found = [space.decode([x, 0.25])["sp_2"] for x in (0.0, 0.5, 1.0)]
    assert found == [Whitewashing(reserve=reserve, threshold=0.25) for reserve in (1, 2, 3)]


def test_the_agent_with_the_fewest_identities_decides_what_fits() -> None:
    agents = [
        {"role": "SR", "count": 3},
        {"role": "SP"},
        {"role": "SP", "reserve": 3},
        {"role": "SP", "reserve": 1},
    ]
    task = exact_task(SELLER | {"agents": agents, "compromised": ("sp_1", "sp_2")})
    space = Scripts.of(task, (Whitewashing,))
    assert {policy.reserve for policy in space.decode([1.0] * space.size).values()} == {1}
    with refuses(ValueError, "2", "sp_1", "sp_2"):
        Scripts.of(task, (partial(Whitewashing, reserve=2),))


@pytest.mark.parametrize(("arguments", "attacks"), ATTACKS.values(), ids=ATTACKS)
def test_side_by_side_they_score_as_alone(arguments: Any, attacks: Any) -> None:
    task = exact_task(arguments)
    together = mean_rewards(task, Scripted(side_by_side(attacks)), 2, (len(attacks), 3), SEARCHED)[
        0
    ]
    alone = [mean_rewards(task, Scripted(attack), 2, (1, 3), SEARCHED)[0][0] for attack in attacks]
    assert together == pytest.approx(np.array(alone), abs=1e-14)
    assert len(set(together[:, 0])) == len(attacks)


@pytest.mark.parametrize(
    "policy", [Whitewashing(threshold=0.45, reserve=3), Sybil(reserve=2), Conflicting()], ids=str
)
def test_what_is_sold_is_what_a_recorded_game_tells(policy: Any) -> None:
    """The mean over those of its identities that are there of trust times what service lacks."""
    task = exact_task(SELLER)
    history = record(JointPolicy(task.game, {"sp_2": policy}), random_sources(task, 0, SEARCHED)[0])
    sold = (history.top * (1 - history.quality) * history.served.any(axis=1))[:, 2:]
    there = history.present[:, 6:]
    expected = (sold * there).sum(axis=1) / np.maximum(there.sum(axis=1), 1)
    assert mean_rewards(task, Scripted({"sp_2": policy}), 0, (1, 1), SEARCHED)[0][
        0, 0
    ] == pytest.approx(expected.mean())


@pytest.mark.parametrize(
    "method",
    [RandomSearch, pytest.param(CmaEs, marks=pytest.mark.slow)],
    ids=lambda one: one.__name__,
)
def test_searches_find_what_whitewashing_brings_and_pick_it_from_a_mixture(method: Any) -> None:
    def found(some: Any, kinds: Any) -> Any:
        return find(some(attacks=kinds), SELLER, budget=5_000, seed=0, games=2)

    default = found(PaperAttacks, (Whitewashing,))
    best = found(method, (Whitewashing,))
    assert best.description.startswith("sp_2: whitewashing:reserve=")
    assert best.scores.mean() >= default.scores.mean()
    mixed = found(method, (partial(OnOff, duty=0.0, good=1.0), Whitewashing))
    assert mixed.description.startswith("sp_2: whitewashing")


def test_who_left_is_paid_for_and_who_never_came_is_not() -> None:
    """By hand: the first identity leaves in round 3 and the second comes in round 4, served for a
    round before."""
    task = exact_task(SELLER | {"stealth": {"weight": 1.0, "tolerance": 0.0}})
    attack = Scripted({"sp_2": Whitewashing(threshold=0.45)})
    moments = list(judged_rollout(task, attack, (1, 1), *random_sources(task, 0, SEARCHED)))
    phases = np.stack([moment.round.state.population.phase[6:, 0, 0] for moment in moments])
    left = int((phases[:, 0] == LEFT).argmax())
    assert phases[left + 1].tolist() == [LEFT, PRESENT, 0, 0]
    for moment in moments:
        top = task.game.published(moment.round.state)[1][:, 0, 0]
        came = moment.round.state.population.phase[6:, 0, 0] > 0
        gap = max(top[:2].mean() - own for own, there in zip(top[2:], came, strict=True) if there)
        assert moment.outcome.cost[0, 0] == pytest.approx(max(gap, 0))
    assert not any(moment.outcome.caught.any() for moment in moments)


def test_an_action_has_no_say_over_them() -> None:
    """Those in reserve change nothing for who plays by a task's action, but that it is not all
    gone."""
    rules = SELLER | {"admission": {"threshold": 0.4, "rounds": 2}}
    task, plain = exact_task(rules), exact_task(rules | {"agents": [*AGENTS[:2], {"role": "SP"}]})
    worst = OpenLoop(np.zeros((20, 1)))
    assert task.action_size == plain.action_size == 1
    ours, theirs = (
        [
            moment.outcome
            for moment in judged_rollout(some, worst, (1, 1), *random_sources(some, 0, SEARCHED))
        ]
        for some in (task, plain)
    )
    assert [one.reward.item() for one in ours] == [one.reward.item() for one in theirs]
    assert theirs[-1].caught.all()
    assert not ours[-1].caught.any()
