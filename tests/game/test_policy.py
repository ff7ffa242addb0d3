"""Policies in their seats: alone in PettingZoo, in one game and in a batch, on NumPy and torch."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import torch
from refusals import refuses

from roletrust_baselines import BadMouthing, OnOff
from roletrust_env import (
    Game,
    JointPolicy,
    Player,
    Policy,
    Random,
    Scenario,
    make_scenario,
    parallel_env,
)
from roletrust_env.game.rollout import record, rollout
from roletrust_env.game.views import ProviderView, RaterView


class Limited(Policy):
    """An honest provider that reaches a quality of 0.6."""

    def quality(self, view, memory, random):
        return 0 * view.trust + 0.6, memory


SCENARIO = Scenario(
    agents=[{"role": "SR", "count": 4}, {"role": "SP", "count": 3}, {"role": "SR+SP", "count": 3}],
    ratings={"late": 0.3, "delay": 2},
    access={"kind": "choice", "providers": 3, "temperature": 0.5},
    values=(1.0, 2.0),
    max_cycles=20,
)
# Seats out of order (honest sr_1 and sr_3 sit around a liar), shared policies, an SR+SP that lies
# only as a rater.
POLICIES: dict[str, Policy] = {
    "sr_2": BadMouthing(level=0.2, start=3),
    "srsp_2": BadMouthing(level=0.2, start=3),
    "sr_0": BadMouthing(lie="relative", level=0.7, targets=(1, 4)),
    "sp_1": OnOff(period=3, duty=1 / 3, bad=0.1),
    "srsp_0": OnOff(period=3, duty=1 / 3, bad=0.1),
    "sp_0": Limited(),
    "sp_2": Limited(),
    "srsp_1": Limited(),
}


def joint_policy(like: Any = None) -> JointPolicy:
    return JointPolicy(Game(SCENARIO, like=like), POLICIES)


def luck(like: Any) -> Random:
    """The same for every dtype and array library."""
    return Random(np.random.default_rng(0), like)


def test_every_agent_plays_its_own_policy() -> None:
    history = record(joint_policy(), Random(np.random.default_rng(0)))
    quality = dict(zip(joint_policy().game.roster.provider_names, history.quality.T, strict=True))
    bad = np.arange(20) % 3 == 0
    for name, expected in {
        "sp_0": 0.6,
        "sp_1": np.where(bad, 0.1, 1.0),
        "sp_2": 0.6,
        "srsp_0": np.where(bad, 0.1, 1.0),
        "srsp_1": 0.6,
        "srsp_2": 1.0,
    }.items():
        serves = quality[name] > 0
        assert serves.sum() > 5
        assert quality[name] == pytest.approx(np.where(serves, expected, 0.0))
    notes = dict(
        zip(joint_policy().game.roster.rater_names, history.ratings.swapaxes(0, 1), strict=True)
    )
    for liar in ("sr_2", "srsp_2"):
        late_notes = notes[liar][6:]  # those of round 2 and before may come as late as round 4
        assert set(late_notes[late_notes > 0]) == {0.2}
    for honest in ("sr_1", "sr_3", "srsp_0"):
        assert set(np.round(notes[honest][notes[honest] > 0], 9)) == {0.1, 0.6, 1.0}
    targeted = notes["sr_0"][:, [1, 4]]
    assert set(np.round(targeted[targeted > 0], 9)) <= {0.03, 0.3, 0.18}
    spared = notes["sr_0"][:, [0, 2, 3, 5]]
    assert set(np.round(spared[spared > 0], 9)) <= {0.1, 0.6, 1.0}


def test_the_attackers_of_a_cast() -> None:
    assert set(joint_policy().attackers) == {"sr_2", "srsp_2", "sr_0", "sp_1", "srsp_0"}
    assert JointPolicy(joint_policy().game, {}).attackers == ()


@pytest.mark.parametrize("batch", [(), (4,), (2, 3)])
def test_numpy_and_torch_play_alike(batch: tuple[int, ...]) -> None:
    history = record(joint_policy(), luck(np.zeros(())), batch)
    tensors = record(
        joint_policy(torch.zeros((), dtype=torch.float64)),
        luck(torch.zeros((), dtype=torch.float64)),
        batch,
    )
    for array, tensor in zip(history, tensors, strict=True):
        np.testing.assert_allclose(tensor.numpy(), array, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    "like", [np.zeros((), np.float32), torch.zeros(())], ids=["numpy", "torch"]
)
@pytest.mark.parametrize("switching", ["regular", "random"])
def test_a_game_in_single_precision_stays_so(like: Any, switching: str) -> None:
    game = Game(SCENARIO, like=like)
    seated = JointPolicy(game, POLICIES | {"sp_2": OnOff(bad=0.3, switching=switching)})
    *_, (_, _, state, rewards, _) = rollout(seated, luck(like), luck(like), (2,))
    floats = [
        state.ratings,
        state.quality,
        state.service,
        state.value,
        rewards,
        *game.published(state),
    ]
    assert {array.dtype for array in floats} == {like.dtype}


def test_in_a_batch_every_game_has_its_own_luck() -> None:
    random = Random(np.random.default_rng(0))
    history = record(
        JointPolicy(Game(SCENARIO), {"sp_0": OnOff(switching="random", period=6)}), random, (50,)
    )
    assert len({game.tobytes() for game in history.quality[:, 0].T}) > 40


def test_players_and_cast_play_the_same_game() -> None:
    """Everything but the luck is the same, so this scenario has none."""
    scenario = SCENARIO.change(access={"kind": "everyone"}, ratings={}, values=(1.0,))
    env = parallel_env(scenario)
    history = record(JointPolicy(env.game, POLICIES), Random(np.random.default_rng(0)))
    players = {
        name: Player(POLICIES.get(name, Policy()), name, env.layout) for name in env.possible_agents
    }
    observations, _ = env.reset(seed=0)
    for t in range(20):
        actions = {name: players[name](observations[name]) for name in env.agents}
        assert all(env.action_space(name).contains(action) for name, action in actions.items())
        observations, rewards, *_, infos = env.step(actions)
        assert [infos[name]["trust"] for name in env.possible_agents] == pytest.approx(
            history.trust[t], abs=1e-3
        )
        assert [infos[j]["quality"] for j in env.game.roster.provider_names] == pytest.approx(
            history.quality[t]
        )
        assert list(rewards.values()) == pytest.approx(history.rewards[t], abs=1e-3)


def test_a_player_with_a_seed_plays_the_same_again() -> None:
    policy, env = OnOff(switching="random", period=4), parallel_env()
    observation = env.reset(seed=0)[0]["sp_0"]

    def qualities(seed: int) -> list[float]:
        player = Player(policy, "sp_0", env.layout, seed)
        return [float(player(observation)[0]) for _ in range(50)]

    assert qualities(1) == qualities(1) != qualities(2)
    assert set(qualities(1)) == {0.0, 1.0}


@pytest.mark.parametrize(
    ("name", "policy", "words"),
    [
        ("sr_4", Policy(), ("sr_4", "sr_0", "srsp_2")),
        ("sp_0", BadMouthing(), ("sp_0", "bad-mouthing")),
        ("sr_0", OnOff(), ("sr_0", "on-off")),
    ],
)
def test_a_seat_that_does_not_fit_is_refused(
    name: str, policy: Policy, words: tuple[str, ...]
) -> None:
    with refuses(ValueError, name, *words):
        JointPolicy(Game(SCENARIO), {name: policy})


@pytest.mark.parametrize("batch", [(), (4,), (2, 3)])
def test_a_plain_policy_serves_its_best_and_reports_what_it_perceived(batch) -> None:
    service, one = np.random.default_rng(0).random((5, *batch)), np.zeros(batch)
    heard = np.zeros((3, *batch))
    provider = ProviderView(one, one + 0.2, one, one, heard, heard.astype(bool))
    rater = RaterView(one, one, service, service, service > 0.3, service, service > 0)
    quality, memory = Policy().quality(provider, None, None)
    np.testing.assert_array_equal(quality, np.ones(batch))
    ratings, _ = Policy().ratings(rater, memory, None)
    np.testing.assert_array_equal(ratings, service)
    assert not Policy().attacks


def test_many_names_are_not_all_listed() -> None:
    game = Game(Scenario(agents=[{"role": "SR", "count": 500}, {"role": "SP"}]))
    with refuses(ValueError, "robin", "sr_0", "sp_0") as error:
        JointPolicy(game, {"robin": Policy()})
    assert len(str(error.value)) < 200


class Wild(Policy):
    """Rates as it is told from round 2 on."""

    def __init__(self, what) -> None:
        self.what = what

    def ratings(self, view, memory, random):
        return self.what(view) if (view.round >= 2).all() else (view.service, memory)


def _lost(view):
    raise KeyError("lost")


@pytest.mark.parametrize("like", [np.zeros(()), torch.zeros(())], ids=["numpy", "torch"])
@pytest.mark.parametrize(
    ("what", "words"),
    [
        (
            lambda view: (view.service + 1.5, None),
            ("sr_1", "NaN", "[0, 1]"),
        ),
        (
            lambda view: (view.service * np.nan, None),
            ("sr_1", "NaN"),
        ),
        (lambda view: (view.service[:1], None), ("wild",)),
        (lambda view: view.service, ("wild",)),
        (_lost, ("KeyError", "lost")),
    ],
    ids=["out of range", "nan", "shape", "no memory", "raises"],
)
def test_a_policy_that_goes_wrong_is_named_with_the_round(what, words, like) -> None:
    game = Game(make_scenario("paper-3x3"), like=like)
    with refuses(ValueError, "2", *words):
        record(JointPolicy(game, {"sr_1": Wild(what)}), game.random(0), (4,))


class Telepath(Policy):
    attacks = "ratings"  # not a set of channels


@dataclass
class Changeable(Policy):
    level: float = 0.5


@pytest.mark.parametrize(
    ("agent", "policy", "words"),
    [
        ("sp_0", BadMouthing(), ("sp_0", "bad-mouthing")),
        ("zz_0", Policy(), ("zz_0",)),
        ("sr_0", BadMouthing, ("sr_0",)),
        ("sr_0", None, ("sr_0",)),
        ("sr_0", Telepath(), ("telepath", "ratings")),
        ("sr_0", Changeable(), ("changeable",)),
    ],
)
def test_who_cannot_play_gets_no_seat(agent, policy, words) -> None:
    game = Game(make_scenario("paper-3x3"))
    with refuses(ValueError, *words):
        Player(policy, agent, game.layout)
    with refuses(ValueError, *words):
        JointPolicy(game, {agent: policy})


@pytest.mark.parametrize("batch", [1000, [3], None])
def test_a_batch_is_a_shape(batch) -> None:
    game = Game(make_scenario("paper-3x3"))
    with refuses(ValueError, "batch"):
        record(JointPolicy(game, {}), game.random(0), batch)


def test_history_says_who_is_present() -> None:
    game = Game(make_scenario("open-system"))
    history = record(JointPolicy(game, {}), game.random(0), (4,))
    assert history.present.shape == history.trust.shape
    assert history.present[:, :6].all()
    assert not history.present[:5, 6:11].any()
    assert history.present[-1].any(axis=-1).sum() > 11
