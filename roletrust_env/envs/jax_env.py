"""Environments as pure functions of JAX, in the form of JaxMARL's `MultiAgentEnv`.

They play the same rules as all other environments: `Game.step` on a third array library.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

import jax
import jax.numpy as jnp
from jax import lax

from roletrust_env import counter_rng
from roletrust_env.arrays import Array
from roletrust_env.envs.arguments import refuse_empty_start, refuse_unknown, space_of
from roletrust_env.envs.attack_env import task_by_id
from roletrust_env.envs.games_last import games_last
from roletrust_env.game.brief import game_facts
from roletrust_env.game.game import Game
from roletrust_env.game.make_task import make_task
from roletrust_env.game.state import Actions, Noise, State
from roletrust_env.randomness import POLICIES, STREAMS, Random, stream_key
from roletrust_env.trust import TrustModel
from roletrust_env.world import Scenario, make_scenario
from roletrust_env.world.presence import PRESENT

Observations: TypeAlias = dict[str, Array]
Step: TypeAlias = tuple[Observations, Any, dict[str, Array], dict[str, Array], dict[str, Array]]
"""Observations, state, rewards, flags of agents that are done, with the key `"__all__"`, and
infos."""


@dataclass(frozen=True)
class JaxBox:
    """A space of arrays, as JaxMARL has it.

    Attributes:
        low: Least value of an entry.
        high: Greatest value of an entry.
        shape: Shape of an array.
    """

    low: float
    high: float
    shape: tuple[int, ...]

    @property
    def dtype(self) -> Any:
        """The dtype of an array: JAX's default precision."""
        return jnp.zeros(()).dtype

    def sample(self, key: Array) -> Array:
        """Return a random array of the space: uniform, or standard normal without bounds.

        Args:
            key: Key of JAX.
        """
        if math.isinf(self.low) or math.isinf(self.high):
            return jax.random.normal(key, self.shape)
        return jax.random.uniform(key, self.shape, minval=self.low, maxval=self.high)

    def contains(self, array: Array) -> Array:
        """Return whether an array is in the space, a boolean of JAX."""
        if jnp.shape(array) != self.shape:
            return jnp.asarray(False)
        return ((array >= self.low) & (array <= self.high)).all()


