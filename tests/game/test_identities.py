"""Identities in reserve: who they are, who calls them, and that nobody comes back."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
import pytest
import torch
from refusals import refuses

from roletrust_baselines import BadMouthing, OnOff, Sybil, Whitewashing
from roletrust_env import (
    Actions,
    Game,
    JointPolicy,
    Player,
    Policy,
    Random,
    Scenario,
    make_task,
    parallel_env,
    record,
)
from roletrust_env.game.rollout import rollout
from roletrust_env.world.presence import LEFT, PRESENT, WAITING
from roletrust_env.world.roster import Roster

SCENARIO = Scenario(
    agents=[
        {"role": "SP", "count": 2, "reserve": 2},
        {"role": "SR", "count": 3, "noise": 0.1},
        {"role": "SP"},
        {"role": "SR", "reserve": 1},
        {"role": "SR+SP", "reserve": 2},
    ],
    max_cycles=12,
)


def joint_policy(policies: dict[str, Policy] | None = None, like: Any = None) -> JointPolicy:
    return JointPolicy(Game(SCENARIO, like=like), policies or {})


def phases(joint_policy: JointPolicy, seed: int = 0, batch: tuple[int, ...] = ()) -> np.ndarray:
    """(T, N, ...)."""
    random = joint_policy.game.random(seed)
    return np.stack(
        [np.asarray(r.state.population.phase) for r in rollout(joint_policy, random, random, batch)]
    )


def test_identities_in_reserve_are_agents_behind_the_others_of_their_role() -> None:
    roster = Roster.of(SCENARIO)
    assert roster.owner_names == ("sr_0", "sr_1", "sr_2", "sr_3", "sp_0", "sp_1", "sp_2", "srsp_0")
    reserves = {name: owner for name, owner in roster.owners.items() if name != owner}
    assert reserves == {
        **{"sr_4": "sr_3", "sp_3": "sp_0", "sp_4": "sp_0", "sp_5": "sp_1", "sp_6": "sp_1"},
        **{"srsp_1": "srsp_0", "srsp_2": "srsp_0"},
    }
    before = {
        name: roster.names[roster.previous_identity[n]] for n, name in enumerate(roster.names)
    }
    assert roster.with_reserves({"sp_1": 5, "sr_0": 6}) == {
        "sr_0": 6,
        "sp_1": 5,
        "sp_5": 5,
        "sp_6": 5,
    }
    assert before["sp_6"] == "sp_5"
    assert before["sp_5"] == "sp_1"
    assert before["sp_1"] == "sp_1"
    assert [
        roster.identity_index[roster.names.index(name)] for name in ("sp_1", "sp_5", "sp_6")
    ] == [0, 1, 2]


@pytest.mark.parametrize(
    "policies", [{}, {"sp_0": OnOff(), "sr_3": BadMouthing()}], ids=["honest", "others"]
)
def test_who_does_not_call_them_leaves_them_where_they_are(policies: dict[str, Policy]) -> None:
    seen = phases(joint_policy(policies))
    assert np.array_equal(
        seen,
        np.broadcast_to(
            np.where(np.asarray(joint_policy().game.roster.identity_index) > 0, WAITING, PRESENT),
            seen.shape,
        ),
    )


def test_an_unused_reserve_changes_nothing_for_the_others() -> None:
    """Nothing but the luck, which is drawn by place; so without luck."""
    groups = [group.model_dump() | {"noise": 0.0} for group in SCENARIO.agents]
    with_reserve = Game(SCENARIO.change(agents=groups))
    without = Game(SCENARIO.change(agents=[group | {"reserve": 0} for group in groups]))
    attack = {"sp_1": OnOff(period=3), "sr_0": BadMouthing()}
    history, plain = (
        record(JointPolicy(game, attack), game.random(0)) for game in (with_reserve, without)
    )
    firsts = [with_reserve.roster.names.index(name) for name in without.roster.names]
    np.testing.assert_allclose(history.trust[:, firsts], plain.trust, atol=1e-12)
    np.testing.assert_allclose(history.rewards[:, firsts], plain.rewards, atol=1e-12)


@dataclass(frozen=True)
class Fickle(Policy):
    """Wants each of its identities at random."""

    reserve: int = 0
    attacks: ClassVar = frozenset({"presence"})

    def presence(self, view: Any, memory: Any, random: Random) -> tuple[Any, Any]:
        """See `Policy.presence`."""
        return random.uniform(view.trust.shape) < 0.6, memory


def test_nobody_comes_back_and_only_owners_of_a_reserve_withdraw() -> None:
    fickle = joint_policy({name: Fickle() for name in ("sp_0", "srsp_0", "sr_3")})
    names, seen = fickle.game.roster.names, phases(fickle, batch=(50,))
    for before, after in pairwise(seen):
        assert np.all(after >= before)
    moving = {names[n] for n in range(len(names)) if (seen[0] != seen[-1])[n].any()}
    assert moving == {"sp_0", "sp_3", "sp_4", "srsp_0", "srsp_1", "srsp_2", "sr_3", "sr_4"}
    assert (seen[-1][names.index("sp_4")] == LEFT).any()
    history = record(fickle, fickle.game.random(0), (50,))
    waiting = seen == WAITING
    assert np.all(history.trust[waiting] == SCENARIO.initial_trust)


def test_a_newcomer_serves_from_its_first_full_round_on() -> None:
    wash = joint_policy({"sp_0": Whitewashing(threshold=0.45, reserve=2)})
    rows = list(rollout(wash, wash.game.random(0), wash.game.random(0)))
    place = wash.game.roster.provider_names.index("sp_3")
    n = wash.game.roster.names.index("sp_3")
    came = next(t for t, row in enumerate(rows) if row.state.population.phase[n] == PRESENT)
    assert not rows[came].state.awaiting[:, place].any()
    assert rows[came + 1].state.awaiting[:, place].any()


@pytest.mark.parametrize(
    "attack", [Whitewashing(threshold=0.4, reserve=2), Sybil(reserve=2, start=2, every=3)], ids=str
)
def test_a_batch_is_its_games_and_torch_agrees(attack: Policy) -> None:
    policies = {"sp_0": attack, "srsp_0": attack, "sr_2": BadMouthing()}
    one, many = (
        record(joint_policy(policies), joint_policy().game.random(0), batch) for batch in ((), (3,))
    )
    like = torch.zeros((), dtype=torch.float64)
    tensors = record(joint_policy(policies, like), joint_policy(like=like).game.random(0), (3,))
    for single, whole, tensor in zip(one, many, tensors, strict=True):
        np.testing.assert_allclose(single, whole[..., 0], atol=1e-12)
        np.testing.assert_allclose(np.asarray(tensor), whole, atol=1e-9)
    assert many.present[-1].sum() > 0


def test_an_attackers_identities_are_no_honest_providers() -> None:
    agents = [{"role": "SR", "count": 3}, {"role": "SP"}, {"role": "SP", "reserve": 3}]
    rules = {"agents": agents, "max_cycles": 10, "perturbations": []}
    task = make_task("paper-3x3", ["sr_0"], others={"sp_1": Sybil(reserve=3)}, **rules)
    assert task.joint_policy.attackers == ("sp_1", "sp_2", "sp_3", "sp_4")
    random = task.game.random(0)
    state = task.start(task.game.draw(random, start=True), random)
    for _ in range(8):
        honest, _ = task.joint_policy.act(state.game, state.memories, random)
        state, outcome = task.step(state, honest, task.game.draw(random), random)
    assert task.game.present(state.game).all()
    assert (
        float(outcome.reward) < 0.05
    )  # the one honest provider is trusted; the Sybils do not count


def test_in_pettingzoo_they_stay_away() -> None:
    env = parallel_env(SCENARIO)
    env.reset(seed=0)
    while env.agents:
        assert tuple(env.agents) == env.game.roster.owner_names
        env.step({agent: env.action_space(agent).sample() for agent in env.agents})


@pytest.mark.parametrize(
    ("policies", "words"),
    [
        ({"sp_0": Whitewashing(reserve=3)}, ["sp_0", "whitewashing", "3", "2"]),
        ({"sp_2": Whitewashing()}, ["sp_2", "whitewashing", "1", "0"]),
        ({"sp_2": Fickle()}, ["sp_2", "presence"]),
        ({"sp_4": OnOff()}, ["sp_4", "sp_0"]),
    ],
    ids=str,
)
def test_a_seat_without_the_reserve_is_refused(
    policies: dict[str, Policy], words: list[str]
) -> None:
    with refuses(ValueError, *words):
        joint_policy(policies)


def test_a_player_in_pettingzoo_has_no_reserve() -> None:
    with refuses(ValueError, "sp_0", "whitewashing"):
        Player(Whitewashing(), "sp_0", parallel_env(SCENARIO).layout)


@pytest.mark.parametrize("reserve", [-1, 1.5, True, 1001])
def test_a_reserve_is_a_number_of_identities(reserve: Any) -> None:
    with refuses(ValueError, "reserve", reserve):
        SCENARIO.change(agents=[{"role": "SR"}, {"role": "SP", "reserve": reserve}])


def test_presence_of_a_wrong_shape_is_refused() -> None:
    for scenario in (SCENARIO, SCENARIO.change(agents=[{"role": "SR"}, {"role": "SP"}])):
        game = Game(scenario)
        random = game.random(0)
        state = game.start(game.draw(random, start=True))
        wrong = Actions(state.quality, state.ratings, np.ones(3, bool))
        with refuses(ValueError, "presence", "(3,)"):
            game.step(state, wrong, game.draw(random))
