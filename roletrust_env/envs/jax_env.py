"""Environments as pure functions of JAX, in the form of JaxMARL's `MultiAgentEnv`.

They play the same rules as all other environments: `Game.step` on a third array library.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from gymnasium.spaces import Box

from roletrust_env.arrays import Array
from roletrust_env.envs.arguments import refuse_empty_start, refuse_unknown, space_of
from roletrust_env.envs.attack_env import task_by_id
from roletrust_env.game.brief import game_facts
from roletrust_env.game.game import Game
from roletrust_env.game.make_task import make_task
from roletrust_env.game.state import Actions, Noise, State
from roletrust_env.randomness import STREAMS, Random
from roletrust_env.trees import is_array, map_leaves
from roletrust_env.trust import TrustModel
from roletrust_env.world import Scenario, make_scenario
from roletrust_env.world.presence import PRESENT

Observations: TypeAlias = dict[str, Array]
Step: TypeAlias = tuple[Observations, Any, dict[str, Array], dict[str, Array], dict[str, Array]]
"""Observations, state, rewards, flags of agents that are done, with the key `"__all__"`, and infos."""


class JaxEnv(ABC):
    """Base of the environments of JAX: the part that does not depend on who learns.

    `reset` and `step` are pure, so `jax.jit`, `jax.vmap` and `jax.lax.scan` take them. A state is a tree of arrays.
    Actions cannot be refused while JAX traces, so they are clipped to [0, 1], and NaN becomes 0.

    Attributes:
        game: Game that is played, in JAX's default precision when this object is made.
        agents: Names of the agents that learn.
        num_agents: Number of them.
        observation_spaces: Observation space of each agent, by name.
        action_spaces: Action space of each agent, by name.
    """

    name: ClassVar[str]

    def __init__(self, game: Game, agents: Sequence[str], sizes: Sequence[int]) -> None:
        """Try a round.

        Args:
            game: Game on JAX.
            agents: Names of the agents that learn.
            sizes: Size of the action of each of them.

        Raises:
            ValueError: The trust model, or another part of the game, branches on values in Python.
        """
        self.game, self.agents, self.num_agents = game, list(agents), len(agents)
        self.action_spaces = {a: Box(0.0, 1.0, (n,), np.float32) for a, n in zip(agents, sizes, strict=True)}
        key = jax.random.key(0)
        try:
            seen, state = jax.eval_shape(self.reset, key)
            actions = {agent: jnp.zeros(n) for agent, n in zip(agents, sizes, strict=True)}
            jax.eval_shape(self.step, key, state, actions)
        except (jax.errors.ConcretizationTypeError, jax.errors.TracerArrayConversionError) as error:
            raise ValueError(
                f"JAX cannot trace a round with the trust model {game.model!r}: it branches on values in Python, or "
                f"leaves JAX ({type(error).__name__}); take another model, or another environment"
            ) from error
        self.observation_spaces = {agent: Box(*self._bounds, seen[agent].shape, np.float32) for agent in agents}

    _bounds: tuple[float, float] = (0.0, 1.0)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({game_facts(self.game)})"

    def observation_space(self, agent: str) -> Box:
        """Return the observation space of an agent."""
        return space_of(agent, self.observation_spaces)

    def action_space(self, agent: str) -> Box:
        """Return the action space of an agent."""
        return space_of(agent, self.action_spaces)

    def reset(self, key: Array) -> tuple[Observations, Any]:
        """Begin an episode.

        Args:
            key: Key of JAX.

        Returns:
            The observations and the state.
        """
        noise, policies = jax.random.split(key)
        state = _without_flags(self._start(self._noise(noise, start=True), _KeyRandom(policies, self.game.like)))
        return self.get_obs(state), state

    def step(self, key: Array, state: Any, actions: Mapping[str, Array]) -> Step:
        """Play one round, and begin another episode if this one is over; the observations are then those of its start.

        Args:
            key: Key of JAX.
            state: State before the round.
            actions: Action of each agent.

        Raises:
            ValueError: An action is missing or has another shape than its space.
        """
        key, again = jax.random.split(key)
        seen, after, rewards, dones, infos = self.step_env(key, state, actions)
        over = dones["__all__"]
        seen, after = jax.tree.map(lambda new, old: jnp.where(over, new, old), self.reset(again), (seen, after))
        return seen, after, rewards, dones, infos

    def step_env(self, key: Array, state: Any, actions: Mapping[str, Array]) -> Step:
        """Play one round, without another episode after it. See `step`.

        Raises:
            ValueError: An action is missing or has another shape than its space.
        """
        noise, policies = jax.random.split(key)
        clipped = {agent: jnp.clip(jnp.nan_to_num(self._action(actions, agent)), 0.0, 1.0) for agent in self.agents}
        after, *outcome = self._play(state, clipped, self._noise(noise), _KeyRandom(policies, self.game.like))
        after = _without_flags(after)
        return self.get_obs(after), after, *outcome

    @abstractmethod
    def get_obs(self, state: Any) -> Observations:
        """Return the observation of each agent."""

    @abstractmethod
    def _start(self, noise: Noise, random: Random) -> Any:
        """Return the state before the first round."""

    @abstractmethod
    def _play(
        self, state: Any, actions: Mapping[str, Array], noise: Noise, random: Random
    ) -> tuple[Any, dict[str, Array], dict[str, Array], dict[str, Array]]:
        """Return the state after a round, rewards, dones and infos."""

    def _action(self, actions: Mapping[str, Array], agent: str) -> Array:
        """Return the action of an agent, whose shape is known before its values are."""
        if agent not in actions:
            raise ValueError(f"the action of {agent!r} is missing; needed are those of {', '.join(self.agents)}")
        action, shape = jnp.asarray(actions[agent]), self.action_spaces[agent].shape
        if action.shape != shape:
            raise ValueError(f"the action of {agent!r} is of shape {action.shape}; it must be of shape {shape}")
        return action

    def _noise(self, key: Array, *, start: bool = False) -> Noise:
        """Return the noise of a round: that of NumPy's `Game.noise` for the same words."""
        words = jax.random.bits(key, (STREAMS, 4), jnp.uint32)
        return self.game.noise(jax.lax.bitcast_convert_type(words, jnp.int32), start=start)


