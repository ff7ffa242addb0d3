"""Single games, restarted by hand: the slow reference of a batch."""

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from roletrust_env import Game, Noise, Random
from roletrust_env.game.attack_task import AttackTask

GAMES = 8


class Slice(Random):
    """What one game of a batch draws, while the whole batch draws from the same source."""

    def __init__(self, seed: int, e: int) -> None:
        super().__init__(np.random.default_rng(seed), np.zeros((), np.float32))
        self.e = e

    def uniform(self, shape: Any) -> Any:
        return super().uniform((*shape, GAMES))[..., self.e]

    def draw(self, game: Game, start: bool = False) -> Noise:
        luck = game.noise(self.round_key(), (GAMES,), start=start)
        return Noise(*(None if part is None else part[..., self.e] for part in luck))


class Loop:
    """Single games, restarted by hand as Gymnasium has it; the luck is that of the batch."""

    def __init__(self, task: AttackTask, mode: AutoresetMode, seed: int) -> None:
        self.task, self.mode = task, mode
        self.luck = [Slice(seed, e) for e in range(GAMES)]
        self.states = self.fresh()
        self.ended = [False] * GAMES

    def fresh(self) -> list[Any]:
        return [self.task.start(luck.draw(self.task.game, start=True), luck) for luck in self.luck]

    def observe(self) -> np.ndarray:
        return np.array([self.task.observe(state) for state in self.states])

    def restart(self) -> None:
        fresh = self.fresh()
        self.states = [fresh[e] if self.ended[e] else self.states[e] for e in range(GAMES)]

    def step(self, actions: np.ndarray) -> dict[str, Any]:
        rows = {
            name: np.zeros(GAMES)
            for name in ("reward", "terminated", "truncated", "objective", "cost")
        }
        waits = self.ended
        if any(waits):
            assert not all(waits)
            self.restart()
        for e, luck in enumerate(self.luck):
            after, outcome = self.task.step(
                self.states[e], actions[e], luck.draw(self.task.game), luck
            )
            if waits[e]:
                continue
            self.states[e] = after
            for name in ("reward", "objective", "cost"):
                rows[name][e] = getattr(outcome, name)
            rows["terminated"][e] = outcome.caught
            rows["truncated"][e] = (
                after.game.round >= self.task.game.scenario.max_cycles and not outcome.caught
            )
        ended = [bool(end) for end in (rows["terminated"] + rows["truncated"])]
        if self.mode is AutoresetMode.NEXT_STEP:
            self.ended = ended
        elif any(ended):
            rows["final_obs"], self.ended = self.observe(), ended
            self.restart()
            self.ended = [False] * GAMES
        return rows | {
            "observation": self.observe(),
            "ended": np.array(ended),
            "waits": np.array(waits),
        }
