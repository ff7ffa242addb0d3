"""The PettingZoo environment in which all agents act at once (parallel)."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import deepcopy
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from gymnasium.spaces import Box
from pettingzoo import ParallelEnv

from roletrust_env.arrays import Array, namespace
from roletrust_env.envs.actions import JointAction
from roletrust_env.envs.arguments import (
    Engine,
    is_compiled,
    option,
    refuse_changeable,
    refuse_empty_start,
    refuse_unknown,
    seed_spaces,
    space_of,
)
from roletrust_env.envs.spectator import RENDERING, RenderMode, Spectator
from roletrust_env.errors import short
from roletrust_env.game.brief import game_facts
from roletrust_env.game.game import Game
from roletrust_env.game.state import State, rateable
from roletrust_env.game.summary import summarise, summary_size
from roletrust_env.randomness import Random, generator
from roletrust_env.trust import TrustModel
from roletrust_env.world import Scenario, make_scenario
from roletrust_env.world.presence import CUT_OFF, LEFT, PRESENT

if TYPE_CHECKING:
    from roletrust_env.compiled import CompiledGame

Vector = npt.NDArray[np.float32]

_FATES = {LEFT: "left", CUT_OFF: "cut off"}

Step: TypeAlias = tuple[
    dict[str, Vector], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
]
"""Observations, rewards, terminations, truncations and infos by the name of the agent."""


class Shown(NamedTuple):
    """What the agents observe in a state, and what their infos hold.

    Attributes:
        round: Number of rounds played, shape ().
        observations: Observations of all agents, one after the other.
        trust: Trust of each agent by its role, shape (N,).
        quality: Quality that each provider delivered in the last round, shape (P,).
        received: True quality of the services that each rater received in it, shape (S, P).
        of_both: ToR and ToP of the SR+SP agents, shape (n_both,) each; None without any.
        phase: Phase of each agent, see `Population`, shape (N,); None where all are always present.
    """

    round: Array
    observations: Array
    trust: Array
    quality: Array
    received: Array
    of_both: tuple[Array, Array] | None
    phase: Array | None


class Observer:
    """Makes the observations of single agents.

    Args:
        game: Game that is observed.
    """

    def __init__(self, game: Game) -> None:
        roster = game.roster
        s, p = roster.n_raters, roster.n_providers
        self._game = game
        size = 1 + s + 3 * p + 4 * s * p
        of_raters, of_providers = game.layout.places()
        provider = dict(zip(roster.provider_names, of_providers.T, strict=True))
        rater = dict(zip(roster.rater_names, of_raters.T, strict=True))
        seen: dict[str, list[npt.NDArray[np.intp]]] = {agent: [] for agent in roster.names}
        for i, agent in enumerate(
            agent for agent in roster.names if agent in provider and agent in rater
        ):
            seen[agent].append(np.asarray([size + i]))
        for agent, places in [*provider.items(), *rater.items()]:
            seen[agent].append(places)
        self._places = np.concatenate([part for parts in seen.values() for part in parts])
        ends = np.cumsum([sum(map(len, parts)) for parts in seen.values()]).tolist()
        self._slices = {
            agent: slice(*cut) for agent, cut in zip(seen, pairwise([0, *ends]), strict=True)
        }

    def show(self, state: State) -> Shown:
        """Return what all agents observe in a state of one game, and what their infos hold."""
        game, both = self._game, self._game.roster.both
        published, trust = game.published(state), game.agent_trust(state)
        has_both = game.roster.n_both > 0
        parts = (
            (state.round / game.scenario.max_cycles).reshape(1),
            *published,
            state.value,
            state.quality,
            *(grid.reshape(-1) for grid in rateable(state)),
            *(grid.reshape(-1) for grid in (state.ratings, state.rated)),
            *((trust[-game.roster.n_both :],) if has_both else ()),
        )
        return Shown(
            round=state.round,
            observations=namespace(trust).concat(parts)[self._places],
            trust=trust,
            quality=state.quality,
            received=state.quality * state.awaiting,
            of_both=(both(published[0]), both(published[1])) if has_both else None,
            phase=None if state.population is None else state.population.phase,
        )

    def split(self, observations: Array, agents: Sequence[str]) -> dict[str, Vector]:
        """Return the observations of some agents, as new arrays, from those of all, see
        `show`.
        """
        single, slices = observations.astype(np.float32), self._slices
        return {agent: single[slices[agent]] for agent in agents}


class RoleTrustParallelEnv(ParallelEnv[str, Vector, Vector]):
    """A population of agents that provide services to one another, rate them, and are trusted
    accordingly.

    ## Description

    Service providers (SP) choose the quality of their services; service raters (SR) receive them
    and choose ratings; a trust model turns the ratings into the trust of raters (ToR) and of
    providers (ToP), after Su and Saint-Jore (EWSN 2023). An agent with both roles (SR+SP) has a
    ToA. Both roles act at once, so the ratings of a step are for the services of the step before;
    on the first step there is nothing to rate.

    ## Action Space

    A `Box(0, 1, ...)` of float32 for each agent, with P providers in the scenario. Lists, CPU
    tensors and other shapes of the same size are accepted:

    | agent | shape | action |
    |---|---|---|
    | `sp_0 ...` | (1,) | quality of its service; it delivers its ability times that |
    | `sr_0 ...` | (P,) | its rating of each provider; ratings of providers that did not serve it are ignored |
    | `srsp_0 ...` | (1 + P,) | quality first, then ratings; its rating of itself is ignored |

    ## Observation Space

    A `Box(0, 1, ...)` of float32 for each agent, with S raters and P providers in the scenario. A
    provider (4 + 2 S):

    | num | observation | min | max |
    |---|---|---|---|
    | 0 | clock: share of the rounds that have been played | 0 | 1 |
    | 1 | own ToP | 0 | 1 |
    | 2 | value of the next service, as a share of the dearest | 0 | 1 |
    | 3 | quality of its last service, not rated yet | 0 | 1 |
    | 4 ... 3+S | ratings of it that arrived in the last step, 0 where none did | 0 | 1 |
    | 4+S ... 3+2S | 1 where one arrived | 0 | 1 |

    A rater (2 + 5 P):

    | num | observation | min | max |
    |---|---|---|---|
    | 0 | clock | 0 | 1 |
    | 1 | own ToR | 0 | 1 |
    | 2 ... 1+P | published ToP of each provider | 0 | 1 |
    | 2+P ... 1+2P | perceived quality of the services that await its rating, 0 elsewhere | 0 | 1 |
    | 2+2P ... 1+3P | 1 where a service awaits its rating | 0 | 1 |
    | 2+3P ... 1+4P | its ratings that arrived in the last step, 0 where none did | 0 | 1 |
    | 2+4P ... 1+5P | 1 where one arrived | 0 | 1 |

    An SR+SP agent: its ToA, then the provider's entries, then the rater's. `layout` splits an
    observation into named fields.

    ## Rewards

    SR: ToR. SP: ToP less the cost of the quality that it delivered (cost x value x quality). SR+SP:
    ToA less that cost. The weights are the scenario's `rewards`.

    ## Starting State

    Every agent has the scenario's `initial_trust`, and there are no services and no ratings yet.
    Positions, values, presence, abilities, biases and scales are drawn where the scenario has them.

    ## Episode End

    All agents are truncated after the scenario's `max_cycles` steps. With a `continuation` below 1
    all are terminated after each step with probability 1 - `continuation`; no observation tells
    when. An agent is terminated when it leaves or when admission control cuts it off, both for
    good. Agents that join later are then added to `agents`. The episode is also over when no agent
    is present any more, even if others would have joined later: PettingZoo has no step without
    agents. Identities in reserve stay absent, since no action of PettingZoo brings them in.

    ## Information

    The infos are for analysis and are never in observations: `trust`; a provider's delivered
    `quality`; a rater's `received`, the true quality of each provider's last service, shape (P,);
    an SR+SP agent's `rater_trust` and `provider_trust`; and the `fate`, `"left"` or `"cut off"`, of
    an agent that is terminated.

    ## Arguments

    See `parallel_env`.

    ## Version History

    - v0: first version.
    """  # noqa: E501

    metadata: dict[str, Any] = {  # noqa: RUF012 - as PettingZoo has it
        "name": "roletrust_v0",
        "is_parallelizable": True,
        **RENDERING,
    }

    def __init__(
        self,
        scenario: str | Path | Scenario = "paper-3x3",
        trust_model: str | TrustModel[Any] = "role-trust",
        render_mode: RenderMode | None = None,
        engine: Engine = "rules",
        **changes: Any,
    ) -> None:
        refuse_unknown(type(self), changes)
        scenario = make_scenario(scenario)
        self.game = Game(scenario.change(**changes) if changes else scenario, trust_model)
        refuse_empty_start(self.game.scenario)
        self.engine = engine
        self._compiled = compile_game(self.game) if is_compiled(engine) else None
        self.layout = layout = self.game.layout
        self.render_mode = render_mode
        self.metadata = deepcopy(self.metadata)  # wrappers add render modes
        self._spectator = Spectator(self.game, render_mode)
        self.possible_agents = list(self.game.roster.names)
        names, roster = self.possible_agents, self.game.roster
        n_sr, n_alone = len(names) - roster.n_providers, len(names) - roster.n_both
        self._by_role = names[:n_sr], names[n_sr:n_alone], names[n_alone:]  # SR, SP, SR+SP
        self.agents: list[str] = []
        self.attackers: tuple[str, ...] = ()
        sizes = {
            "SR": layout.rater_size,
            "SP": layout.provider_size,
            "SR+SP": 1 + layout.provider_size + layout.rater_size,
        }
        self.observation_spaces: dict[str, Box] = {}
        self.action_spaces: dict[str, Box] = {}
        for agent in self.possible_agents:
            self.observation_spaces[agent] = Box(
                0.0, 1.0, (sizes[self.game.roster.role(agent)],), np.float32
            )
            self.action_spaces[agent] = Box(
                0.0, 1.0, (self.game.roster.action_size(agent),), np.float32
            )
        self.joint = JointAction(self.game.roster)
        self._observer = Observer(self.game)
        self.state_space = Box(0.0, 1.0, (summary_size(self.game),), np.float32)
        self.np_random: np.random.Generator | None = None
        self._random: Random | None = None
        self._end = self._length = 0
        self._played: State | None = None  # by the rules; the compiled engine has its own

    def __repr__(self) -> str:
        engine = "" if self._compiled is None else f", engine: {self.engine}"
        return f"{type(self).__name__}({game_facts(self.game)}{engine})"

    def _repr_html_(self) -> str:
        return self._spectator.html(repr(self), self._state)

    def observation_space(self, agent: str) -> Box:
        """Return the observation space of an agent, the same object at each call.

        Raises:
            ValueError: There is no such agent.
        """
        return space_of(agent, self.observation_spaces)

    def action_space(self, agent: str) -> Box:
        """Return the action space of an agent, the same object at each call.

        Raises:
            ValueError: There is no such agent.
        """
        return space_of(agent, self.action_spaces)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Vector], dict[str, dict[str, Any]]]:
        """Begin a new episode.

        Args:
            seed: Random seed of the episode; None continues the random numbers of the last episode.
            options: `{"attackers": names}` marks those agents in renderings. Other keys are
                ignored.

        Returns:
            The observations and infos of the agents that are present.

        Raises:
            ValueError: A name in `attackers` is no agent of the scenario, or the seed is no whole
                number, 0 or more.
        """
        attackers = option(options, "attackers")
        attackers = () if attackers is None else attackers
        if isinstance(attackers, str) or not isinstance(attackers, Iterable):
            raise ValueError(
                f"attackers is {short(repr(attackers))}; it must be a sequence of agents' names"
            )
        attackers = tuple(attackers)
        for name in attackers:
            if name not in self.possible_agents:
                raise ValueError(
                    f"there is no agent {short(repr(name))} to mark; there are "
                    f"{', '.join(self.possible_agents)}"
                )
        if seed is not None or self._random is None:
            self.np_random = generator(seed)
            self._random = Random(self.np_random)
        seed_spaces(self.action_spaces, seed)
        self.attackers = self._spectator.attackers = attackers
        state = self.game.start(self.game.draw(self._random, start=True))
        self._end = int(self.game.random_end(self._random))
        self._length = min(self._end, self.game.scenario.max_cycles)
        if self._compiled is not None:
            self._compiled.begin(state)
        self._played = state
        present = self.game.present(state)
        self.agents = [
            a for i, a in enumerate(self.possible_agents) if present is None or present[i]
        ]
        if self.render_mode is not None:
            self._spectator.follow(state)
        shown = self._observer.show(state)
        observations = self._observer.split(shown.observations, self.agents)
        return observations, self._inform(shown, self.agents)

    def step(self, actions: Mapping[str, Vector]) -> Step:
        """Play one round.

        Args:
            actions: An action for each agent in `agents`, and for no other agent.

        Returns:
            Observations, rewards, terminations, truncations and infos of the agents that acted and
            of newcomers. They are empty if the episode is over and there are no actions.

        Raises:
            ValueError: An action is missing, belongs to an absent agent, has the wrong size, or
                holds NaN or a value outside [0, 1]. Nothing has changed then.
            RuntimeError: `reset` was not called, or the episode is over.
        """
        if self._random is None or not self.agents:
            if self._random is not None and actions == {}:
                return {}, {}, {}, {}, {}
            raise RuntimeError("call reset() before step(): there is no episode, or it is over")
        return self.advance(self.joint.read(actions, self.agents))

    def advance(self, joint: npt.NDArray[np.float64]) -> Step:
        """Play one round with actions that are checked already, see `JointAction`. Returns what
        `step` returns.
        """
        rewards, shown = self._play(joint)
        round, acted = int(shown.round), self.agents
        over = round >= self._length
        if shown.phase is None:
            agents = staying = acted
            reward = dict(zip(agents, rewards.tolist(), strict=True))
            terminations = dict.fromkeys(agents, False)
        else:
            phases = dict(zip(self.possible_agents, shown.phase.tolist(), strict=True))
            earned = dict(zip(self.possible_agents, rewards.tolist(), strict=True))
            agents = [
                agent
                for agent in self.possible_agents
                if agent in acted or (phases[agent] == PRESENT and not over)
            ]
            reward = {agent: earned[agent] if agent in acted else 0.0 for agent in agents}
            terminations = {agent: phases[agent] != PRESENT for agent in agents}
            staying = [agent for agent in agents if not terminations[agent]]
        if over and round >= self._end:
            terminations = dict.fromkeys(agents, True)
        truncations = dict.fromkeys(agents, False)
        if over:
            truncations = {agent: not terminations[agent] for agent in agents}
        self.agents = [] if over else list(staying)
        if self.render_mode is not None:
            self._spectator.follow(self._current())
        observations = self._observer.split(shown.observations, agents)
        return observations, reward, terminations, truncations, self._inform(shown, agents)

    def state(self) -> Vector:
        """Return the whole state as a vector in `state_space`, for centralised critics; see
        `Game.summary`.
        """
        state = self._state
        if state is None:
            raise RuntimeError("call reset() before state(): there is no episode")
        summary: Vector = summarise(self.game, state).astype(np.float32)
        return summary

    def render(self) -> npt.NDArray[np.uint8] | str | None:
        """Show the state of the game by `render_mode`: a picture, text, or a window (None)."""
        return self._spectator.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        self._spectator.close()

    def _play(self, joint: npt.NDArray[np.float64]) -> tuple[Array, Shown]:
        """Play one round, and return the rewards, shape (N,), and what is shown of the state."""
        assert self._random is not None  # there is an episode
        assert self._played is not None
        if self._compiled is not None:
            played: tuple[Array, Shown] = self._compiled.play(joint, self._random.round_key())
            return played
        noise = self.game.draw(self._random)
        self._played, rewards = self.game.step(self._played, self.joint.split(joint), noise)
        return rewards, self._observer.show(self._played)

    @property
    def _state(self) -> State | None:
        """The state of the game; None before the first episode."""
        return None if self._played is None else self._current()

    def _current(self) -> State:
        assert self._played is not None  # there is an episode
        state: State = self._played if self._compiled is None else self._compiled.state
        return state

    def _inform(self, shown: Shown, agents: Sequence[str]) -> dict[str, dict[str, Any]]:
        """Return the infos of some agents."""
        sr, sp, both = self._by_role
        trust, quality = shown.trust.tolist(), shown.quality.tolist()
        received = [*shown.received.copy()]  # the compiled engine writes to it in the next round
        infos: dict[str, dict[str, Any]] = {
            agent: {"trust": value, "received": row}
            for agent, value, row in zip(sr, trust, received, strict=False)
        }
        for agent, value, delivered in zip(sp, trust[len(sr) :], quality, strict=False):
            infos[agent] = {"trust": value, "quality": delivered}
        if shown.of_both is not None:
            of_both = {
                "trust": trust[len(sr) + len(sp) :],
                "received": received[len(sr) :],
                "rater_trust": shown.of_both[0].tolist(),
                "provider_trust": shown.of_both[1].tolist(),
                "quality": quality[len(sp) :],
            }
            for k, agent in enumerate(both):
                infos[agent] = {name: column[k] for name, column in of_both.items()}
        if shown.phase is None:
            return infos
        for agent, phase in zip(self.possible_agents, shown.phase.tolist(), strict=True):
            if phase in _FATES:
                infos[agent]["fate"] = _FATES[phase]
        return {agent: infos[agent] for agent in agents}


def compile_game(game: Game) -> "CompiledGame":
    """Return the rounds of a game in the compiled engine.

    Raises:
        ValueError: The engine cannot play the game, or is not installed. The message says why.
    """
    from roletrust_env.compiled import CompiledGame, Program

    refuse_changeable([game.model])

    def make(like: Array) -> Callable[..., tuple[State, tuple[Array, Shown]]]:
        recorded = Game(game.scenario, game.model, like)
        joint_action, observer = JointAction(recorded.roster), Observer(recorded)

        def play(
            state: State, joint: Array, key: Array, random: Random
        ) -> tuple[State, tuple[Array, Shown]]:
            noise = recorded.noise(key)
            after, rewards = recorded.step(state, joint_action.split(joint), noise)
            return after, (rewards, observer.show(after))

        return play

    random = game.random(0)
    state = game.start(game.draw(random, start=True))
    joint = np.zeros(sum(map(game.roster.action_size, game.roster.names)))
    return CompiledGame(Program.record(make, state, (joint, random.round_key())))


def parallel_env(
    scenario: str | Path | Scenario = "paper-3x3",
    trust_model: str | TrustModel[Any] = "role-trust",
    render_mode: RenderMode | None = None,
    engine: Engine = "rules",
    **changes: Any,
) -> RoleTrustParallelEnv:
    """Return the game as a PettingZoo parallel environment, in which all agents act at once.

    Args:
        scenario: Name of a preset (`roletrust list`), path of a TOML or YAML file, or a `Scenario`.
        trust_model: Name of a trust model, or a trust model.
        render_mode: `"human"`, `"rgb_array"`, `"ansi"` or None.
        engine: `"rules"`, or `"compiled"`, which plays the same rounds faster, to the rounding of
            float64; see `roletrust_env.compiled`.
        **changes: Other values of fields of the scenario, such as `max_cycles=50`, `lam=0.7` or
            `noise=0.0`.

    Raises:
        TypeError: An argument is unknown, and no field of a scenario.
        ValueError: A name is unknown, a file cannot be read, a value is not allowed, or the
            compiled engine cannot play the game.

    Example:
        >>> env = parallel_env("paper-3x3", max_cycles=50)
        >>> observations, infos = env.reset(seed=1)
        >>> env.agents
        ['sr_0', 'sr_1', 'sr_2', 'sp_0', 'sp_1', 'sp_2']
    """
    return RoleTrustParallelEnv(scenario, trust_model, render_mode, engine, **changes)