class RoleTrustJaxEnv(JaxEnv):
    """The game of `RoleTrustParallelEnv` on JAX: all agents learn.

    ## Description, Action Space, Observation Space, Rewards, Starting State

    Those of `RoleTrustParallelEnv`, but all agents are in `agents` all the time. The reward of an absent agent is 0,
    its actions are ignored, and its observation is what it would see.

    ## Episode End

    An agent is done when it has left or is cut off. All are done after the scenario's `max_cycles` steps, and when
    nobody is present any more; `step` then begins another episode.

    ## Information

    `trust`, the trust of every agent by its role, shape (N,); `present`, whether it is present, boolean, shape (N,).

    ## Arguments

    - scenario: Name of a preset, path of a TOML or YAML file, or a `Scenario`. The service `hog` needs NumPy.
    - trust_model: Name of a trust model, or a trust model that has no branches on values in Python.
    - **changes: Other values of fields of the scenario.

    Raises:
        TypeError: An argument is unknown.
        ValueError: A name is unknown, a value is not allowed, or JAX cannot trace a round.

    ## Version History

    - v0: first version.
    """

    name = "roletrust_v0"

    def __init__(
        self,
        scenario: str | Path | Scenario = "paper-3x3",
        trust_model: str | TrustModel[Any] = "role-trust",
        **changes: Any,
    ) -> None:
        refuse_unknown(type(self), changes)
        scenario = make_scenario(scenario)
        game = Game(scenario.change(**changes) if changes else scenario, trust_model, jnp.zeros(()))
        refuse_empty_start(game.scenario)
        super().__init__(game, game.roster.names, list(map(game.roster.action_size, game.roster.names)))

    def get_obs(self, state: State) -> Observations:
        """Return the observation of each agent."""
        columns = (column for seen in self.game.observations(state) if seen is not None for column in seen.T)
        return dict(zip(self.agents, columns, strict=True))

    def _start(self, noise: Noise, random: Random) -> State:
        return self.game.start(noise)

    def _play(
        self, state: State, actions: Mapping[str, Array], noise: Noise, random: Random
    ) -> tuple[State, dict[str, Array], dict[str, Array], dict[str, Array]]:
        game, roster = self.game, self.game.roster
        joint = Actions(
            quality=jnp.stack([actions[name][0] for name in roster.provider_names]),
            ratings=jnp.stack([actions[name][-roster.n_providers :] for name in roster.rater_names]),
        )
        after, rewards = game.step(state, joint, noise)
        over = after.round >= game.scenario.max_cycles
        gone, present = jnp.zeros(len(self.agents), bool), jnp.ones(len(self.agents), bool)
        if state.population is not None and after.population is not None:
            gone, present = after.population.phase > PRESENT, after.population.phase == PRESENT
            rewards, over = jnp.where(state.population.phase == PRESENT, rewards, 0.0), over | ~present.any()
        dones = dict(zip(self.agents, gone | over, strict=True)) | {"__all__": over}
        infos = {"trust": game.agent_trust(after), "present": present}
        return after, dict(zip(self.agents, rewards, strict=True)), dones, infos


