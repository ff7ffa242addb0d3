"""Attack tasks: games for an attacker that controls the compromised agents."""

import copy
from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple, Self, get_args

import numpy as np
from pydantic import ConfigDict, ValidationError
from pydantic.dataclasses import dataclass

from roletrust_env.arrays import Array, namespace
from roletrust_env.errors import suggest, validation_message
from roletrust_env.frozen import Frozen
from roletrust_env.game.attacker_side import AttackerSide, mean_of
from roletrust_env.game.brief import game_facts
from roletrust_env.game.coalition import CoalitionMemory
from roletrust_env.game.consumer import Bought, buy, receive
from roletrust_env.game.game import Game
from roletrust_env.game.joint_policy import JointPolicy
from roletrust_env.game.policy import Policy
from roletrust_env.game.state import Action, Actions, Noise, State
from roletrust_env.game.views import AgentView, ObservationVector, ProviderView, RaterView, view_of
from roletrust_env.parameters import Amount, Share, check_instance
from roletrust_env.randomness import Random
from roletrust_env.shapes import GameFlags, PerGame
from roletrust_env.trees import arrays
from roletrust_env.world.roster import places
from roletrust_env.world.scenario import Choice


@dataclass(frozen=True, config=ConfigDict(extra="forbid", allow_inf_nan=False))
class Stealth:
    """The price of a trust gap between compromised and honest agents, see `AttackTask`.

    Attributes:
        weight: Weight of the cost in the reward, 0 or more.
        tolerance: Trust gap of an agent that costs nothing, in [0, 1].
    """

    weight: Amount = 0.0
    tolerance: Share = 0.1


def make_stealth(price: "Stealth | Mapping[str, float] | None") -> Stealth:
    """Return the price of stealth from its fields.

    Args:
        price: Price, its fields by name, or None for no price.

    Raises:
        ValueError: `price` has another type, or a field is unknown or not allowed.
    """
    if price is None or isinstance(price, Stealth):
        return price or Stealth()
    if not isinstance(price, Mapping):
        raise ValueError(
            f"stealth is {price!r}; it must be a Stealth, or a mapping of its fields weight and "
            "tolerance"
        )
    for name in price:
        if name not in ("weight", "tolerance"):
            raise ValueError(
                f"stealth: there is no field {name!r}{suggest(name, ('weight', 'tolerance'))}"
            )
    try:
        return Stealth(**price)
    except ValidationError as error:
        raise ValueError(f"stealth: {validation_message(error)}") from None


Objective = Literal["damage", "exploit", "promote", "mislead"]
Knowledge = Literal["black_box", "grey_box", "white_box"]
Consumers = Literal["public", "raters", "received"]


class TaskState(NamedTuple):
    """The state of an attack task.

    Attributes:
        game: State of the game.
        memories: Memories of the scripted agents.
        coalition: Memory of the coalition in a `CoalitionTask`; None elsewhere.
    """

    game: State
    memories: tuple[Any, ...]
    coalition: CoalitionMemory | None = None


class Outcome(NamedTuple):
    """The outcome of a round for the attacker, each part of shape (...).

    Attributes:
        reward: Objective less the weighted cost.
        objective: Objective of the round, in [0, 1].
        cost: Mean over the compromised agents of the trust gap to the honest agents beyond the
            tolerance, in [0, 1].
        caught: Whether all compromised agents are gone for good, cut off or left, without
            identities in reserve.
    """

    reward: PerGame
    objective: PerGame
    cost: PerGame
    caught: GameFlags


