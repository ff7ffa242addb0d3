"""What the faces for Stable-Baselines3 have in common: a `VecEnv` whose slots are one batch."""

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
from roletrust_env.game.game import Game
from roletrust_env.randomness import Random

Floats = npt.NDArray[np.float32]
Flags = npt.NDArray[np.bool_]


class Step(NamedTuple):
    """What a round brought each slot, and its info."""

    rewards: Floats
    terminated: Flags
    truncated: Flags
    infos: list[dict[str, Any]]


class Slots(VecEnv):
    """The part of `VecEnv` that does not depend on what a slot is.

    Infos of a slot whose episode ends hold `terminal_observation`, `TimeLimit.truncated` and SB3's
    `episode`: `r`, the sum of rewards, `l`, the number of rounds, `t`, seconds since this object was made.

    To SB3 the slots answer as the environments of its `DummyVecEnv` would, one object for all of them.

    Args:
        slots: how many there are.
        game: on NumPy.
        seen: observation space of a slot.
        action: its action space, in [0, 1].
        scaled: whether actions are in [-1, 1] and not in [0, 1].
        seed: of all luck.
        render_mode: how the first game is shown.
    """

    spec = None
    """As of an environment that Gymnasium did not make."""

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
        if slots < 1:
            raise ValueError("num_envs is less than 1; there must be a game")
        self.render_mode = render_mode
        self._spectator = Spectator(game, render_mode)
        self._scaled = scaled
        space = Box(-1.0, 1.0, action.shape, np.float32) if scaled else action
        super().__init__(slots, seen, space)
        self.metadata: dict[str, Any] = {**RENDERING, "autoreset_mode": AutoresetMode.SAME_STEP}
        self._like = like
        self._random = Random(np.random.default_rng(seed), like)
        self._returns, self._lengths = np.zeros(slots), np.zeros(slots, int)
        self._began = perf_counter()
        self._actions: Floats | None = None

    @abstractmethod
    def _restart(self, ended: Flags | None) -> None:
        """Begin all episodes, or those of some slots."""

    @abstractmethod
    def _play(self, actions: Floats) -> Step:
        """Play a round; actions in [0, 1], (slots, A)."""

    @abstractmethod
    def _observe(self) -> Floats:
        """What each slot sees, (slots, K), a new array."""

    def _follow(self) -> None:
        """Tell the spectator how the games stand, if there is something to see."""

    def reset(self) -> Floats:
        """Restart all slots; a seed given to `seed` before takes effect."""
        if self._seeds[0] is not None:
            self._random = Random(np.random.default_rng(self._seeds[0]), self._like)
        self._reset_seeds()
        self._reset_options()
        self._restart(None)
        self._returns[:], self._lengths[:] = 0, 0
        self._follow()
        return self._observe()

    def step_async(self, actions: npt.ArrayLike) -> None:
        """Take the actions of the next round, of the action space, (slots, A).

        Raises:
            ValueError: they are of the wrong shape, or NaN or outside the space. Nothing has changed then.
        """
        shape = (self.num_envs, *(self.action_space.shape or ()))
        actions = check_action(actions, shape, -1.0 if self._scaled else 0.0)
        self._actions = actions * 0.5 + 0.5 if self._scaled else actions

    def step_wait(self) -> tuple[Floats, Floats, Flags, list[dict[str, Any]]]:
        """Play the round; a slot whose episode ended begins the next one at once."""
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
        """The picture of the first game alone, which SB3 tiles; without pictures None for each slot, as in SB3."""
        if self.render_mode != "rgb_array":
            return [None] * self.num_envs
        picture = self._spectator.render()
        return [picture if isinstance(picture, np.ndarray) else None]

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of this object, for each slot asked for."""
        return [getattr(self, attr_name) for _ in self._asked(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of this object.

        Raises:
            NotImplementedError: it is to be set for some slots only.
        """
        if set(self._asked(indices)) != set(range(self.num_envs)):
            raise NotImplementedError(f"the games are one batch; {attr_name!r} can be set for all of them only")
        setattr(self, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any) -> list[Any]:
        """What a method of this object returns, called once, for each slot asked for; `render` shows the first game.

        Raises:
            NotImplementedError: the method would play or restart all games.
        """
        if method_name in ("reset", "step"):
            raise NotImplementedError(f"the games are one batch; call {method_name}() of this object itself")
        method = self._spectator.render if method_name == "render" else getattr(self, method_name)
        answer = method(*args, **kwargs)
        return [answer for _ in self._asked(indices)]

    def env_is_wrapped(self, wrapper_class: type[Any], indices: VecEnvIndices = None) -> list[bool]:
        """Whether a slot does what the wrapper does: the infos have what `Monitor` adds to them."""
        return [wrapper_class is Monitor for _ in self._asked(indices)]

    def _asked(self, indices: VecEnvIndices) -> list[int]:
        return [range(self.num_envs)[i] for i in self._get_indices(indices)]