class AttackJaxEnv(JaxEnv):
    """An attack task on JAX: one learner, `attacker`, controls the compromised agents, and all others are scripted.

    ## Description, Action Space, Observation Space, Rewards, Starting State, Episode End

    Those of the task's `AttackEnv`, with one agent, `"attacker"`, in every dictionary.

    ## Information

    `objective` and `cost`, see `AttackEnv`, and `caught`: whether all compromised agents are gone for good.

    ## Arguments

    - task_id: One of `TASKS`.
    - **arguments: Arguments of `make_task`, which replace the defaults of the task.

    Raises:
        TypeError: An argument is unknown.
        ValueError: A name is unknown, a value is not allowed, or JAX cannot trace a round.

    ## Version History

    - v0: first version.
    """

    name = "roletrust_attack_v0"

    def __init__(self, task_id: str = "RoleTrust/ProviderAttack-v0", **arguments: Any) -> None:
        refuse_unknown(type(self), arguments, make_task)
        self.task = task_by_id(task_id, {**arguments, "like": jnp.zeros(())})
        self._bounds = self.task.bounds
        super().__init__(self.task.game, ["attacker"], [self.task.action_size])

    def get_obs(self, state: Any) -> Observations:
        """Return the observation of the attacker."""
        return {"attacker": self.task.observe(state)}

    def _start(self, noise: Noise, random: Random) -> Any:
        return self.task.start(noise, random)

    def _play(
        self, state: Any, actions: Mapping[str, Array], noise: Noise, random: Random
    ) -> tuple[Any, dict[str, Array], dict[str, Array], dict[str, Array]]:
        after, outcome = self.task.step(state, actions["attacker"], noise, random)
        done = outcome.caught | outcome.over
        infos = {"objective": outcome.objective, "cost": outcome.cost, "caught": outcome.caught}
        return after, {"attacker": outcome.reward}, {"attacker": done, "__all__": done}, infos


class _KeyRandom(Random):
    """Random numbers of policies, from a key of JAX."""

    def __init__(self, key: Array, like: Array) -> None:
        self.like, self._key, self._calls = like, key, 0

    def uniform(self, shape: Sequence[int]) -> Array:
        """See `Random.uniform`."""
        return jax.random.uniform(self._next(), tuple(shape), self.like.dtype)

    def normal(self, shape: Sequence[int]) -> Array:
        """See `Random.normal`."""
        return jax.random.normal(self._next(), tuple(shape), self.like.dtype)

    def _next(self) -> Array:
        self._calls += 1
        return jax.random.fold_in(self._key, self._calls)


def _without_flags(state: Any) -> Any:
    """Return a state with None in place of flags of Python, which JAX would trace; the rules read None as false."""
    return map_leaves(lambda leaf: leaf if is_array(leaf) else None, state)