class JaxEnv(ABC):
    """Base of the environments of JAX: the part that does not depend on who learns.

    `reset` and `step` are pure, so `jax.jit`, `jax.vmap` and `jax.lax.scan` take them. A state is a
    tree of arrays. Actions cannot be refused while JAX traces, so they are clipped to [0, 1], and
    NaN becomes 0. Under `jax.vmap` the rules play all games at once, see `games_last`.

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
        self._begin, self._advance = games_last(self._begin_games), games_last(self._advance_games)
        advance = self._advance_or_begin_games
        self._advance_or_begin = games_last(partial(advance, lax.cond), partial(advance, _always))
        self.action_spaces = {
            agent: JaxBox(0.0, 1.0, (size,)) for agent, size in zip(agents, sizes, strict=True)
        }
        key = jax.random.key(0)
        try:
            seen, state = jax.eval_shape(self.reset, key)
            actions = {agent: jnp.zeros(n) for agent, n in zip(agents, sizes, strict=True)}
            jax.eval_shape(self.step, key, state, actions)
        except (jax.errors.ConcretizationTypeError, jax.errors.TracerArrayConversionError) as error:
            raise ValueError(
                f"JAX cannot trace a round with the trust model {game.model!r}: it branches on "
                "values in Python, or "
                f"leaves JAX ({type(error).__name__}); take another model, or another environment"
            ) from error
        self.observation_spaces = {
            agent: JaxBox(*self._bounds, seen[agent].shape) for agent in agents
        }

    _bounds: tuple[float, float] = (0.0, 1.0)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({game_facts(self.game)})"

    def observation_space(self, agent: str) -> JaxBox:
        """Return the observation space of an agent."""
        return space_of(agent, self.observation_spaces)

    def action_space(self, agent: str) -> JaxBox:
        """Return the action space of an agent."""
        return space_of(agent, self.action_spaces)

    def reset(self, key: Array) -> tuple[Observations, Any]:
        """Begin an episode.

        Args:
            key: Key of JAX.

        Returns:
            The observations and the state.
        """
        begun: tuple[Observations, Any] = self._begin(_words(key))
        return begun

    @property
    @abstractmethod
    def agent_classes(self) -> dict[str, list[str]]:
        """The agents of each class, whose spaces are equal."""

    @abstractmethod
    def get_avail_actions(self, state: Any) -> dict[str, Array]:
        """Return which entries of its action count for each agent, boolean, of the action's
        shape.
        """

    def step(
        self,
        key: Array,
        state: Any,
        actions: Mapping[str, Array],
        reset_state: Any | None = None,
    ) -> Step:
        """Play one round, and begin another episode if this one is over; the observations are then
        those of its start.

        Args:
            key: Key of JAX.
            state: State before the round.
            actions: Action of each agent.
            reset_state: State with which another episode begins; None draws one.

        Raises:
            ValueError: An action is missing or has another shape than its space.
        """
        if reset_state is None:
            played: Step = self._advance_or_begin(_words(key), state, self._checked(actions))
            return played
        _, after, rewards, dones, infos = self.step_env(key, state, actions)
        over = dones["__all__"]
        after = jax.tree.map(lambda new, old: jnp.where(over, new, old), reset_state, after)
        return self.get_obs(after), after, rewards, dones, infos

    def step_env(self, key: Array, state: Any, actions: Mapping[str, Array]) -> Step:
        """Play one round, without another episode after it. See `step`.

        Raises:
            ValueError: An action is missing or has another shape than its space.
        """
        played: Step = self._advance(_words(key), state, self._checked(actions))
        return played

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

    def _over(self, round: Array, random: Random) -> Array:
        """Return whether games are over after their number of rounds, shape (...), some of them at
        random.
        """
        rules = self.game.scenario
        over = round >= rules.max_cycles
        if rules.continuation == 1:
            return over
        return over | (random.uniform((1, *round.shape))[0] >= rules.continuation)

    def _begin_games(self, words: Array) -> tuple[Observations, Any]:
        """Return the observations and the state at the start, for the batch of the keys, words of
        shape (4, ...).
        """
        random = _KeyRandom(words, self.game.like)
        state = self._start(
            self.game.noise(random.round_key(), words.shape[1:], start=True), random
        )
        return self.get_obs(state), state

    def _advance_games(self, words: Array, state: Any, actions: Mapping[str, Array]) -> Step:
        """Play one round, see `_begin_games`."""
        random = _KeyRandom(words, self.game.like)
        clipped = {
            agent: jnp.clip(jnp.nan_to_num(action), 0.0, 1.0) for agent, action in actions.items()
        }
        noise = self.game.noise(random.round_key(), words.shape[1:])
        after, *outcome = self._play(state, clipped, noise, random)
        return self.get_obs(after), after, *outcome

    def _advance_or_begin_games(
        self, condition: Callable[..., Any], words: Array, state: Any, actions: Mapping[str, Array]
    ) -> Step:
        """Play one round, and begin again where it was the last, see `_begin_games`."""
        _, after, rewards, dones, infos = self._advance_games(words, state, actions)
        over = dones["__all__"]

        def begin(after: Any) -> Any:
            _, start = self._begin_games(_mixed(words, 1))
            return jax.tree.map(lambda new, old: jnp.where(over, new, old), start, after)

        after = condition(
            over.any(), begin, lambda after: after, after
        )  # in most rounds no game ends
        return self.get_obs(after), after, rewards, dones, infos

    def _checked(self, actions: Mapping[str, Array]) -> dict[str, Array]:
        """Return the action of each agent, whose shape is known before its values are."""
        if not isinstance(actions, Mapping):
            raise ValueError(
                f"actions are {type(actions).__name__}; they must be a dict from agent to action"
            )
        checked = {}
        for agent in self.agents:
            if agent not in actions:
                raise ValueError(
                    f"the action of {agent!r} is missing; needed are those of "
                    f"{', '.join(self.agents)}"
                )
            action, shape = jnp.asarray(actions[agent]), self.action_spaces[agent].shape
            if action.shape != shape:
                raise ValueError(
                    f"the action of {agent!r} is of shape {action.shape}; it must be of shape "
                    f"{shape}"
                )
            checked[agent] = action
        return checked


class RoleTrustJaxEnv(JaxEnv):
    """The game of `RoleTrustParallelEnv` on JAX: all agents learn.

    ## Description, Action Space, Observation Space, Rewards, Starting State

    Those of `RoleTrustParallelEnv`, but all agents are in `agents` all the time. The reward of an
    absent agent is 0, its actions are ignored, and its observation is what it would see.

    ## Episode End

    An agent is done when it has left or is cut off. All are done after the scenario's `max_cycles`
    steps, with a `continuation` below 1 after each step with probability 1 - `continuation`, and
    when nobody is present any more; `step` then begins another episode.

    ## Information

    `trust`, the trust of every agent by its role, shape (N,); `present`, whether it is present,
    boolean, shape (N,).

    ## Arguments

    - scenario: Name of a preset, path of a TOML or YAML file, or a `Scenario`. The service `hog`
      needs NumPy.
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
        super().__init__(
            game, game.roster.names, list(map(game.roster.action_size, game.roster.names))
        )

    @property
    def agent_classes(self) -> dict[str, list[str]]:
        """The raters (`sr`), the providers (`sp`) and the agents with both roles (`srsp`)."""
        classes: dict[str, list[str]] = {}
        for agent in self.agents:
            classes.setdefault(agent.partition("_")[0], []).append(agent)
        return classes

    def get_avail_actions(self, state: State) -> dict[str, Array]:
        """Return which entries of its action count for each agent: none of an absent agent."""
        present = self.game.present(state)
        return {
            agent: jnp.ones(self.action_spaces[agent].shape, bool)
            & (True if present is None else present[place])
            for place, agent in enumerate(self.agents)
        }

    def get_obs(self, state: State) -> Observations:
        """Return the observation of each agent."""
        seen = (part for part in self.game.observations(state) if part is not None)
        columns = (part[:, i, ...] for part in seen for i in range(part.shape[1]))
        return dict(zip(self.agents, columns, strict=True))

    def _start(self, noise: Noise, random: Random) -> State:
        return self.game.start(noise)

    def _play(
        self, state: State, actions: Mapping[str, Array], noise: Noise, random: Random
    ) -> tuple[State, dict[str, Array], dict[str, Array], dict[str, Array]]:
        game, roster = self.game, self.game.roster
        joint = Actions(
            quality=jnp.stack([actions[name][0] for name in roster.provider_names]),
            ratings=jnp.stack(
                [actions[name][-roster.n_providers :] for name in roster.rater_names]
            ),
        )
        after, rewards = game.step(state, joint, noise)
        over = self._over(after.round, random)
        gone, present = jnp.zeros(rewards.shape, bool), jnp.ones(rewards.shape, bool)
        if state.population is not None and after.population is not None:
            gone, present = after.population.phase > PRESENT, after.population.phase == PRESENT
            rewards, over = (
                jnp.where(state.population.phase == PRESENT, rewards, 0.0),
                over | ~present.any(axis=0),
            )
        dones = dict(zip(self.agents, gone | over, strict=True)) | {"__all__": over}
        infos = {"trust": game.agent_trust(after), "present": present}
        return after, dict(zip(self.agents, rewards, strict=True)), dones, infos


