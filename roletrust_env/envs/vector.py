"""The batched faces of an attack: Gymnasium's VectorEnv over one batched game, not a loop over games."""

from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from roletrust_env.arrays import Array, namespace
from roletrust_env.envs.attack import check_action, task_spaces
from roletrust_env.envs.batch import TaskBatch
from roletrust_env.envs.tasks import TASKS
from roletrust_env.game.attack import make_task


class AttackVectorEnv(VectorEnv[Array, Array, Array]):
    """Many games of one attack task at once.

    Spaces, rewards and arguments are those of the task's `AttackEnv`; everything has one more axis in front, the game.
    Made by `gymnasium.make_vec(id, num_envs=1024)`.

    A game that ends is restarted by itself, as `autoreset_mode` says: in the step after (`AutoresetMode.NEXT_STEP`,
    Gymnasium's default; that step ignores the action and rewards with 0) or in the same one
    (`AutoresetMode.SAME_STEP`; the last observation is then in `infos["final_obs"]`, the last infos are in
    `infos["final_info"]`, and `infos["_final_obs"]` and `infos["_final_info"]` say for which games).

    Args:
        task_id: one of `TASKS`.
        num_envs: number of games, E.
        autoreset_mode: when a game that has ended is restarted.
        like: an array of the library, dtype and device to play with; by default NumPy's float32. With a torch tensor,
            observations, rewards and flags are tensors, too.
        **arguments: of `make_task`, over the task's defaults.

    Raises:
        ValueError: a name is unknown or a value is not allowed.
    """

    def __init__(
        self,
        task_id: str,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
        **arguments: Any,
    ) -> None:
        modes = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)
        if autoreset_mode not in modes:
            raise ValueError(f"autoreset_mode is {autoreset_mode!r}; it must be one of {', '.join(map(str, modes))}")
        if not isinstance(num_envs, int | np.integer) or num_envs < 1:
            raise ValueError(f"num_envs is {num_envs!r}; it must be a whole number, 1 or more")
        if task_id not in TASKS:
            raise ValueError(f"unknown task {task_id!r}; known: {', '.join(TASKS)}")
        self.task = make_task(**{**TASKS[task_id].defaults, **arguments})
        self.num_envs = num_envs
        self.metadata = {**TASKS[task_id].metadata, "autoreset_mode": autoreset_mode, "render_modes": []}
        self.single_observation_space, self.single_action_space = task_spaces(self.task)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._same_step = autoreset_mode is AutoresetMode.SAME_STEP
        self._batch = TaskBatch(self.task, (num_envs,))
        self._random = self.task.game.random()
        self._ended: Array | None = None  # games to restart in the next step

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Restart all games.

        Args:
            seed: one number for the whole batch; None goes on with the generator.
            options: ignored.

        Raises:
            ValueError: a list of seeds is given: the games share one generator.
        """
        if not isinstance(seed, int | np.integer | None):
            raise ValueError(f"seed is {seed!r}; the games share one generator, so give one number")
        if seed is not None:
            self._random = self.task.game.random(seed)
        self._batch.restart(self._random)
        self._ended = None
        return self._observe(), dict.fromkeys(("objective", "cost"), self._zeros())

    def step(self, actions: Array) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        """Play one round of all games; see `gymnasium.vector.VectorEnv.step`.

        Raises:
            ValueError: the actions are of the wrong shape, NaN or outside [0, 1]. Nothing has changed then.
            RuntimeError: `reset` was not called.
        """
        actions = self._checked(actions)
        xp = namespace(actions)
        begins = self._ended
        if begins is not None:
            self._batch.restart(self._random, begins)
            if bool(begins.all()):  # nobody plays; no luck is drawn, as in the reset of a single environment
                self._ended, never, nothing = None, begins & ~begins, self._zeros()
                return (
                    self._observe(),
                    nothing,
                    never,
                    xp.asarray(never, copy=True),
                    {"objective": nothing, "cost": nothing},
                )
        outcome = self._batch.step(actions.T, self._random, begins)
        terminations, truncations = outcome.caught, outcome.over & ~outcome.caught
        rewards, infos = outcome.reward, {"objective": outcome.objective, "cost": outcome.cost}
        if begins is not None:
            rewards = xp.where(begins, 0.0, rewards)
            terminations, truncations = terminations & ~begins, truncations & ~begins
            infos = {name: xp.where(begins, 0.0, values) for name, values in infos.items()}
        self._ended = None
        ended = terminations | truncations
        if bool(ended.any()):
            if self._same_step:
                final = {"final_obs": self._observe(), "final_info": infos}
                infos = {name: xp.where(ended, 0.0, values) for name, values in infos.items()}
                infos = {**infos, **final, "_final_obs": ended, "_final_info": ended}
                self._batch.restart(self._random, ended)
            else:
                self._ended = ended
        return self._observe(), rewards, terminations, truncations, infos

    def _observe(self) -> Array:
        observation = self._batch.observe().T
        return (
            np.ascontiguousarray(observation, np.float32)
            if isinstance(observation, np.ndarray)
            else observation.contiguous()
        )

    def _zeros(self) -> Array:
        like = self.task.game.like
        return namespace(like).zeros(self.num_envs, dtype=like.dtype, device=like.device)

    def _checked(self, actions: Array) -> Array:
        if isinstance(self.task.game.like, np.ndarray):
            return check_action(actions, self.action_space.shape or ())
        xp = namespace(self.task.game.like)
        if not isinstance(actions, type(self.task.game.like)):
            return xp.asarray(
                check_action(actions, self.action_space.shape or ()),
                dtype=self.task.game.like.dtype,
                device=self.task.game.like.device,
            )
        actions = xp.asarray(actions, dtype=self.task.game.like.dtype, device=self.task.game.like.device)
        if tuple(actions.shape) != self.action_space.shape:
            raise ValueError(f"the actions have shape {tuple(actions.shape)}; needed is {self.action_space.shape}")
        if not bool(((actions >= 0) & (actions <= 1)).all()):
            raise ValueError("the actions hold NaN or numbers outside [0, 1]; every entry must lie in [0, 1]")
        return actions


def register_tasks() -> None:
    """Make the tasks known to Gymnasium; importing `roletrust_env` does."""
    for task_id, environment in TASKS.items():
        gymnasium.register(
            task_id,
            entry_point=environment,
            vector_entry_point=partial(AttackVectorEnv, task_id),
        )
