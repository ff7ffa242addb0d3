"""The common part of the environments for Stable-Baselines3: a `VecEnv` whose slots are one batch."""

from abc import abstractmethod
from collections.abc import Sequence
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices

from roletrust_env.envs.attack_env import check_action
from roletrust_env.envs.spectator import RENDERING, RenderMode, Spectator
from roletrust_env.game.brief import game_facts
from roletrust_env.game.game import Game
from roletrust_env.randomness import Random

Floats = npt.NDArray[np.float32]
Flags = npt.NDArray[np.bool_]


class Step(NamedTuple):
    """The outcome of a round for each slot."""

    rewards: Floats
    terminated: Flags
    truncated: Flags
    infos: list[dict[str, Any]]


class BatchVecEnv(VecEnv):
    """The part of `VecEnv` that is the same for a slot that is a game and for a slot that is an agent.

    The infos of a slot whose episode ends hold `terminal_observation`, `TimeLimit.truncated` and SB3's `episode`: `r`,
    the sum of rewards, `l`, the number of rounds, and `t`, the seconds since this object was made.

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
            raise ValueError(f"the game plays on {type(like).__name__}; Stable-Baselines3 needs one on NumPy")
        self.render_mode = render_mode
        self._spectator = Spectator(game, render_mode)
        self._scaled = scaled
        space = Box(-1.0, 1.0, action.shape, np.float32) if scaled else action
        super().__init__(slots, seen, space)
        self.metadata: dict[str, Any] = {**RENDERING, "autoreset_mode": AutoresetMode.SAME_STEP}
        self._like, self._game = like, game
        self._random = Random(np.random.default_rng(seed), like)
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
            self._random = Random(np.random.default_rng(self._seeds[0]), self._like)
        self._reset_seeds()
        self._reset_options()
        self._restart(None)
        self._returns[:], self._lengths[:] = 0, 0
        self._follow()
        return self._observe()

    def step_async(self, actions: npt.ArrayLike) -> None:
        """Take the actions of the next round, (slots, A).

        Raises:
            ValueError: The actions have the wrong shape, or an entry is NaN or outside the action space. Nothing has
                changed then.
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
                episode = {"r": float(self._returns[slot]), "l": int(self._lengths[slot]), "t": seconds}
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
        """Return the picture of the first game, which SB3 tiles; None for each slot without `"rgb_array"`."""
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
            raise NotImplementedError(f"the games are one batch; {attr_name!r} can be set for all of them only")
        setattr(self, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any) -> list[Any]:
        """Call a method of this object once, and return the result for each slot; `render` shows the first game.

        Raises:
            NotImplementedError: The method would play or restart all games.
        """
        if method_name in ("reset", "step"):
            raise NotImplementedError(f"the games are one batch; call {method_name}() of this object itself")
        method = self._spectator.render if method_name == "render" else getattr(self, method_name)
        answer = method(*args, **kwargs)
        return [answer for _ in self._asked(indices)]

    def env_is_wrapped(self, wrapper_class: type[Any], indices: VecEnvIndices = None) -> list[bool]:
        """Return true for `Monitor`, since the infos hold what it adds, and false for every other wrapper."""
        return [wrapper_class is Monitor for _ in self._asked(indices)]

    def _asked(self, indices: VecEnvIndices) -> list[int]:
        asked = list(self._get_indices(indices))
        for index in asked:
            if not -self.num_envs <= index < self.num_envs:
                raise IndexError(f"there is no slot {index}; the {self.num_envs} slots are 0 to {self.num_envs - 1}")
        return [range(self.num_envs)[index] for index in asked]