class AttackJaxEnv(JaxEnv):
    """An attack task on JAX: one learner, `attacker`, controls the compromised agents, and all
    others are scripted.

    ## Description, Action Space, Observation Space, Rewards, Starting State, Episode End

    Those of the task's `AttackEnv`, with one agent, `"attacker"`, in every dictionary.

    ## Information

    `objective` and `cost`, see `AttackEnv`, and `caught`: whether all compromised agents are gone
    for good.

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

    @property
    def agent_classes(self) -> dict[str, list[str]]:
        """The attacker, the only agent."""
        return {"attacker": ["attacker"]}

    def get_avail_actions(self, state: Any) -> dict[str, Array]:
        """Return that every entry of the attacker's action counts."""
        return {"attacker": jnp.ones(self.action_spaces["attacker"].shape, bool)}

    def get_obs(self, state: Any) -> Observations:
        """Return the observation of the attacker."""
        return {"attacker": self.task.observe(state)}

    def _start(self, noise: Noise, random: Random) -> Any:
        return self.task.start(noise, random)

    def _play(
        self, state: Any, actions: Mapping[str, Array], noise: Noise, random: Random
    ) -> tuple[Any, dict[str, Array], dict[str, Array], dict[str, Array]]:
        after, outcome = self.task.step(state, actions["attacker"], noise, random)
        done = outcome.caught | self._over(after.game.round, random)
        infos = {"objective": outcome.objective, "cost": outcome.cost, "caught": outcome.caught}
        return after, {"attacker": outcome.reward}, {"attacker": done, "__all__": done}, infos


class _KeyRandom(Random):
    """Random numbers of games with a key each, words of shape (4, ...): as a `Random` with that key
    makes them.
    """

    def __init__(self, words: Array, like: Array) -> None:
        self.like, self._key, self._calls = like, words, 0

    def round_key(self) -> Array:
        """Return the key of the round, words of shape (STREAMS, 4, ...)."""
        return jnp.stack([jnp.stack(stream_key(self._key, stream, 0)) for stream in range(STREAMS)])

    def _numbers(self, distribution: Callable[..., Array], shape: Sequence[int]) -> Array:
        key = [word.reshape(-1) for word in stream_key(self._key, POLICIES, self._calls)]
        self._calls += 1
        games = key[0].size
        agents = math.prod(shape[1:]) // games  # that share a policy
        places = jnp.repeat(counter_rng.counters(self.like, agents), games)
        words = [jnp.tile(word, agents) for word in key]
        return distribution(self.like, shape[0], places, words).reshape(tuple(shape))


def _always(_: Array, begin: Callable[[Any], Any], __: Callable[[Any], Any], after: Any) -> Any:
    """Begin always: JAX has no gradient of a condition that differs from game to game."""
    return begin(after)


def _words(key: Array) -> Array:
    """Return four words that look independent of the two words of a key of JAX, or of the first
    two.
    """
    return _mixed(lax.bitcast_convert_type(jax.random.key_data(key), jnp.int32), 0)


def _mixed(words: Array, number: int) -> Array:
    """Return four words that look independent of two, the first of shape (2, ...); others for
    another number.
    """
    zero = 0 * words[0]
    return jnp.stack(counter_rng.scramble((words[0], words[1], zero + number, zero)))
