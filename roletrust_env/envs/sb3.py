"""Stable-Baselines3 faces: an attack task, or all agents of one role, as one `VecEnv` over a batch of games."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from gymnasium.spaces import Box

from roletrust_env.envs.attack_env import task_spaces
from roletrust_env.envs.spectator import RenderMode
from roletrust_env.envs.task_batch import TaskBatch
from roletrust_env.envs.vec_env_base import Flags, Floats, Slots, Step
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.game import Game
from roletrust_env.game.joint_policy import JointPolicy
from roletrust_env.game.policy import Policy
from roletrust_env.game.state import State

Role = Literal["sr", "sp", "srsp"]


class AttackVecEnv(Slots):
    """An attack task for Stable-Baselines3: E games of it, played as one batch.

    A game that ends begins anew in the same step, as SB3 has it; `TimeLimit.truncated` is true where it ended by its
    length, so that learners bootstrap. Infos also hold `objective` and `cost` of every round. Spaces and rewards are
    those of the task's `AttackEnv`, but for the range of the actions.

    Args:
        task: the task, on NumPy; see `roletrust_env.make_task`.
        num_envs: number of games, E.
        scaled: whether actions are in [-1, 1], which learners like; else they are in [0, 1], as in `AttackEnv`.
        seed: of all luck; `seed(...)` before `reset()` sets another.
        render_mode: `"human"`, `"rgb_array"` or `"ansi"`: how the first game is shown.

    Raises:
        ValueError: the task does not play on NumPy, or there is no game.

    Example:
        >>> from roletrust_env import make_task
        >>> env = AttackVecEnv(make_task("paper-3x3", ("sp_2",), objective="exploit"), 256)
        >>> env.reset().shape
        (256, 10)
    """

    def __init__(
        self,
        task: AttackTask,
        num_envs: int,
        *,
        scaled: bool = True,
        seed: int | None = None,
        render_mode: RenderMode | None = None,
    ) -> None:
        if not isinstance(task, AttackTask):
            raise ValueError(f"task is {task!r}; it must be an attack task, such as make_task() makes")
        self.task = task
        self._batch = TaskBatch(task, (num_envs,))
        super().__init__(num_envs, task.game, *task_spaces(task), scaled=scaled, seed=seed, render_mode=render_mode)
        self._spectator.attackers = task.compromised

    def _restart(self, ended: Flags | None) -> None:
        self._batch.restart(self._random, ended)

    def _play(self, actions: Floats) -> Step:
        outcome = self._batch.step(actions.T, self._random)
        each = zip(outcome.objective.tolist(), outcome.cost.tolist(), strict=True)
        infos = [{"objective": objective, "cost": cost} for objective, cost in each]
        return Step(outcome.reward, outcome.caught, outcome.over & ~outcome.caught, infos)

    def _observe(self) -> Floats:
        return np.array(self._batch.observe().T, np.float32, order="C")

    def _follow(self) -> None:
        self._spectator.follow(self._batch.games)


class RoleVecEnv(Slots):
    """All agents of one role, each a slot: one policy with shared parameters learns to play the role.

    It is the game of `RoleTrustParallelEnv`, E times: each agent has its own observation, action and reward, those of
    the PettingZoo environment. Slot `i * E + e` is the i-th agent of the role in game e. The agents of the other roles
    play honestly or by given policies. All slots of a game end together, by its length.

    Args:
        game: on NumPy, for example `Game(make_scenario("crowd-10x10"), like=np.zeros((), np.float32))`.
        role: `"sr"`, `"sp"` or `"srsp"`: who learns.
        games: number of games, E.
        others: agent's name -> policy of agents of the other roles; those not named play honestly.
        scaled: whether actions are in [-1, 1], which learners like; else they are in [0, 1].
        seed: of all luck; `seed(...)` before `reset()` sets another.
        render_mode: `"human"`, `"rgb_array"` or `"ansi"`: how the first game is shown.

    Raises:
        ValueError: agents come and go in the scenario, nobody has the role, somebody of the role is given a policy, or
            the game does not play on NumPy.

    Example:
        >>> from roletrust_env import Game, make_scenario
        >>> env = RoleVecEnv(Game(make_scenario("paper-3x3"), like=np.zeros((), np.float32)), "sr", 64)
        >>> env.num_envs, env.reset().shape
        (192, (192, 17))
    """

    def __init__(
        self,
        game: Game,
        role: Role,
        games: int,
        *,
        others: Mapping[str, Policy] | None = None,
        scaled: bool = True,
        seed: int | None = None,
        render_mode: RenderMode | None = None,
    ) -> None:
        roster, scenario = game.roster, game.scenario
        if role not in ("sr", "sp", "srsp"):
            raise ValueError(f"role is {role!r}; it must be 'sr', 'sp' or 'srsp'")
        if game.presence.changes:
            raise ValueError(
                f"agents come and go or can be cut off in scenario {scenario.name!r}; a slot of a VecEnv is there "
                "in every step, so groups must not be open and there must be no admission control"
            )
        self.agents = tuple(name for name in roster.names if name.partition("_")[0] == role)
        if not self.agents:
            raise ValueError(f"nobody in scenario {scenario.name!r} has the role {role!r}; there are {roster.names}")
        for name in others or {}:
            if name in self.agents:
                raise ValueError(f"agent {name!r} learns; others cannot say how it plays")
        self.game, self._role, self._games = game, role, games
        self._cast = JointPolicy(game, others or {})
        self._rows = _slice(self.agents, roster.names)
        self._raters, self._providers = (
            _slice(self.agents, roster.rater_names),
            _slice(self.agents, roster.provider_names),
        )
        k = {"sr": game.layout.rater_size, "sp": game.layout.provider_size}
        seen = k[role] if role != "srsp" else 1 + k["sp"] + k["sr"]
        done = (self._providers is not None) + roster.n_providers * (self._raters is not None)
        self._state: State | None = None
        self._memories: tuple[Any, ...] = ()
        spaces = Box(0.0, 1.0, (seen,), np.float32), Box(0.0, 1.0, (done,), np.float32)
        slots = len(self.agents) * games
        super().__init__(slots, game, *spaces, scaled=scaled, seed=seed, render_mode=render_mode)

    def _restart(self, ended: Flags | None) -> None:
        # All games have the same length, so that they all end at once.
        self._state = self.game.start(self.game.draw(self._random, (self._games,), start=True))
        self._memories = self._cast.begin(self._random, (self._games,))

    def _play(self, actions: Floats) -> Step:
        if self._state is None:
            raise RuntimeError("call reset() before step(): there is no episode")
        game, n, size = self.game, len(self.agents), actions.shape[1]
        scripted, self._memories = self._cast.act(self._state, self._memories, self._random)
        own = actions.T.reshape(size, n, self._games)
        quality, ratings = np.array(scripted.quality), np.array(scripted.ratings)
        if self._providers is not None:
            quality[self._providers] = own[0]
        if self._raters is not None:
            ratings[self._raters] = own[size - game.roster.n_providers :].swapaxes(0, 1)
        noise = game.draw(self._random, (self._games,))
        self._state, rewards = game.step(self._state, scripted._replace(quality=quality, ratings=ratings), noise)
        over = np.full(self.num_envs, int(self._state.round[0]) >= game.scenario.max_cycles)
        return Step(rewards[self._rows].reshape(-1), np.zeros_like(over), over, [{} for _ in range(self.num_envs)])

    def _observe(self) -> Floats:
        if self._state is None:
            raise RuntimeError("call reset() before step(): there is no episode")
        seen = self.game.observations(self._state)[("sr", "sp", "srsp").index(self._role)]
        assert seen is not None
        return np.array(seen.reshape(seen.shape[0], -1).T, np.float32, order="C")

    def _follow(self) -> None:
        if self._state is not None:
            self._spectator.follow(self._state)


def _slice(names: Sequence[str], axis: Sequence[str]) -> slice | None:
    """Where neighbours stand on an axis; None if they do not."""
    return slice(axis.index(names[0]), axis.index(names[-1]) + 1) if names[0] in axis else None
