"""The attacker's side of batches of games, against their games one by one, on NumPy and torch, in
both precisions."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import torch
from attack_cases import (
    CASES,
    EVERY_ACCESS,
    EVERY_CASE,
    LEVELS,
    assert_close,
    busy,
    deeds,
    each,
    make,
    rng,
)

from roletrust_env import Noise, Random, make_scenario
from roletrust_env.game.attack_task import AttackTask, Stealth


class Luck:
    """Noise of the start and of every round, and what random scripted agents would draw, for a
    batch or one of it."""

    def __init__(self, task: AttackTask, seed: int, batch: tuple[int, ...]) -> None:
        random, rounds = rng(seed), range(task.game.scenario.max_cycles)
        self.start = task.game.draw(random, batch, start=True)
        self.rounds = [task.game.draw(random, batch) for _ in rounds]
        self.actions = deeds(task, seed, batch)


def trajectory(
    task: AttackTask, start: Noise, rounds: list[Noise], actions: list[Any], random: Random
) -> Iterator[tuple[Any, Any]]:
    state = task.start(start, random)
    yield task.observe(state), None
    for noise, action in zip(rounds, actions, strict=True):
        state, outcome = task.step(state, action, noise, random)
        yield task.observe(state), outcome


class Slice(Random):
    """What one game of a batch draws, while the whole batch draws from the same generator."""

    def __init__(self, seed: int, e: int, games: int) -> None:
        super().__init__(np.random.default_rng(seed))
        self.e, self.games = e, games

    def uniform(self, shape: Any) -> Any:
        return super().uniform((*shape, self.games))[..., self.e]


@EVERY_ACCESS
@pytest.mark.parametrize("name", ["colluders among other attackers", "dual"])
def test_a_batch_is_its_games_one_by_one(access: str, name: str) -> None:
    """For eight of them, with the luck of the batch; the random scripted agents' own luck
    included."""
    task = make(busy(access), CASES[name], knowledge="white_box")
    luck = Luck(task, 0, (256,))
    together = list(trajectory(task, luck.start, luck.rounds, luck.actions, rng(7)))
    few = [0, 255, *np.random.default_rng(1).choice(range(1, 255), 6, replace=False).tolist()]
    for e in few:

        def one(array: Any, e: int = e) -> Any:
            return array[..., e]

        rounds = [each(one, noise) for noise in luck.rounds]
        alone = trajectory(
            task, each(one, luck.start), rounds, [a[..., e] for a in luck.actions], Slice(7, e, 256)
        )
        for whole, single in zip(together, alone, strict=True):
            assert_close(single, each(one, whole))
    outcomes = [outcome for _, outcome in together[1:]]
    assert np.unique(outcomes[-1].caught).tolist() == ([False, True] if name == "dual" else [False])
    assert np.unique(outcomes[-1].reward).size > 125


@EVERY_CASE
def test_torch_agrees_with_numpy(case: dict) -> None:
    case = {
        **case,
        "others": {name: p for name, p in case.get("others", {}).items() if name != "sp_2"},
    }
    scenario = busy("softmax")
    for knowledge, batch in zip(LEVELS, ((2, 3), (), (4,)), strict=True):
        luck = Luck(make(scenario, case), 1, batch)
        task = make(scenario, case, knowledge=knowledge)
        tensors = make(
            scenario, case, like=torch.zeros((), dtype=torch.float64), knowledge=knowledge
        )
        rounds = [each(torch.asarray, noise) for noise in luck.rounds]
        actions = [torch.asarray(action) for action in luck.actions]
        played = trajectory(
            tensors, each(torch.asarray, luck.start), rounds, actions, rng(like=torch.zeros(()))
        )
        expected = trajectory(task, luck.start, luck.rounds, luck.actions, rng())
        for (observation, outcome), (seen, result) in zip(played, expected, strict=True):
            assert isinstance(observation, torch.Tensor)
            assert_close((observation, outcome), (seen, result))
            if outcome is not None:
                assert all(isinstance(part, torch.Tensor) for part in outcome)
                assert [part.shape for part in outcome] == [batch] * 4


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("tensors", [False, True], ids=["numpy", "torch"])
@EVERY_CASE
def test_precision_stays(case: dict, dtype: type, tensors: bool) -> None:
    def cast(array: Any) -> Any:
        array = np.asarray(array, dtype)
        return torch.asarray(array) if tensors else array

    case = {**case, "others": {}}
    luck = Luck(make(busy(), case), 1, (3,))
    task = make(busy(), case, like=cast(0.0), knowledge="white_box")
    random = rng(like=torch.zeros(()) if tensors else None)
    rounds = [each(cast, noise) for noise in luck.rounds]
    for seen, outcome in trajectory(
        task, each(cast, luck.start), rounds, [cast(a) for a in luck.actions], random
    ):
        numbers = (
            [seen] if outcome is None else [seen, outcome.reward, outcome.objective, outcome.cost]
        )
        assert {number.dtype for number in numbers} == {cast(0.0).dtype}
        if outcome is not None:
            assert str(outcome.caught.dtype) in ("bool", "torch.bool")
            assert np.all(
                (np.asarray(outcome.objective) >= 0) & (np.asarray(outcome.objective) <= 1)
            )
            assert np.all((np.asarray(outcome.cost) >= 0) & (np.asarray(outcome.cost) <= 1))


def test_gradients_reach_the_actions() -> None:
    """A planner climbs them: through the ratings and through the price of stealth."""
    scenario = make_scenario("paper-3x3").change(noise=0.0, max_cycles=3)
    like = torch.zeros((), dtype=torch.float64)
    slopes = []
    for weight in (0.0, 2.0):
        task = make(
            scenario, {"compromised": ("sr_0",), "stealth": Stealth(weight, 0.0)}, like=like
        )
        luck = Luck(make(scenario, {"compromised": ("sr_0",)}), 0, (2,))
        actions = torch.full((3, 3, 2), 0.6, dtype=torch.float64, requires_grad=True)
        rounds = [each(torch.asarray, noise) for noise in luck.rounds]
        played = trajectory(
            task, each(torch.asarray, luck.start), rounds, list(actions), rng(like=torch.zeros(()))
        )
        sum(outcome.reward.sum() for _, outcome in played if outcome is not None).backward()
        slopes.append(actions.grad)
    assert all(torch.isfinite(slope).all() for slope in slopes)
    assert torch.all(slopes[0][1:] != 0)  # nothing to rate in the first round
    assert torch.all(slopes[1][1:] > slopes[0][1:])  # nearer to the truth is cheaper
