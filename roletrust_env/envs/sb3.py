"""Environments for Stable-Baselines3: an attack task, or all agents of one role, as a `VecEnv` over many games."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from gymnasium.spaces import Box

from roletrust_env.envs.arguments import check_number
from roletrust_env.envs.attack_env import task_spaces
from roletrust_env.envs.spectator import RenderMode
from roletrust_env.envs.task_batch import TaskBatch
from roletrust_env.envs.vec_env_base import BatchVecEnv, Flags, Floats, Step
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.game import Game
from roletrust_env.game.joint_policy import JointPolicy
from roletrust_env.game.policy import Policy
from roletrust_env.game.state import State
from roletrust_env.world.roster import PREFIXES, shown

Role = Literal["sr", "sp", "srsp"]

_ROLES = {prefix: role for role, prefix in PREFIXES.items()}


class AttackVecEnv(BatchVecEnv):
    """An attack task for Stable-Baselines3: E games of the task, played as one batch.

    Spaces and rewards are those of the task's `AttackEnv`, except for the range of the actions. A game that ends is
    restarted in the same step, as SB3 expects it. `TimeLimit.truncated` is true where the game ended by its length, so
    that learners bootstrap.

    The infos of a game hold, in every step: `objective`, the objective of the round; `cost`, its unweighted cost;
    `trust`, the trust of each compromised agent by name (ToR, ToP or ToA by its role); and `honest_trust`, the mean
    trust of the honest agents that are present, NaN without any.

    Args:
        task: Attack task on NumPy; see `roletrust_env.make_task`.
        num_envs: Number of games, E.
        scaled: Whether actions are in [-1, 1], which suits most learners; else they are in [0, 1], as in `AttackEnv`.
        seed: Random seed; `seed(...)` before `reset()` sets another.
        render_mode: `"human"`, `"rgb_array"` or `"ansi"`; only the first game is shown.

    Raises:
        ValueError: The task does not play on NumPy, or the number of games is no whole number of 1 or more.

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
        check_number("num_envs", num_envs)
        self.task = task
        self._batch = TaskBatch(task, (num_envs,))
        roster = task.game.roster
        self._compromised = [(name, roster.names.index(name)) for name in task.compromised]
        attackers = {*task.identities, *task.joint_policy.attackers}
        self._honest = [place for place, name in enumerate(roster.names) if name not in attackers]
        super().__init__(num_envs, task.game, *task_spaces(task), scaled=scaled, seed=seed, render_mode=render_mode)
        self._spectator.attackers = task.compromised

    def _restart(self, ended: Flags | None) -> None:
        self._batch.restart(self._random, ended)

    def _play(self, actions: Floats) -> Step:
        outcome = self._batch.step(actions.T, self._random)
        trust = self.task.game.agent_trust(self._batch.games)
        names = [name for name, _ in self._compromised]
        own = trust[[place for _, place in self._compromised]].T.tolist()
        rows = (outcome.objective.tolist(), outcome.cost.tolist(), own, self._honest_trust(trust).tolist())
        infos = [
            {"objective": objective, "cost": cost, "trust": dict(zip(names, row, strict=True)), "honest_trust": honest}
            for objective, cost, row, honest in zip(*rows, strict=True)
        ]
        return Step(outcome.reward, outcome.caught, outcome.over & ~outcome.caught, infos)

    def _honest_trust(self, trust: Floats) -> Floats:
        """Return the mean trust of the honest agents that are present, (E,); NaN without any."""
        present = self.task.game.present(self._batch.games)
        there = np.ones_like(trust) if present is None else present.astype(trust.dtype)
        number = there[self._honest].sum(axis=0)
        total = (trust[self._honest] * there[self._honest]).sum(axis=0)
        mean: Floats = np.where(number > 0, total / np.maximum(number, 1), np.nan)
        return mean

    def _observe(self) -> Floats:
        return np.array(self._batch.observe().T, np.float32, order="C")

    def _follow(self) -> None:
        self._spectator.follow(self._batch.games)


class RoleVecEnv(BatchVecEnv):
    """All agents of one role, each a slot: one policy with shared parameters learns to play the role.

    The game is that of `RoleTrustParallelEnv`, E times. Each agent has its own observation, action and reward, those
    of the PettingZoo environment. Slot `i * E + e` is the i-th agent of the role in game e. The agents of the other
    roles play honestly or by given policies. All slots of a game end together, by its length.

    Args:
        game: Game on NumPy, for example `Game(make_scenario("crowd-10x10"), like=np.zeros((), np.float32))`.
        role: Role of the learning agents: `"sr"`, `"sp"` or `"srsp"`.
        games: Number of games, E.
        others: Policies of agents of the other roles, by name; an agent without a policy plays honestly.
        scaled: Whether actions are in [-1, 1], which suits most learners; else they are in [0, 1].
        seed: Random seed; `seed(...)` before `reset()` sets another.
        render_mode: `"human"`, `"rgb_array"` or `"ansi"`; only the first game is shown.

    Raises:
        ValueError: Agents come and go in the scenario, no agent has the role, `others` names an agent of the role, the
            game does not play on NumPy, or the number of games is no whole number of 1 or more.

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
        check_number("games", games)
        if role not in _ROLES:
            raise ValueError(f"role is {role!r}; it must be 'sr', 'sp' or 'srsp'")
        if game.presence.changes:
            raise ValueError(
                f"agents come and go or can be cut off in scenario {scenario.name!r}; a slot of a VecEnv is there "
                "in every step, so groups must not be open and there must be no admission control"
            )
        self.agents = tuple(name for name in roster.names if roster.role(name) == _ROLES[role])
        if not self.agents:
            raise ValueError(
                f"no agent in scenario {scenario.name!r} has the role {role!r}; there are {shown(roster.names)}"
            )
        for name in others or {}:
            if name in self.agents:
                raise ValueError(f"agent {name!r} learns; remove it from others")
        self.game, self._role, self._games = game, role, games
        self._joint_policy = JointPolicy(game, others or {})
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
        self._memories = self._joint_policy.begin(self._random, (self._games,))

    def _play(self, actions: Floats) -> Step:
        if self._state is None:
            raise RuntimeError("call reset() before step(): there is no episode")
        game, n, size = self.game, len(self.agents), actions.shape[1]
        scripted, self._memories = self._joint_policy.act(self._state, self._memories, self._random)
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
    """Return the slice of an axis that neighbouring agents take; None if they are not on it."""
    return slice(axis.index(names[0]), axis.index(names[-1]) + 1) if names[0] in axis else None
