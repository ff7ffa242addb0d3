"""Wrappers for learners and libraries that need other actions than numbers in [0, 1], or a fixed
set of agents.
"""

from collections.abc import Callable, Container, Mapping
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.spaces import Box, Discrete, MultiDiscrete
from gymnasium.utils import RecordConstructorArgs
from gymnasium.wrappers import TransformAction
from pettingzoo import ParallelEnv
from pettingzoo.utils.wrappers import BaseParallelWrapper

from roletrust_env.arrays import numpy_array
from roletrust_env.envs.actions import NUMBERS
from roletrust_env.envs.arguments import seed_spaces, space_of
from roletrust_env.errors import short
from roletrust_env.parameters import truth_value, whole_number

ByName = dict[str, Any]
Answers = tuple[ByName, ByName, ByName, ByName, ByName]


class RescaleClipAction(TransformAction[Any, Any, Any], RecordConstructorArgs):
    """Actions in [-1, 1], clipped, for learners with a Gaussian that is centred on 0 and leaves the
    space.

    It wraps a task of Gymnasium, or the agents in `ParallelTransformAction`. The space stays
    bounded, which many libraries need; Gymnasium's `ClipAction` makes it unbounded. NaN stays NaN,
    and the environment refuses it.

    Example:
        >>> env = RescaleClipAction(gymnasium.make("RoleTrust/RaterAttack-v0"))
        >>> env.action_space
        Box(-1.0, 1.0, (3,), float32)
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        RecordConstructorArgs.__init__(self)
        TransformAction.__init__(self, env, self._unscale, Box(-1.0, 1.0, _shape(env), np.float32))

    def _unscale(self, action: Any) -> Any:
        numbers = numpy_array("the action", action, f"in {self.action_space}")
        return np.clip(numbers, -1.0, 1.0) * 0.5 + 0.5 if numbers.dtype.kind in NUMBERS else action


class DiscretizeLevels(TransformAction[Any, Any, Any], RecordConstructorArgs):
    """Discrete actions: each entry has one of several levels from 0 to 1, both ends included.

    It wraps a task of Gymnasium, or the agents in `ParallelTransformAction`. Gymnasium's
    `DiscretizeAction` takes the middles of its bins, so that no agent could choose exactly 0 or 1
    with it.

    Args:
        env: Environment with actions in [0, 1].
        levels: Number of levels, 2 or more.
        multidiscrete: Whether an action has a number for each entry. Else it is one number for all
            entries together, with levels ** entries values.

    Raises:
        ValueError: There are fewer than 2 levels, or more than 2 ** 31 actions.

    Example:
        >>> DiscretizeLevels(gymnasium.make("RoleTrust/ProviderAttack-v0"), 5).action_space
        Discrete(5)
        >>> DiscretizeLevels(gymnasium.make("RoleTrust/RaterAttack-v0"), 5, multidiscrete=True).action_space
        MultiDiscrete([5 5 5])
    """  # noqa: E501

    def __init__(
        self, env: gymnasium.Env[Any, Any], levels: int, multidiscrete: bool = False
    ) -> None:
        entries = _shape(env)[0]
        levels = whole_number("levels", levels, 2)
        multidiscrete = truth_value("multidiscrete", multidiscrete)
        if not multidiscrete and levels**entries > 2**31:
            raise ValueError(
                f"{levels} levels of {entries} entries are {levels}**{entries} actions; use "
                "multidiscrete"
            )
        RecordConstructorArgs.__init__(self, levels=levels, multidiscrete=multidiscrete)
        space = MultiDiscrete([levels] * entries) if multidiscrete else Discrete(levels**entries)
        TransformAction.__init__(self, env, self._value, space)
        self._grid = (levels,) * entries

    def _value(self, action: Any) -> npt.NDArray[np.float32]:
        number = numpy_array("the action", action, f"in {self.action_space}")
        shape = self.action_space.shape or ()
        if number.size == np.prod(shape):
            number = number.reshape(shape)
        if number not in self.action_space:
            raise ValueError(
                f"the action is {short(repr(action))}; it must be in {self.action_space}"
            )
        each = number if number.ndim else np.asarray(np.unravel_index(int(number), self._grid))
        return (each / (self._grid[0] - 1)).astype(np.float32)


class ParallelTransformAction(BaseParallelWrapper[str, Any, Any]):
    """A PettingZoo environment with an action wrapper of Gymnasium for each agent.

    Args:
        env: Parallel environment.
        wrapper: Action wrapper without memory, such as `RescaleClipAction`, `DiscretizeLevels` or
            `gymnasium.wrappers.ClipAction`.
        **arguments: Arguments of the wrapper.

    Example:
        >>> import roletrust_env
        >>> env = ParallelTransformAction(roletrust_env.parallel_env(), DiscretizeLevels, levels=3)
        >>> env.action_space("sp_0"), env.action_space("sr_0")
        (Discrete(3), Discrete(27))
    """

    def __init__(
        self,
        env: ParallelEnv[str, Any, Any],
        wrapper: Callable[..., gymnasium.Env[Any, Any]],
        **arguments: Any,
    ) -> None:
        super().__init__(env)
        self._each = {
            name: wrapper(_OneAgent(env.action_space(name)), **arguments)
            for name in env.possible_agents
        }
        self.action_spaces = {name: one.action_space for name, one in self._each.items()}

    def action_space(self, agent: str) -> gymnasium.Space[Any]:
        """Return the action space of an agent, the same object at each call.

        Raises:
            ValueError: There is no such agent.
        """
        return space_of(agent, self.action_spaces)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[ByName, ByName]:
        """Begin a new episode; see `RoleTrustParallelEnv.reset`."""
        answers: tuple[ByName, ByName] = self.env.reset(seed=seed, options=options)
        seed_spaces(self.action_spaces, seed)
        return answers

    def step(self, actions: Mapping[str, Any]) -> Answers:
        """Play one round; see `RoleTrustParallelEnv.step`."""
        if not isinstance(actions, Mapping):
            raise ValueError(
                f"actions are {type(actions).__name__}; they must be a dict from agent to action"
            )
        answers: Answers = self.env.step(
            {name: self._translated(name, action) for name, action in actions.items()}
        )
        return answers

    def _translated(self, agent: str, action: Any) -> Any:
        if agent not in self._each:
            return action  # the environment refuses it
        try:
            return self._each[agent].step(action)[0]
        except ValueError as error:
            raise ValueError(f"the action of {agent!r}: {error}") from None


class _OneAgent(gymnasium.Env[Any, Any]):
    """An environment of one agent for its action wrapper: the observation is the action that
    reached it.
    """

    def __init__(self, space: gymnasium.Space[Any]) -> None:
        self.action_space = space

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        return action, 0.0, False, False, {}


class FixedAgents(BaseParallelWrapper[str, Any, Any]):
    """All agents are in every dictionary from the first step to the last, for libraries with a
    fixed set of agents.

    All `possible_agents` act in every step. An absent agent observes zeros and has the reward 0,
    and its action is ignored. The episode ends for all agents together: as a truncation if it has
    reached its length, and as a termination if no agent is left. The infos of each agent hold
    `present`: whether the agent is there.

    Example:
        >>> import roletrust_env
        >>> env = FixedAgents(roletrust_env.parallel_env("open-system"))
        >>> observations, infos = env.reset(seed=0)
        >>> env.agents == env.possible_agents
        True
    """

    def __init__(self, env: ParallelEnv[str, Any, Any]) -> None:
        super().__init__(env)
        self.agents: list[str] = []

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[ByName, ByName]:
        """Begin a new episode; see `RoleTrustParallelEnv.reset`."""
        observations, _ = self.env.reset(seed=seed, options=options)
        self.agents = list(self.possible_agents)
        return self._observed(observations), self._presence(observations)

    def step(self, actions: Mapping[str, Any]) -> Answers:
        """Play one round; see `RoleTrustParallelEnv.step`.

        Raises:
            ValueError: The action of a present agent is missing or not allowed, or there is no such
                agent.
        """
        if not isinstance(actions, Mapping):
            raise ValueError(
                f"actions are {type(actions).__name__}; they must be a dict from agent to action"
            )
        absent = set(self.agents).difference(self.env.agents)
        acted = {agent: action for agent, action in actions.items() if agent not in absent}
        observations, rewards, terminations, truncations, _ = self.env.step(acted)
        present = {agent for agent, gone in terminations.items() if not gone}
        over, all_gone = any(truncations.values()), not self.env.agents
        answers = (
            self._observed(observations),
            {agent: rewards.get(agent, 0.0) for agent in self.agents},
            dict.fromkeys(self.agents, all_gone and not over),
            dict.fromkeys(self.agents, over),
            self._presence(present),
        )
        if all_gone:
            self.agents = []
        return answers

    def _observed(self, observations: ByName) -> ByName:
        return {
            agent: observations[agent]
            if agent in observations
            else np.zeros_like(self.observation_space(agent).low)
            for agent in self.agents
        }

    def _presence(self, present: Container[str]) -> ByName:
        return {agent: {"present": agent in present} for agent in self.agents}


def _shape(env: gymnasium.Env[Any, Any]) -> tuple[int, ...]:
    """Return the shape of the actions, which must be numbers in [0, 1]."""
    space = env.action_space
    if not isinstance(space, Box) or np.any(space.low != 0) or np.any(space.high != 1):
        raise ValueError(f"the action space is {space}; it must be a Box of [0, 1]")
    return space.shape
