"""Environments for Stable-Baselines3: a `VecEnv` that is one batch."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from copy import deepcopy
from time import perf_counter
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices

from roletrust_env.envs.actions import check_action
from roletrust_env.envs.arguments import Engine, check_games
from roletrust_env.envs.spectator import RENDERING, RenderMode, Spectator
from roletrust_env.envs.task_batch import TaskBatch, choose, task_spaces
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.brief import game_facts
from roletrust_env.game.game import Game
from roletrust_env.game.joint_policy import JointPolicy
from roletrust_env.game.policy import Policy
from roletrust_env.game.state import State
from roletrust_env.parameters import truth_value, whole_number
from roletrust_env.randomness import Random, generator
from roletrust_env.world.roster import PREFIXES, shown

Floats = npt.NDArray[np.float32]
Flags = npt.NDArray[np.bool_]


class Step(NamedTuple):
    """The outcome of a round for each slot."""

    rewards: Floats
    terminated: Flags
    truncated: Flags
    infos: list[dict[str, Any]]


class BatchVecEnv(VecEnv):
    """The part of `VecEnv` that is the same for a slot that is a game and for a slot that is an
    agent.

    The infos of a slot whose episode ends hold `terminal_observation`, `TimeLimit.truncated` and
    SB3's `episode`: `r`, the sum of rewards, `l`, the number of rounds, and `t`, the seconds since
    this object was made.

    SB3 gets the same answers from the slots as from the environments of its `DummyVecEnv`.

    Args:
        slots: Number of slots.
        game: Game on NumPy.
        seen: Observation space of a slot.
        action: Action space of a slot, in [0, 1].
        scaled: Whether actions are in [-1, 1] and not in [0, 1].
        seed: Random seed.
        render_mode: Render mode for the first game.
    """

    spec = None
    """None, as for an environment that Gymnasium did not make."""

    def __init__(
        self,
        slots: int,
        game: Game,
        seen: Box,
        action: Box,
        *,
        scaled: bool,
        seed: int | None,
        render_mode: RenderMode | None = None,
    ) -> None:
        like = game.like
        if not isinstance(like, np.ndarray):
            raise ValueError(
                f"the game plays on {type(like).__name__}; Stable-Baselines3 needs one on NumPy"
            )
        self.render_mode = render_mode
        self._spectator = Spectator(game, render_mode)
        self._scaled = truth_value("scaled", scaled)
        space = Box(-1.0, 1.0, action.shape, np.float32) if self._scaled else action
        super().__init__(slots, seen, space)
        self.metadata: dict[str, Any] = {
            **deepcopy(RENDERING),
            "autoreset_mode": AutoresetMode.SAME_STEP,
        }
        self._like, self._game = like, game
        self._random = Random(generator(seed), like)
        self._returns, self._lengths = np.zeros(slots), np.zeros(slots, int)
        self._began = perf_counter()
        self._actions: Floats | None = None

    def __repr__(self) -> str:
        return f"{type(self).__name__}({game_facts(self._game, (self.num_envs,))})"

    def _repr_html_(self) -> str:
        return self._spectator.html(repr(self))

    @abstractmethod
    def _restart(self, ended: Flags | None) -> None:
        """Begin all episodes, or those of some slots."""

    @abstractmethod
    def _play(self, actions: Floats) -> Step:
        """Play a round with actions in [0, 1], (slots, A)."""

    @abstractmethod
    def _observe(self) -> Floats:
        """Return the observation of each slot, (slots, K), a new array."""

    def _follow(self) -> None:
        """Give the spectator the state of the games."""

    def reset(self) -> Floats:
        """Restart all slots, with the seed of the last call of `seed`, if there was one."""
        if self._seeds[0] is not None:
            self._random = Random(generator(self._seeds[0]), self._like)
        self._reset_seeds()
        self._reset_options()
        self._restart(None)
        self._returns[:], self._lengths[:] = 0, 0
        self._follow()
        return self._observe()

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Set the seed of the next `reset`; see `VecEnv.seed`."""
        return super().seed(None if seed is None else whole_number("seed", seed))

    def step_async(self, actions: npt.ArrayLike) -> None:
        """Take the actions of the next round, (slots, A).

        Raises:
            ValueError: The actions have the wrong shape, or an entry is NaN or outside the action
                space. Nothing has changed then.
        """
        shape = (self.num_envs, *(self.action_space.shape or ()))
        actions = check_action(actions, shape, -1.0 if self._scaled else 0.0)
        self._actions = actions * 0.5 + 0.5 if self._scaled else actions

    def step_wait(self) -> tuple[Floats, Floats, Flags, list[dict[str, Any]]]:
        """Play the round and restart the slots whose episode has ended."""
        if self._actions is None:
            raise RuntimeError("call step_async() before step_wait(): there are no actions")
        actions, self._actions = self._actions, None
        step = self._play(actions)
        self._returns += step.rewards
        self._lengths += 1
        infos = step.infos
        observation = self._observe()
        dones: Flags = step.terminated | step.truncated
        if dones.any():
            seconds = round(perf_counter() - self._began, 6)
            for slot in np.flatnonzero(dones).tolist():
                episode = {
                    "r": float(self._returns[slot]),
                    "l": int(self._lengths[slot]),
                    "t": seconds,
                }
                infos[slot]["terminal_observation"] = observation[slot]
                infos[slot]["TimeLimit.truncated"] = bool(step.truncated[slot])
                infos[slot]["episode"] = episode
            self._returns[dones], self._lengths[dones] = 0, 0
            self._restart(dones)
            observation = self._observe()
        self._follow()
        return observation, step.rewards.astype(np.float32, copy=False), dones, infos

    def close(self) -> None:
        """Close the window, if there is one."""
        self._spectator.close()

    def get_images(self) -> Sequence[npt.NDArray[np.uint8] | None]:
        """Return the picture of the first game, which SB3 tiles; None for each slot without
        `"rgb_array"`.
        """
        if self.render_mode != "rgb_array":
            return [None] * self.num_envs
        picture = self._spectator.render()
        return [picture if isinstance(picture, np.ndarray) else None]

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of this object, once for each slot."""
        return [getattr(self, attr_name) for _ in self._asked(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of this object.

        Raises:
            NotImplementedError: `indices` names some of the slots only.
        """
        if set(self._asked(indices)) != set(range(self.num_envs)):
            raise NotImplementedError(
                f"the games are one batch; {attr_name!r} can be set for all of them only"
            )
        setattr(self, attr_name, value)

    def env_method(
        self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any
    ) -> list[Any]:
        """Call a method of this object once, and return the result for each slot; `render` shows
        the first game.

        Raises:
            NotImplementedError: The method would play or restart all games.
        """
        if method_name in ("reset", "step"):
            raise NotImplementedError(
                f"the games are one batch; call {method_name}() of this object itself"
            )
        method = self._spectator.render if method_name == "render" else getattr(self, method_name)
        answer = method(*args, **kwargs)
        return [answer for _ in self._asked(indices)]

    def env_is_wrapped(self, wrapper_class: type[Any], indices: VecEnvIndices = None) -> list[bool]:
        """Return true for `Monitor`, since the infos hold what it adds, and false for every other
        wrapper.
        """
        return [wrapper_class is Monitor for _ in self._asked(indices)]

    def _asked(self, indices: VecEnvIndices) -> list[int]:
        asked = list(self._get_indices(indices))
        for index in asked:
            if not -self.num_envs <= index < self.num_envs:
                raise IndexError(
                    f"there is no slot {index}; the {self.num_envs} slots are 0 to "
                    f"{self.num_envs - 1}"
                )
        return [range(self.num_envs)[index] for index in asked]


