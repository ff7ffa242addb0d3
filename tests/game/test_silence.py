"""Ratings that are withheld: the third thing that a rater may do with what it owes."""

from typing import Any

import numpy as np
import pytest
import torch
from refusals import refuses

from roletrust_baselines import BadMouthing, OnOff, Silent
from roletrust_env import (
    Actions,
    Game,
    JointPolicy,
    Player,
    Policy,
    Random,
    make_scenario,
    make_task,
    parallel_env,
    record,
)
from roletrust_env.envs.sb3 import RoleVecEnv
from roletrust_env.game.rollout import History

PAPER = make_scenario("paper-3x3").change(max_cycles=12, perturbations=[])
PEERS = make_scenario("peers").change(max_cycles=12)


class Discreet(Policy):
    """Sends what it sends."""

    def withholds(self, view: Any, memory: Any, random: Random) -> tuple[Any, Any]:
        """Withholds nothing, and says so of every rating. See `Policy.withholds`."""
        return view.awaiting & False, memory


def played(game: Game, policies: dict[str, Policy], batch: tuple[int, ...] = ()) -> History:
    return record(JointPolicy(game, policies), game.random(0), batch)


def acted(policies: dict[str, Policy], round: int = 1) -> Actions:
    joint_policy = JointPolicy(Game(PEERS), policies)
    random = joint_policy.game.random(0)
    state, memories = (
        joint_policy.game.start(joint_policy.game.draw(random, start=True)),
        joint_policy.begin(random),
    )
    for _ in range(round):
        state, _ = joint_policy.game.step(
            state, joint_policy.act(state, memories, random)[0], joint_policy.game.draw(random)
        )
    return joint_policy.act(state, memories, random)[0]


def test_where_nobody_withholds_there_is_nothing_of_it() -> None:
    assert acted({"srsp_0": OnOff(), "srsp_1": BadMouthing()}).withheld is None


def test_a_silent_rater_withholds_its_own_row() -> None:
    """Agents with both roles are asked, too, and each row is in its place."""
    withheld = acted({"srsp_2": Silent(targets=(0, 2, 4)), "srsp_1": BadMouthing()}).withheld
    assert np.argwhere(withheld).tolist() == [[2, 0], [2, 4]]  # nobody owes itself a rating


@pytest.mark.parametrize(
    "scenario", [PAPER, PEERS.change(ratings={"lost": 0.2, "late": 0.3, "delay": 2})], ids=str
)
def test_who_withholds_nothing_plays_as_if_it_had_not_been_asked(scenario: Any) -> None:
    """To the last bit, whether or not the trust model is spared a mask that is true everywhere."""
    game = Game(scenario)
    for plain, asked in zip(
        played(game, {}), played(game, {game.roster.rater_names[0]: Discreet()}), strict=True
    ):
        assert np.array_equal(plain, asked, equal_nan=plain.dtype.kind == "f")


def test_what_is_withheld_does_not_arrive_and_all_else_does() -> None:
    game, silent = Game(PAPER), {"sr_1": Silent(start=3, stop=6, targets=(0, 2))}
    honest, history = played(game, {}), played(game, silent)
    missing = honest.rated & ~history.rated
    expected = np.zeros_like(missing)
    expected[3:6, 1, [0, 2]] = True
    assert np.array_equal(missing, expected)
    assert np.all(history.ratings[missing] == 0)
    assert np.array_equal(history.ratings[~missing], honest.ratings[~missing])


def test_what_is_late_already_arrives_all_the_same() -> None:
    late = Game(PAPER.change(ratings={"late": 1.0, "delay": 3}))
    rated = played(late, {"sr_0": Silent(start=4)}).rated[:, 0].any(axis=1)
    assert np.flatnonzero(rated).tolist() == [4, 5, 6]  # sent in rounds 1, 2 and 3


@pytest.mark.parametrize("model", ["role-trust", "mean"])
def test_a_batch_is_its_games_and_torch_agrees(model: str) -> None:
    policies = {"srsp_0": Silent(start=2), "srsp_3": Silent(targets=(0, 1))}
    one, many = (played(Game(PEERS, model), policies, batch) for batch in ((), (3,)))
    tensors = played(Game(PEERS, model, torch.zeros((), dtype=torch.float64)), policies, (3,))
    for single, whole, tensor in zip(one, many, tensors, strict=True):
        np.testing.assert_allclose(single, whole[..., 0], atol=1e-12)
        np.testing.assert_allclose(np.asarray(tensor), whole, atol=1e-9)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_compiled_with_and_without() -> None:
    """Where everybody is served the mask is left out of the compiled round, and comes back when
    somebody is silent."""
    torch.compiler.reset()
    game = Game(PAPER, like=torch.zeros((), dtype=torch.float64))
    compiled = torch.compile(game.step, fullgraph=True, backend="aot_eager")
    random = game.random(0)
    state = game.start(game.draw(random, start=True))
    withheld = torch.eye(3, dtype=torch.bool)
    for kept in (None, None, withheld, None, withheld):
        actions, noise = (
            Actions(state.quality * 0 + 0.9, state.service, withheld=kept),
            game.draw(random),
        )
        expected, quick = (step(state, actions, noise) for step in (game.step, compiled))
        for ours, theirs in zip(game.published(expected[0]), game.published(quick[0]), strict=True):
            assert torch.allclose(ours, theirs, atol=1e-12)
        assert torch.equal(expected[0].rated, quick[0].rated)
        state = expected[0]
    assert not state.rated.diagonal().any()


def test_the_scripted_agents_of_others_faces_are_silent_there() -> None:
    task = make_task(PAPER, ["sp_2"], others={"sr_0": Silent()})
    random = task.game.random(0)
    state = task.start(task.game.draw(random, start=True), random)
    for _ in range(3):
        state, _ = task.step(state, np.ones(1, np.float32), task.game.draw(random), random)
    assert state.game.rated.any(axis=1).tolist() == [False, True, True]
    env = RoleVecEnv(Game(PAPER), "sp", 1, others={"sr_0": Silent()})
    env.reset()
    for _ in range(3):
        env.step(np.ones((3, 1), np.float32))
    assert env._state.rated[..., 0].any(axis=1).tolist() == [False, True, True]


def test_an_action_has_no_such_channel_and_says_so() -> None:
    with refuses(ValueError, "sr_0", "silent"):
        Player(Silent(), "sr_0", parallel_env(PAPER).layout)
    with refuses(ValueError, "sp_0", "silent"):
        JointPolicy(Game(PAPER), {"sp_0": Silent()})


def test_a_wrong_shape_is_refused() -> None:
    game = Game(PAPER)
    random = game.random(0)
    state = game.start(game.draw(random, start=True))
    wrong = Actions(state.quality, state.ratings, withheld=np.ones(3, bool))
    with refuses(ValueError, "withheld", "(3,)", "(3, 3)"):
        game.step(state, wrong, game.draw(random))
