"""Attack tasks as Gymnasium vector environments: a batch of games."""

from copy import deepcopy
from functools import partial
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from roletrust_env.arrays import Array, check_within, namespace
from roletrust_env.envs.actions import check_action
from roletrust_env.envs.arguments import Engine, option, refuse_unknown
from roletrust_env.envs.attack_env import TASKS, task_by_id
from roletrust_env.envs.spec import TaskSpec
from roletrust_env.envs.spectator import RenderMode, Spectator
from roletrust_env.envs.task_batch import TaskBatch, task_spaces
from roletrust_env.game.make_task import make_task
from roletrust_env.parameters import whole_number


class AttackVectorEnv(VectorEnv[Array, Array, Array]):
    """Many games of one attack task at once.

    Spaces, rewards and arguments are those of the task's `AttackEnv`; every array has one more axis
    in front, the game. `gymnasium.make_vec(id, num_envs=1024)` makes one.

    `autoreset_mode` determines when a game that has ended is restarted. With `"NextStep"`,
    Gymnasium's default, it is restarted in the next step, which ignores the action and has the
    reward 0. With `"SameStep"` it is restarted in the same step; the last observation is then in
    `infos["final_obs"]`, and the last infos are in `infos["final_info"]`. With `"Disabled"` it
    waits for `reset` with a `reset_mask`. Each key of the infos has a mask beside it, such as
    `infos["_final_obs"]`, which is true for the games that the key is valid for.

    Args:
        task_id: One of `TASKS`.
        num_envs: Number of games, E.
        autoreset_mode: Time at which a game that has ended is restarted: one of Gymnasium's
            `AutoresetMode`, or its value.
        render_mode: `"human"`, `"rgb_array"` or `"ansi"`; only the first game is shown.
        max_episode_steps: Length of an episode, if less than that of the game.
        engine: `"rules"`, or `"compiled"`, which plays the same rounds on NumPy faster, to the
            rounding of the dtype.
        like: Array of the library, dtype and device to play with; by default NumPy's float64. With
            a torch tensor, observations, rewards, flags and masks are tensors, too.
        **arguments: Arguments of `make_task`, which replace the defaults of the task.

    Raises:
        TypeError: An argument is unknown.
        ValueError: A name is unknown, a value is not allowed, or the compiled engine cannot play
            the task.
    """

    def __init__(
        self,
        task_id: str,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: RenderMode | None = None,
        max_episode_steps: int | None = None,
        engine: Engine = "rules",
        **arguments: Any,
    ) -> None:
        refuse_unknown(type(self), arguments, make_task)
        mode = next((mode for mode in AutoresetMode if autoreset_mode in (mode, mode.value)), None)
        if mode is None:
            known = ", ".join(f"{mode} or {mode.value!r}" for mode in AutoresetMode)
            raise ValueError(f"autoreset_mode is {autoreset_mode!r}; it must be {known}")
        num_envs = whole_number("num_envs", num_envs, 1)
        if max_episode_steps is not None:
            max_episode_steps = whole_number("max_episode_steps", max_episode_steps, 1)
        arguments["like"] = np.zeros(()) if arguments.get("like") is None else arguments["like"]
        self.task = task_by_id(task_id, arguments)
        self._batch = TaskBatch(self.task, (num_envs,), max_episode_steps, engine)
        self.num_envs = num_envs
        self.metadata = {**deepcopy(TASKS[task_id].metadata), "autoreset_mode": mode}
        self.render_mode = render_mode
        self.single_observation_space, self.single_action_space = task_spaces(self.task)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._mode = mode
        self._random = self.task.game.random()
        self._ended: Array | None = None  # games to restart in the next step
        self._spectator = Spectator(self.task.game, render_mode)
        self._spectator.attackers = self.task.compromised
        self._spec: EnvSpec | None = None

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.task!r}, num_envs: {self.num_envs})"

    def _repr_html_(self) -> str:
        return self._spectator.html(repr(self))

    @property
    def spec(self) -> EnvSpec | None:
        """The specification of Gymnasium, which can be written as JSON, with the length of an
        episode.
        """
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None:
            kwargs = {
                name: value for name, value in spec.kwargs.items() if name != "max_episode_steps"
            }
            if "autoreset_mode" in kwargs:
                kwargs["autoreset_mode"] = self.metadata["autoreset_mode"].value
            spec = TaskSpec.of(spec, kwargs=kwargs, max_episode_steps=self._batch.rounds)
        self._spec = spec

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Restart all games, or some.

        Args:
            seed: Random seed, one number for the whole batch; None continues with the same
                generator.
            options: `{"reset_mask": mask}` restarts only the games of the mask, a boolean array
                (E,). The other games continue, with the random numbers of the seed if there is one.
                Other keys are ignored.

        Raises:
            ValueError: The seed is a list, although the games share one generator; or the mask is
                no mask of the games.
            RuntimeError: There is a mask, but no game has begun yet.
        """
        if isinstance(seed, list):
            raise ValueError(f"seed is {seed!r}; the games share one generator, so give one number")
        mask = option(options, "reset_mask")
        if mask is not None:
            mask = self._checked_mask(mask)
        if seed is not None:
            self._random = self.task.game.random(seed)
        self._batch.restart(self._random, mask)
        left = None if mask is None or self._ended is None else self._ended & ~mask
        self._ended = left if left is not None and bool(left.any()) else None
        self._spectator.follow(self._batch.games)
        nothing = self._zeros()
        return self._observe(), self._infos(nothing, nothing, mask)

    def step(self, actions: Array) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        """Play one round of all games; see `gymnasium.vector.VectorEnv.step`.

        Raises:
            ValueError: The actions have the wrong shape, or hold NaN or a value outside [0, 1].
                Nothing has changed then.
            RuntimeError: `reset` was not called; or some games are over, and `autoreset_mode` is
                `"Disabled"`.
        """
        actions = self._checked(actions)
        xp = namespace(actions)
        begins = self._ended
        if begins is not None:
            if self._mode is AutoresetMode.DISABLED:
                raise RuntimeError(
                    'games are over; call reset(options={"reset_mask": mask}) for them before '
                    "step()"
                )
            self._batch.restart(self._random, begins)
            if bool(
                begins.all()
            ):  # no game plays: no random number is drawn, as in the reset of a single environment
                self._ended, never, nothing = None, begins & ~begins, self._zeros()
                self._spectator.follow(self._batch.games)
                return (
                    self._observe(),
                    nothing,
                    never,
                    xp.asarray(never, copy=True),
                    self._infos(nothing, nothing),
                )
        outcome, terminations, truncations = self._batch.step(actions.T, self._random, begins)
        rewards, objective, cost = outcome.reward, outcome.objective, outcome.cost
        if begins is not None:
            rewards, objective, cost = (
                xp.where(begins, 0.0, values) for values in (rewards, objective, cost)
            )
            terminations, truncations = terminations & ~begins, truncations & ~begins
        infos = self._infos(objective, cost)
        self._ended = None
        ended = terminations | truncations
        if bool(ended.any()):
            if self._mode is AutoresetMode.SAME_STEP:
                final = {
                    "final_obs": self._observe(),
                    "final_info": self._infos(objective, cost, ended),
                }
                infos = self._infos(*(xp.where(ended, 0.0, values) for values in (objective, cost)))
                infos |= final | {"_final_obs": ended, "_final_info": ended}
                self._batch.restart(self._random, ended)
            else:
                self._ended = ended
        self._spectator.follow(self._batch.games)
        return self._observe(), rewards, terminations, truncations, infos

    def render(self) -> tuple[Any, ...] | None:
        """Show the first game by `render_mode`.

        Returns:
            A frame for each game, as in Gymnasium: a picture or a text of the first game, and
            blanks; None with a window.
        """
        first = self._spectator.render()
        if first is None:
            return None
        blank = "" if isinstance(first, str) else np.zeros_like(first)
        return first, *[blank] * (self.num_envs - 1)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the window, if there is one."""
        self._spectator.close()

    def _observe(self) -> Array:
        observation = self._batch.observe().T
        if isinstance(observation, np.ndarray):
            return np.ascontiguousarray(observation, np.float32)
        return observation.float().contiguous()

    def _infos(self, objective: Array, cost: Array, games: Array | None = None) -> dict[str, Array]:
        """Return the infos of all games, or of some games, (E,), with the masks of Gymnasium."""
        xp = namespace(objective)
        mask = xp.ones_like(objective, dtype=xp.bool) if games is None else games
        return {"objective": objective, "_objective": mask, "cost": cost, "_cost": mask}

    def _zeros(self) -> Array:
        like = self.task.game.like
        return namespace(like).zeros(self.num_envs, dtype=like.dtype, device=like.device)

    def _checked(self, actions: Array) -> Array:
        like, shape = self.task.game.like, self.action_space.shape or ()
        if isinstance(actions, np.ndarray) or not isinstance(actions, type(like)):
            actions = check_action(actions, shape)
        elif tuple(actions.shape) != shape:
            raise ValueError(f"the action must have shape {shape}, got {tuple(actions.shape)}")
        else:
            check_within("the action", actions)
        if isinstance(like, np.ndarray):
            return actions
        return namespace(like).asarray(actions, dtype=like.dtype, device=like.device)

    def _checked_mask(self, mask: Array) -> Array:
        like = self.task.game.like
        mask = mask if isinstance(mask, type(like)) else np.asarray(mask)
        if (
            tuple(mask.shape) != (self.num_envs,)
            or not str(mask.dtype).endswith("bool")
            or not bool(mask.any())
        ):
            raise ValueError(
                f"reset_mask has shape {tuple(mask.shape)} and dtype {mask.dtype}; it must have "
                "shape "
                f"({self.num_envs},), be boolean and true somewhere"
            )
        if self._batch.state is None:
            raise RuntimeError("call reset() without a reset_mask first: no game has begun yet")
        return namespace(like).asarray(mask, device=like.device, copy=True)


ProviderAttackVectorEnv = partial(AttackVectorEnv, "RoleTrust/ProviderAttack-v0")
RaterAttackVectorEnv = partial(AttackVectorEnv, "RoleTrust/RaterAttack-v0")
DualAttackVectorEnv = partial(AttackVectorEnv, "RoleTrust/DualAttack-v0")
CollusionAttackVectorEnv = partial(AttackVectorEnv, "RoleTrust/CollusionAttack-v0")