Role = Literal["sr", "sp", "srsp"]

_ROLES = {prefix: role for role, prefix in PREFIXES.items()}


class AttackVecEnv(BatchVecEnv):
    """An attack task for Stable-Baselines3: E games of the task, played as one batch.

    Spaces and rewards are those of the task's `AttackEnv`, except for the range of the actions. A
    game that ends is restarted in the same step, as SB3 expects it. `TimeLimit.truncated` is true
    where the game ended after `max_cycles` rounds, so that learners bootstrap, and false where it
    ended at random.

    The infos of a game hold, in every step: `objective`, the objective of the round; `cost`, its
    unweighted cost; `trust`, the trust of each compromised agent by name (ToR, ToP or ToA by its
    role); and `honest_trust`, the mean trust of the honest agents that are present, NaN without
    any.

    Args:
        task: Attack task on NumPy; see `roletrust_env.make_task`.
        num_envs: Number of games, E.
        scaled: Whether actions are in [-1, 1], which suits most learners; else they are in [0, 1],
            as in `AttackEnv`.
        seed: Random seed; `seed(...)` before `reset()` sets another.
        render_mode: `"human"`, `"rgb_array"` or `"ansi"`; only the first game is shown.
        engine: `"rules"`, or `"compiled"`, which plays the same rounds faster, to the rounding of
            the dtype.

    Raises:
        ValueError: The task does not play on NumPy, the number of games is not a whole
            number of 1 or more, or the compiled engine cannot play the task.

    Example:
        >>> from roletrust_env import make_task
        >>> env = AttackVecEnv(make_task("paper-3x3", ("sp_2",), objective="exploit"), 256)
        >>> env.reset().shape
        (256, 10)
    """

    _whole = False  # whether no game ends at random

    def __init__(
        self,
        task: AttackTask,
        num_envs: int,
        *,
        scaled: bool = True,
        seed: int | None = None,
        render_mode: RenderMode | None = None,
        engine: Engine = "rules",
    ) -> None:
        if not isinstance(task, AttackTask):
            raise ValueError(
                f"task is {task!r}; it must be an attack task, such as make_task() makes"
            )
        num_envs = whole_number("num_envs", num_envs, 1)
        self.task = task
        self._batch = TaskBatch(task, (num_envs,), engine=engine, whole=self._whole)
        roster = task.game.roster
        self._compromised = [(name, roster.names.index(name)) for name in task.compromised]
        attackers = {*task.identities, *task.joint_policy.attackers}
        self._honest = [place for place, name in enumerate(roster.names) if name not in attackers]
        super().__init__(
            num_envs,
            task.game,
            *task_spaces(task),
            scaled=scaled,
            seed=seed,
            render_mode=render_mode,
        )
        self._spectator.attackers = task.compromised

    def _restart(self, ended: Flags | None) -> None:
        self._batch.restart(self._random, ended)

    def _play(self, actions: Floats) -> Step:
        outcome, terminated, truncated = self._batch.step(actions.T, self._random)
        trust = self.task.game.agent_trust(self._batch.games)
        names = [name for name, _ in self._compromised]
        own = trust[[place for _, place in self._compromised]].T.tolist()
        rows = (
            outcome.objective.tolist(),
            outcome.cost.tolist(),
            own,
            self._honest_trust(trust).tolist(),
        )
        infos = [
            {
                "objective": objective,
                "cost": cost,
                "trust": dict(zip(names, row, strict=True)),
                "honest_trust": honest,
            }
            for objective, cost, row, honest in zip(*rows, strict=True)
        ]
        return Step(outcome.reward, terminated, truncated, infos)

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
    """All agents of one role, each a slot: one policy with shared parameters learns to play the
    role.

    The game is that of `RoleTrustParallelEnv`, E times. Each agent has its own observation, action
    and reward, those of the PettingZoo environment. Slot `i * E + e` is the i-th agent of the role
    in game e. The agents of the other roles play honestly or by given policies. All slots of a game
    end together, as the game does.

    Args:
        game: Game on NumPy, for example `Game(make_scenario("crowd-10x10"), like=np.zeros((),
            np.float32))`.
        role: Role of the learning agents: `"sr"`, `"sp"` or `"srsp"`.
        games: Number of games, E.
        others: Policies of agents of the other roles, by name; an agent without a policy plays
            honestly.
        scaled: Whether actions are in [-1, 1], which suits most learners; else they are in [0, 1].
        seed: Random seed; `seed(...)` before `reset()` sets another.
        render_mode: `"human"`, `"rgb_array"` or `"ansi"`; only the first game is shown.

    Raises:
        ValueError: Agents come and go in the scenario, no agent has the role, `others` names an
            agent of the role, the game does not play on NumPy, or the number of games is no whole
            number of 1 or more.

    Example:
        >>> from roletrust_env import Game, make_scenario
        >>> env = RoleVecEnv(Game(make_scenario("paper-3x3"), like=np.zeros((), np.float32)), "sr", 64)
        >>> env.num_envs, env.reset().shape
        (192, (192, 17))
    """  # noqa: E501

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
        games = whole_number("games", games, 1)
        if role not in _ROLES:
            raise ValueError(f"role is {role!r}; it must be 'sr', 'sp' or 'srsp'")
        if game.presence.changes:
            raise ValueError(
                f"agents come and go or can be cut off in scenario {scenario.name!r}; a slot of a "
                "VecEnv is there "
                "in every step, so groups must not be open and there must be no admission control"
            )
        self.agents = tuple(name for name in roster.names if roster.role(name) == _ROLES[role])
        if not self.agents:
            raise ValueError(
                f"no agent in scenario {scenario.name!r} has the role {role!r}; there are "
                f"{shown(roster.names)}"
            )
        for name in others or {}:
            if name in self.agents:
                raise ValueError(f"agent {name!r} learns; remove it from others")
        check_games("games", games, game.start(game.draw(game.random(0), start=True)))
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
        self._end: Any = 0
        spaces = Box(0.0, 1.0, (seen,), np.float32), Box(0.0, 1.0, (done,), np.float32)
        slots = len(self.agents) * games
        super().__init__(slots, game, *spaces, scaled=scaled, seed=seed, render_mode=render_mode)

    def _restart(self, ended: Flags | None) -> None:
        batch = (self._games,)
        state = self.game.start(self.game.draw(self._random, batch, start=True))
        fresh = (
            state,
            self._joint_policy.begin(self._random, batch),
            self.game.random_end(self._random, batch),
        )
        if ended is not None and not ended.all():
            fresh = choose(ended[: self._games], fresh, (self._state, self._memories, self._end))
        self._state, self._memories, self._end = fresh

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
        self._state, rewards = game.step(
            self._state, scripted._replace(quality=quality, ratings=ratings), noise
        )
        ended = self._state.round >= self._end
        cut = (self._state.round >= game.scenario.max_cycles) & ~ended
        terminated, truncated = (np.concatenate([flags] * n) for flags in (ended, cut))
        return Step(
            rewards[self._rows].reshape(-1),
            terminated,
            truncated,
            [{} for _ in range(self.num_envs)],
        )

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