class AttackTask(Frozen):
    """The game as the control problem of one attacker.

    Args:
        game: Game with its scenario, trust model and array library.
        compromised: Names of the agents that the attacker controls, each once. Their identities in
            reserve belong to the attacker, too; policies use them, but an action does not, see
            `step`.
        objective: Objective of each round, by the trust after the round: `"damage"`, the mean over
            the honest providers of 1 - ToP; `"exploit"`, the mean over the attacker's providers of
            ToP times 1 - delivered quality, which is bad service sold on good trust; for a provider
            with several identities the mean over the present ones; `"promote"`, the same for the
            accomplices; `"mislead"`, the best quality on offer, less the quality that consumers got
            from the provider with the highest trust before the round, see `game.consumer`.
        stealth: Price of a trust gap. The gap of a compromised agent is the mean trust of the
            present honest agents of its role, less its own trust. For an SR+SP agent, and for an
            agent with several identities that have been present, the largest gap counts. The cost
            is the mean over the compromised agents of the gap beyond the tolerance, so that no
            agent hides behind another. An agent that is gone keeps its gap. A role without honest
            agents has no gap. None is free.
        knowledge: Knowledge of the attacker, see `observe`.
        others: Policies of further agents by name; agents that are not named play honestly.
        accomplices: Names of the providers of `"promote"`, compromised or not.
        consumers: Who consumes: the `"public"`, which goes by the published trust; or the honest
            `"raters"` that are present, each of which goes by what it knows, see
            `Game.known_trust`; or these raters by the services that they have `"received"`, in a
            scenario with access by `Choice`, see `game.consumer.receive`.

    Raises:
        ValueError: A name is no agent or occurs twice, an objective lacks its agents, or the name
            of the objective or of the knowledge is unknown.
    """

    # of what a blind choice loses, which `mislead` then does not count, see `with_blind_share`
    blind_share = 0.0

    def __init__(
        self,
        game: Game,
        compromised: Sequence[str],
        *,
        objective: Objective = "damage",
        stealth: Stealth | Mapping[str, float] | None = None,
        knowledge: Knowledge = "black_box",
        others: Mapping[str, Policy] | None = None,
        accomplices: Sequence[str] = (),
        consumers: Consumers = "public",
    ) -> None:
        check_instance("game", game, Game, "a Game; make_task() makes the game of a scenario, too")
        roster = game.roster
        _check_choice("objective", objective, get_args(Objective))
        _check_choice("knowledge", knowledge, get_args(Knowledge))
        _check_choice("consumers", consumers, get_args(Consumers))
        _check_names("compromised", compromised, roster.owner_names)
        _check_names("accomplices", accomplices, roster.provider_names)
        if not compromised:
            raise ValueError("compromised is empty; the attacker must control an agent")
        for name in others or {}:
            if name in compromised:
                raise ValueError(f"agent {name!r} is compromised; others cannot say how it plays")
        self.game = game
        self.compromised = tuple(compromised)
        self.objective = objective
        self.stealth = make_stealth(stealth)
        self.knowledge = knowledge
        self.accomplices = tuple(accomplices)
        self.consumers = consumers
        self.joint_policy = JointPolicy(game, others or {})
        honest = [name for name in roster.names if name not in self.joint_policy.attackers]
        self._side = AttackerSide(roster, self.compromised, honest, game.like)
        self.identities = self._side.identities
        self._raters = places(self.compromised, roster.rater_names)
        self._providers = places(self.compromised, roster.provider_names)
        self._accomplices = places(accomplices, roster.provider_names)
        needed = {
            "damage": ("an honest provider", self._side.honest_providers),
            "exploit": ("a compromised provider", self._providers),
            "promote": ("an accomplice", self._accomplices),
        }
        agents, available = needed.get(objective, ("nobody", [0]))
        if not available:
            raise ValueError(f"the objective {objective!r} needs {agents}, and there is none")
        if consumers != "public" and not self._side.honest_raters:
            raise ValueError("consumers are the honest raters, and there is none")
        if consumers == "received" and not isinstance(game.scenario.access, Choice):
            kind = game.scenario.access.kind
            raise ValueError(f"consumers 'received' need access by choice, got {kind!r}")
        if consumers == "received" and not self._side.honest_providers:
            raise ValueError("consumers 'received' need an honest provider, and there is none")

    def __repr__(self) -> str:
        aim = (
            f"compromised: {' '.join(self.compromised)}, objective: {self.objective}, knowledge: "
            f"{self.knowledge}"
        )
        return f"{type(self).__name__}({game_facts(self.game)}; {aim})"

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and greatest value of an entry of an observation."""
        return (-np.inf, np.inf) if self.knowledge == "white_box" else (0.0, 1.0)

    @property
    def action_size(self) -> int:
        """Size A of an action: for each compromised agent quality, if it provides, then P ratings,
        if it rates.
        """
        return len(self._providers) + self.game.roster.n_providers * len(self._raters)

    def start(self, noise: Noise, random: Random) -> TaskState:
        """Return the state before the first round, for the batch of the noise."""
        memories = self.joint_policy.begin(random, tuple(noise.perception.shape[2:]))
        return self.follow(self.game.start(noise), memories, None)

    def follow(self, game: State, memories: tuple[Any, ...], before: TaskState | None) -> TaskState:
        """Return the state of the task in a state of the game.

        Args:
            game: State of the game.
            memories: Memories of the scripted agents.
            before: State of the task in the round before; None before the first round.
        """
        return TaskState(game, memories)

    def step(
        self, state: TaskState, action: Action | Actions, noise: Noise, random: Random
    ) -> tuple[TaskState, Outcome]:
        """Play one round.

        Args:
            state: State before the round; it is not changed.
            action: Action of shape (A, ...), in [0, 1]; or `Actions` of all agents, of which those
                of the attacker's identities count, on every channel.
            noise: Noise of the round.
            random: Random numbers of the scripted agents.
        """
        actions, memories = self.joint(state, action, random)
        return self.advance(state, actions, memories, noise)

    def joint(
        self, state: TaskState, action: Action | Actions, random: Random
    ) -> tuple[Actions, tuple[Any, ...]]:
        """Return the actions of all agents and the memories of the scripted ones. Arguments as for
        `step`.
        """
        scripted, memories = self.joint_policy.act(state.game, state.memories, random)
        return self._overrule(scripted, action), memories

    def advance(
        self, state: TaskState, actions: Actions, memories: tuple[Any, ...], noise: Noise
    ) -> tuple[TaskState, Outcome]:
        """Play one round with known actions of all agents, see `joint`."""
        after, _ = self.game.step(state.game, actions, noise)
        return self.follow(after, memories, state), self.judge(state.game, actions, after)

    def judge(self, before: State, actions: Actions, after: State) -> Outcome:
        """Return the outcome of a round for the attacker, by the actions and the states before and
        after it.
        """
        game = self.game
        tor, top = game.published(after)
        present = game.present(after)
        raters = providers = None
        if present is not None:
            raters, providers = game.roster.raters(present), game.roster.providers(present)
        if self.objective == "damage":
            objective = mean_of(1 - top, self._side.honest_providers, providers)
        elif self.objective == "mislead":
            bought = self.bought(before, actions, after)
            objective = bought.best - bought.got
            if self.blind_share:
                objective = objective - self.blind_share * (bought.best - bought.blind)
        else:
            sold = top * (1 - after.quality) * after.awaiting.any(axis=0)
            if self.objective == "promote":
                objective = mean_of(sold, self._accomplices, None)
            else:
                objective = self._side.mean_of_sellers(sold, providers)
        phase = None if after.population is None else after.population.phase
        gap = self._side.gap((tor, top), (raters, providers), phase, self.stealth.tolerance)
        cost = namespace(gap).where(gap > 0, gap, 0 * gap).mean(axis=0)
        caught = (
            after.round < 0 if phase is None else self._side.gone(phase)
        )  # without a phase never
        reward = objective - self.stealth.weight * cost
        return Outcome(reward, objective, cost, caught)

    @property
    def options(self) -> dict[str, Any]:
        """Arguments of the constructor beside the game and the compromised agents."""
        return {
            "objective": self.objective,
            "stealth": self.stealth,
            "knowledge": self.knowledge,
            "others": self.joint_policy.policies,
            "accomplices": self.accomplices,
            "consumers": self.consumers,
        }

    def on_library(self, like: Array) -> Self:
        """Return the same task on the library, dtype and device of an array."""
        game = Game(self.game.scenario, self.game.model, like)
        other = type(self)(game, self.compromised, **self.options)
        return other.with_blind_share(self.blind_share)

    def changed(self, **options: Any) -> Self:
        """Return the same task with other values of some of its `options`.

        Raises:
            ValueError: There is no such option, or a value is not allowed.
        """
        known = self.options
        for name in options:
            if name not in known:
                raise ValueError(f"a task has no option {name!r}{suggest(name, known)}")
        other = type(self)(self.game, self.compromised, **{**known, **options})
        return other.with_blind_share(self.blind_share)

    def with_blind_share(self, share: float) -> Self:
        """Return the same task in which `mislead` leaves out a share of what a blind choice loses
        to the best one.

        An attack that makes a blind choice worse, too, then gains less. With the share 1 - s, an
        attack has a positive score if and only if it leaves consumers a lower skill than s, see
        `roletrust_env.metrics.skill`.
        """
        other = copy.copy(self)
        other.__dict__["blind_share"] = share  # nothing else of the task follows from it
        return other

    def bought(self, before: State, actions: Actions, after: State) -> Bought:
        """Return the qualities that consumers got in a round by the trust before it. See
        `Game.offered`.
        """
        if self.consumers == "received":
            return self._received(before, actions, after)
        if self.consumers == "raters":
            return self._bought_by_raters(self.game.known_trust(before), before, actions, after)
        top = self._of_present(self.game.published(before)[1], before)
        return buy(top, self.game.offered(before, actions, after))

    def bought_by_published(self, before: State, actions: Actions, after: State) -> Bought:
        """Return the qualities that the same consumers would have got by published trust. See
        `bought`.
        """
        if self.consumers != "raters" or not hasattr(self.game.model, "judge_trust"):
            return self.bought(before, actions, after)
        known, published = self.game.known_trust(before), self.game.published(before)[1]
        known = namespace(known).where(
            known == known, published, known
        )  # NaN where rater and provider are one agent
        return self._bought_by_raters(known, before, actions, after)

    def _bought_by_raters(
        self, known: Array, before: State, actions: Actions, after: State
    ) -> Bought:
        """Return the mean qualities of the honest raters, each by the trust that it knows, (S, P,
        ...).
        """
        present, xp = self.game.present(before), namespace(known)
        offered = xp.broadcast_to(self.game.offered(before, actions, after), known.shape)
        of_each = buy(self._of_present(known, before), offered, axis=1)
        raters = None if present is None else self.game.roster.raters(present)
        return Bought(*(mean_of(part, self._side.honest_raters, raters) for part in of_each))

    def _received(self, before: State, actions: Actions, after: State) -> Bought:
        """Return the mean qualities that the honest raters received."""
        game, ability = self.game, before.properties.ability
        assert isinstance(game.scenario.access, Choice)
        return receive(
            after.awaiting,
            game.offered(before, actions, after),
            0 * after.quality + 1 if ability is None else ability,
            self._side.honest_raters,
            self._side.honest_providers,
            game.scenario.access.providers,
        )

    def _of_present(self, trust: Array, before: State) -> Array:
        """Return the trust of the providers, (..., P, ...), with NaN where one is absent."""
        present = self.game.present(before)
        return (
            trust
            if present is None
            else namespace(trust).where(self.game.roster.providers(present), trust, np.nan)
        )

    def observe(self, state: TaskState) -> ObservationVector:
        """Return the observation of the attacker, shape (K, ...).

        `black_box`: the observations of its agents, one after the other. `grey_box`: in addition
        the published trust of every rater, S, and of every provider, P. `white_box`: in addition
        the whole state of the game, with the memory of the trust model: every array of `State`,
        flattened, in order.
        """
        game = self.game
        views = game.views(state.game)
        seen = [self._seen(name, state.game, *views) for name in self.compromised]
        if self.knowledge != "black_box":
            seen += game.published(state.game)
        if self.knowledge == "white_box":
            dtype, batch = state.game.ratings.dtype, state.game.round.shape
            xp = namespace(state.game.ratings)
            seen += [xp.astype(leaf, dtype).reshape(-1, *batch) for leaf in arrays(state.game)]
        return namespace(seen[0]).concat(seen)

    def _seen(self, name: str, state: State, providers: ProviderView, raters: RaterView) -> Array:
        """Return the observation of one of its agents, from the views of all providers and
        raters.
        """
        roster, layout = self.game.roster, self.game.layout
        provider = (
            view_of(providers, roster.provider_names.index(name))
            if name in roster.provider_names
            else None
        )
        rater = (
            view_of(raters, roster.rater_names.index(name)) if name in roster.rater_names else None
        )
        if provider is not None and rater is not None:
            trust = self.game.agent_trust(state)[roster.names.index(name)]
            return layout.flatten_both(AgentView(trust, provider, rater))
        if provider is not None:
            return layout.flatten(provider)
        assert rater is not None  # every agent has a role
        return layout.flatten(rater)

    def _overrule(self, scripted: Actions, action: Array | Actions) -> Actions:
        """Return the actions of all agents, with those of the attacker in place of the scripted
        ones.
        """
        if isinstance(action, Actions):
            return self._side.joint(scripted, action)
        xp, roster, p = namespace(action), self.game.roster, self.game.roster.n_providers
        quality, ratings, at = [], [], 0
        for name in self.compromised:
            if name in roster.provider_names:
                quality.append(action[at])
                at += 1
            if name in roster.rater_names:
                ratings.append(action[at : at + p])
                at += p
        return scripted._replace(
            quality=_replace(xp, scripted.quality, self._providers, quality),
            ratings=_replace(xp, scripted.ratings, self._raters, ratings),
        )


def _replace(xp: Any, rows: Array, places: list[int], new: list[Array]) -> Array:
    """Return the rows, with new ones at some indices."""
    if not new:
        return rows
    order = list(range(rows.shape[0]))
    for k, place in enumerate(places):
        order[place] = rows.shape[0] + k
    return xp.concat([rows, xp.stack(new)])[order, ...]


def _check_choice(what: str, value: object, known: Sequence[str]) -> None:
    if value not in known:
        raise ValueError(f"unknown {what} {value!r}{suggest(value, known)}")


def _check_names(what: str, names: Sequence[str], known: Sequence[str]) -> None:
    if isinstance(names, str) or not isinstance(names, Sequence):
        raise ValueError(f"{what} is {names!r}; it must be a sequence of agents' names")
    for name in names:
        if name not in known:
            raise ValueError(f"{what}: there is no {name!r}{suggest(name, known)}")
        if list(names).count(name) > 1:
            raise ValueError(f"{what}: {name!r} stands there twice")
