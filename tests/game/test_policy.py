"""Policies in their seats: alone in PettingZoo, in one game and in a batch, on NumPy and torch."""

from typing import Any

import numpy as np
import pytest
import torch

from agents import Honest
from baselines import BadMouthing, OnOff
from roletrust_env import Cast, Game, Player, Policy, Random, Scenario, make_scenario, parallel_env
from roletrust_env.game.rollout import play, record

SCENARIO = Scenario(
    agents=[{"role": "SR", "count": 4}, {"role": "SP", "count": 3}, {"role": "SR+SP", "count": 3}],
    ratings={"late": 0.3, "delay": 2},
    access={"kind": "choice", "providers": 3, "temperature": 0.5},
    values=(1.0, 2.0),
    max_cycles=20,
)
# Seats out of order (honest sr_1 and sr_3 sit around a liar), shared policies, an SR+SP that lies only as a rater.
POLICIES: dict[str, Policy] = {
    "sr_2": BadMouthing(level=0.2, start=3),
    "srsp_2": BadMouthing(level=0.2, start=3),
    "sr_0": BadMouthing(lie="relative", level=0.7, targets=(1, 4)),
    "sp_1": OnOff(period=3, duty=1 / 3, bad=0.1),
    "srsp_0": OnOff(period=3, duty=1 / 3, bad=0.1),
    "sp_0": Honest(best=0.6),
    "sp_2": Honest(best=0.6),
    "srsp_1": Honest(best=0.6),
}


def cast(like: Any = None) -> Cast:
    return Cast(Game(SCENARIO, like=like), POLICIES)


def luck(like: Any) -> Random:
    """The same for every dtype and array library."""
    return Random(np.random.default_rng(0), like)


def test_every_agent_plays_its_own_policy() -> None:
    history = record(cast(), Random(np.random.default_rng(0)))
    quality = dict(zip(cast().game.roster.provider_names, history.quality.T, strict=True))
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
    notes = dict(zip(cast().game.roster.rater_names, history.ratings.swapaxes(0, 1), strict=True))
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
    assert set(cast().attackers) == {"sr_2", "srsp_2", "sr_0", "sp_1", "srsp_0"}
    assert Cast(cast().game, {}).attackers == ()


@pytest.mark.parametrize("batch", [(), (4,), (2, 3)])
def test_numpy_and_torch_play_alike(batch: tuple[int, ...]) -> None:
    history = record(cast(), luck(np.zeros(())), batch)
    tensors = record(cast(torch.zeros((), dtype=torch.float64)), luck(torch.zeros((), dtype=torch.float64)), batch)
    for array, tensor in zip(history, tensors, strict=True):
        np.testing.assert_allclose(tensor.numpy(), array, rtol=0, atol=1e-12)


@pytest.mark.parametrize("like", [np.zeros((), np.float32), torch.zeros(())], ids=["numpy", "torch"])
@pytest.mark.parametrize("switching", ["regular", "random"])
def test_a_game_in_single_precision_stays_so(like: Any, switching: str) -> None:
    game = Game(SCENARIO, like=like)
    seated = Cast(game, POLICIES | {"sp_2": OnOff(bad=0.3, switching=switching)})
    *_, (state, rewards, _) = play(seated, luck(like), (2,))
    floats = [state.ratings, state.quality, state.service, state.value, rewards, *game.published(state)]
    assert {array.dtype for array in floats} == {like.dtype}


def test_in_a_batch_every_game_has_its_own_luck() -> None:
    random = Random(np.random.default_rng(0))
    history = record(Cast(Game(SCENARIO), {"sp_0": OnOff(switching="random", period=6)}), random, (50,))
    assert len({game.tobytes() for game in history.quality[:, 0].T}) > 40


def test_players_and_cast_play_the_same_game() -> None:
    """Everything but the luck is the same, so this scenario has none."""
    scenario = SCENARIO.change(access={"kind": "everyone"}, ratings={}, values=(1.0,))
    env = parallel_env(scenario)
    history = record(Cast(env.game, POLICIES), Random(np.random.default_rng(0)))
    players = {name: Player(POLICIES.get(name, Policy()), name, env.layout) for name in env.possible_agents}
    observations, _ = env.reset(seed=0)
    for t in range(20):
        actions = {name: players[name](observations[name]) for name in env.agents}
        assert all(env.action_space(name).contains(action) for name, action in actions.items())
        observations, rewards, *_, infos = env.step(actions)
        assert [infos[name]["trust"] for name in env.possible_agents] == pytest.approx(history.trust[t], abs=1e-3)
        assert [infos[j]["quality"] for j in env.game.roster.provider_names] == pytest.approx(history.quality[t])
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
    ("name", "policy", "message"),
    [
        ("sr_4", Honest(), r"'sr_4'.*sr_0.*srsp_2"),
        ("sp_0", BadMouthing(), r"'sp_0'.*bad-mouthing.*ratings.*quality"),
        ("sr_0", OnOff(), r"'sr_0'.*on-off.*quality.*ratings"),
    ],
)
def test_a_seat_that_does_not_fit_is_refused(name: str, policy: Policy, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Cast(Game(SCENARIO), {name: policy})


def test_many_names_are_not_all_listed() -> None:
    game = Game(Scenario(agents=[{"role": "SR", "count": 500}, {"role": "SP"}]))
    with pytest.raises(ValueError, match=r"'robin'.*sr_0.*\.\.\..*sp_0") as error:
        Cast(game, {"robin": Honest()})
    assert len(str(error.value)) < 200


class _Wild(Policy):
    """Rates out of range."""

    def ratings(self, view, memory, random):
        return view.service + 1.5, memory


def test_a_policy_out_of_range_is_refused() -> None:
    game = Game(make_scenario("paper-3x3"))
    with pytest.raises(ValueError, match=r"ratings that are NaN or outside \[0, 1\]"):
        record(Cast(game, {"sr_0": _Wild()}), game.random(0))


@pytest.mark.parametrize(
    ("agent", "policy", "message"),
    [
        ("sp_0", BadMouthing(), "cannot play"),
        ("zz_0", Policy(), "there is no agent 'zz_0'"),
        ("sr_0", BadMouthing, "must be a Policy"),
        ("sr_0", None, "must be a Policy"),
    ],
)
def test_who_cannot_play_gets_no_seat(agent, policy, message) -> None:
    game = Game(make_scenario("paper-3x3"))
    with pytest.raises(ValueError, match=message):
        Player(policy, agent, game.layout)
    with pytest.raises(ValueError, match=message):
        Cast(game, {agent: policy})


@pytest.mark.parametrize("batch", [1000, [3], None])
def test_a_batch_is_a_shape(batch) -> None:
    game = Game(make_scenario("paper-3x3"))
    with pytest.raises(ValueError, match="must be a shape"):
        record(Cast(game, {}), game.random(0), batch)


def test_history_says_who_is_present() -> None:
    game = Game(make_scenario("open-system"))
    history = record(Cast(game, {}), game.random(0), (4,))
    assert history.present.shape == history.trust.shape
    assert history.present[:, :6].all()
    assert not history.present[:5, 6:11].any()
    assert history.present[-1].any(axis=-1).sum() > 11
