"""Raters that are served differently by one provider."""

from typing import Any

import numpy as np
import pytest
import torch
from refusals import refuses

from roletrust_baselines import BadMouthing, Conflicting, OnOff, Silent
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
from roletrust_env.game.rollout import History

PAPER = make_scenario("paper-3x3").change(max_cycles=12, perturbations=[], noise=0.0)
PEERS = make_scenario("peers").change(max_cycles=12)


class Fair(Policy):
    """Serves all alike."""

    def treats(self, view: Any, memory: Any, random: Random) -> tuple[Any, Any]:
        """All of its quality for everybody, said of each. See `Policy.treats`."""
        return 0 * view.ratings + 1, memory


class Rude(Policy):
    """Serves nobody well, and not by as much as is allowed."""

    def treats(self, view: Any, memory: Any, random: Random) -> tuple[Any, Any]:
        """Less than nothing. See `Policy.treats`."""
        return 0 * view.ratings - 0.1, memory


def played(game: Game, policies: dict[str, Policy], batch: tuple[int, ...] = ()) -> History:
    return record(JointPolicy(game, policies), game.random(0), batch)


def test_where_all_are_served_alike_there_is_nothing_of_it() -> None:
    joint_policy = JointPolicy(
        Game(PEERS), {"srsp_0": OnOff(), "srsp_1": BadMouthing(), "srsp_2": Silent()}
    )
    random = joint_policy.game.random(0)
    actions, _ = joint_policy.act(
        joint_policy.game.start(joint_policy.game.draw(random, start=True)),
        joint_policy.begin(random),
        random,
    )
    assert actions.treatment is None
    history = played(joint_policy.game, dict(joint_policy.policies))
    assert np.array_equal(np.nan_to_num(history.offered), history.quality)


@pytest.mark.parametrize("scenario", ["paper-3x3", "peers", "market", "robots-that-move"])
def test_who_serves_all_alike_plays_as_if_it_had_not_been_asked(scenario: str) -> None:
    game = Game(make_scenario(scenario).change(max_cycles=20))
    fair = played(game, {game.roster.provider_names[0]: Fair()})
    for name, plain, asked in zip(History._fields, played(game, {}), fair, strict=True):
        whole = plain[:, None] if asked.ndim > plain.ndim else plain
        np.testing.assert_allclose(
            np.broadcast_to(whole, asked.shape), asked, atol=1e-12, err_msg=name
        )


def test_each_rater_gets_and_tells_of_its_own_service() -> None:
    """By hand: sp_1 gives sr_0 and sr_2 a quarter of its best from round 2 on, and sr_1 all."""
    history = played(Game(PAPER), {"sp_1": Conflicting(raters=(0, 2), bad=0.25, start=2)})
    assert history.offered.shape == (12, 3, 3)
    assert np.all(history.offered[:2] == 1)
    assert history.offered[2:].tolist() == [[[1, 0.25, 1], [1, 1, 1], [1, 0.25, 1]]] * 10
    assert np.array_equal(history.ratings[1:], history.offered[:-1])
    assert history.quality[2:] == pytest.approx(np.array([[1, 0.5, 1]] * 10))
    cost = PAPER.rewards.quality_cost
    assert history.rewards[5, 4] == pytest.approx(history.top[5, 1] - 0.5 * cost)


def test_a_provider_with_both_roles_never_serves_itself_and_lies_by_its_ratings_as_it_did() -> None:
    policies = {"srsp_0": Conflicting(raters=(1,), start=1), "srsp_3": OnOff(bad=0.5, duty=1.0)}
    history = played(Game(PEERS.change(noise=0.0)), policies)
    assert history.served[5, :, 0].sum() == 8  # all but itself
    assert history.quality[5, 0] == pytest.approx(7 / 8)
    assert history.offered[5, :3, 0].tolist() == [1, 0, 1]
    assert np.all(history.offered[5, :, 3] == 0.5)


def test_quality_is_the_mean_over_who_chose_it() -> None:
    game = Game(make_scenario("market").change(max_cycles=30, noise=0.0, ratings={}))
    history = played(game, {"sp_0": Conflicting()}, (4,))
    got = np.where(history.served, history.offered, 0).sum(axis=1)
    number = history.served.sum(axis=1)
    np.testing.assert_allclose(history.quality, got / np.maximum(number, 1), atol=1e-12)
    mine = history.offered[:, :, 0]
    assert np.all(mine[:, :10] == 0)
    assert np.all(mine[:, 10:] > 0)


@pytest.mark.parametrize(
    "scenario",
    [PAPER, PEERS, make_scenario("subjective").change(max_cycles=8)],
    ids=lambda s: s.name,
)
def test_a_batch_is_its_games_and_torch_agrees(scenario: Any) -> None:
    game = Game(scenario)
    names = game.roster.provider_names
    policies = {names[0]: Conflicting(bad=0.3), names[2]: Conflicting(raters=(0, 1), start=4)}
    one, many = (played(game, policies, batch) for batch in ((), (3,)))
    tensors = played(Game(scenario, like=torch.zeros((), dtype=torch.float64)), policies, (3,))
    for single, whole, tensor in zip(one, many, tensors, strict=True):
        np.testing.assert_allclose(single, whole[..., 0], atol=1e-12)
        np.testing.assert_allclose(np.asarray(tensor), whole, atol=1e-9)


def test_the_scripted_agents_of_a_task_treat_raters_differently_there() -> None:
    """Also where the learner sees the whole state: what is offered is no part of it."""
    task = make_task(
        PAPER, ["sr_2"], others={"sp_0": Conflicting(raters=(1,))}, knowledge="white_box"
    )
    random = task.game.random(0)
    state = task.start(task.game.draw(random, start=True), random)
    size = len(task.observe(state))
    for _ in range(2):
        state, _ = task.step(state, np.ones(3, np.float32), task.game.draw(random), random)
        assert len(task.observe(state)) == size
    assert state.game.ratings[:, 0].tolist() == [1, 0, 1]


def test_an_action_has_no_such_channel_and_says_so() -> None:
    with refuses(ValueError, "sp_0", "conflicting"):
        Player(Conflicting(), "sp_0", parallel_env(PAPER).layout)
    with refuses(ValueError, "sr_0", "conflicting"):
        JointPolicy(Game(PAPER), {"sr_0": Conflicting()})


def test_what_is_wrong_is_refused() -> None:
    game = Game(PAPER)
    with refuses(ValueError, "raters", "(3,)", "rater", "2"):
        played(game, {"sp_0": Conflicting(raters=(3,))})
    with refuses(ValueError, "0", "sp_0", "treatment"):
        played(game, {"sp_0": Rude()})
    random = game.random(0)
    state = game.start(game.draw(random, start=True))
    wrong = Actions(state.quality, state.ratings, treatment=np.ones(3))
    with refuses(ValueError, "treatment", "(3,)", "(3, 3)"):
        game.step(state, wrong, game.draw(random))
