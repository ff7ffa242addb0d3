"""One attacker's side of a game: compromised agents act as one mind, everybody else is scripted.

The Gymnasium tasks, their batches, the searchers and the planner all play this. It owns the objectives, the price of
being told apart and what an attacker may know, and is as pure and as batched as the game itself.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from roletrust_env.arrays import Array, namespace
from roletrust_env.errors import suggest
from roletrust_env.game.attacker_side import AttackerSide, mean_of, places
from roletrust_env.game.brief import game_facts
from roletrust_env.game.consumer import Bought, buy
from roletrust_env.game.game import Game
from roletrust_env.game.joint_policy import JointPolicy
from roletrust_env.game.policy import Policy
from roletrust_env.game.state import Actions, Noise, State
from roletrust_env.game.stealth import Stealth, make_stealth
from roletrust_env.game.views import AgentView, ProviderView, RaterView, view_of
from roletrust_env.randomness import Random
from roletrust_env.trust import TrustModel
from roletrust_env.world import Scenario, make_scenario

Objective = Literal["damage", "exploit", "promote", "mislead"]
Knowledge = Literal["black_box", "grey_box", "white_box"]


class TaskState(NamedTuple):
    """The state of the game, and what the scripted agents remember."""

    game: State
    memories: tuple[Any, ...]


class Outcome(NamedTuple):
    """What one round brought the attacker, each of shape (...).

    Attributes:
        reward: the objective less the weighted cost.
        objective: of the round, in [0, 1].
        cost: how far each compromised agent's trust is below that of the honest ones, beyond the tolerance; the mean
            over the agents, in [0, 1], unweighted.
        caught: whether all its agents are gone for good, cut off or left, and no identity of theirs waits in reserve.
        over: whether the game has reached its length.
    """

    reward: Array
    objective: Array
    cost: Array
    caught: Array
    over: Array


class AttackTask:
    """The game as the control problem of one attacker.

    Args:
        game: its scenario, its trust model and its array library.
        compromised: names of the agents that the attacker controls, each once. Their identities in reserve are its own,
            too; an action has no say over them, but policies have, see `step`.
        objective: what each round brings, after the trust of the round has been updated:
            `"damage"`, the mean over the honest providers of 1 - ToP;
            `"exploit"`, the mean over its own providers of the published ToP at which a service was sold times 1 - the
            quality delivered: bad service sold on good trust; of one with several identities the mean over those that
            are there;
            `"promote"`, the same for the accomplices;
            `"mislead"`, the best quality that was there, less what a consumer got that went to the provider with the
            highest ToP published before, see `game.consumer`.
        stealth: the price of being told apart. The gap of a compromised agent is the mean trust of the honest agents of
            its role that are there, less its own trust; of an agent with both roles, or with several identities that
            have ever been there, the largest one. It costs what is
            beyond the tolerance, and the cost is the mean over the compromised agents: none hides behind another. All
            of them count, there or not, by the trust that is published: who is gone stays as far apart as it went. A
            role without honest agents has no gap. None is free.
        knowledge: what it sees, see `observe`.
        others: agent's name -> policy of agents that are not compromised; those not named play honestly.
        accomplices: names of the providers that `"promote"` is for, compromised or not.

    Raises:
        ValueError: a name is no agent or stands twice, an objective lacks the agents that it is about, or the name of
            the objective or of the knowledge is unknown.
    """

    def __init__(
        self,
        game: Game,
        compromised: Sequence[str],
        *,
        objective: Objective = "damage",
        stealth: Stealth | None = None,
        knowledge: Knowledge = "black_box",
        others: Mapping[str, Policy] | None = None,
        accomplices: Sequence[str] = (),
    ) -> None:
        roster = game.roster
        _check_choice("objective", objective, get_args(Objective))
        _check_choice("knowledge", knowledge, get_args(Knowledge))
        _check_names("compromised", compromised, roster.first_names)
        _check_names("accomplices", accomplices, roster.provider_names)
        if not compromised:
            raise ValueError("compromised is empty; the attacker must control an agent")
        for name in others or {}:
            if name in compromised:
                raise ValueError(f"agent {name!r} is compromised; others cannot say how it plays")
        self.game = game
        self.compromised = tuple(compromised)
        self.objective = objective
        self.stealth = stealth or Stealth()
        self.knowledge = knowledge
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
        whom, there = needed.get(objective, ("nobody", [0]))
        if not there:
            raise ValueError(f"the objective {objective!r} needs {whom}, and there is none")

    def __repr__(self) -> str:
        aim = f"compromised: {' '.join(self.compromised)}, objective: {self.objective}, knowledge: {self.knowledge}"
        return f"{type(self).__name__}({game_facts(self.game)}; {aim})"

    @property
    def action_size(self) -> int:
        """A: for each compromised agent in turn its quality, if it provides, then its P ratings, if it rates."""
        return len(self._providers) + self.game.roster.n_providers * len(self._raters)

    def start(self, noise: Noise, random: Random) -> TaskState:
        """The state before the first round, for the batch of the noise."""
        return TaskState(self.game.start(noise), self.joint_policy.begin(random, tuple(noise.perception.shape[2:])))

    def step(
        self, state: TaskState, action: Array | Actions, noise: Noise, random: Random
    ) -> tuple[TaskState, Outcome]:
        """Play one round.

        Args:
            state: before the round; it is left as it is.
            action: shape (A, ...), in [0, 1]; or all agents' `Actions`, of which those of the attacker's identities
                count, on every channel.
            noise: the luck of the round.
            random: for scripted agents that play at random.
        """
        actions, memories = self.joint(state, action, random)
        return self.advance(state, actions, memories, noise)

    def joint(self, state: TaskState, action: Array | Actions, random: Random) -> tuple[Actions, tuple[Any, ...]]:
        """What all agents do, and what the scripted ones remember. Arguments as for `step`."""
        scripted, memories = self.joint_policy.act(state.game, state.memories, random)
        return self._overrule(scripted, action), memories

    def advance(
        self, state: TaskState, actions: Actions, memories: tuple[Any, ...], noise: Noise
    ) -> tuple[TaskState, Outcome]:
        """Play one round in which it is known what all agents do, see `joint`."""
        after, _ = self.game.step(state.game, actions, noise)
        return TaskState(after, memories), self.judge(state.game, actions, after)

    def judge(self, before: State, actions: Actions, after: State) -> Outcome:
        """What a round brought the attacker in which all agents did this, by the states before and after it."""
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
        else:
            sold = top * (1 - after.quality) * after.awaiting.any(axis=0)
            if self.objective == "promote":
                objective = mean_of(sold, self._accomplices, None)
            else:
                objective = self._side.mean_of_sellers(sold, providers)
        phase = None if after.population is None else after.population.phase
        gap = self._side.gap((tor, top), (raters, providers), phase, self.stealth.tolerance)
        cost = namespace(gap).where(gap > 0, gap, 0 * gap).mean(axis=0)
        caught = after.round < 0 if phase is None else self._side.gone(phase)  # without a phase never
        over = after.round >= game.scenario.max_cycles
        reward = objective - self.stealth.weight * cost
        return Outcome(reward, objective, cost, caught, over)

    def bought(self, before: State, actions: Actions, after: State) -> Bought:
        """What consumers got in a round who went by the trust published before it. See `Game.offered`."""
        game = self.game
        top, present = game.published(before)[1], game.present(before)
        if present is not None:
            top = namespace(top).where(game.roster.providers(present), top, np.nan)
        return buy(top, game.offered(before, actions, after))

    def observe(self, state: TaskState) -> Array:
        """What the attacker sees, shape (K, ...).

        `black_box`: what its agents would see in life, the observation of each in turn. `grey_box`: in addition the
        published trust of every rater, S, and of every provider, P. `white_box`: in addition the whole state of the
        game, the trust model's own memory included: every array of `State`, flattened, in its order.
        """
        game = self.game
        views = game.views(state.game)
        seen = [self._seen(name, state.game, *views) for name in self.compromised]
        if self.knowledge != "black_box":
            seen += game.published(state.game)
        if self.knowledge == "white_box":
            dtype, batch = state.game.ratings.dtype, state.game.round.shape
            xp = namespace(state.game.ratings)
            seen += [xp.astype(leaf, dtype).reshape(-1, *batch) for leaf in leaves(state.game)]
        return namespace(seen[0]).concat(seen)

    def _seen(self, name: str, state: State, providers: ProviderView, raters: RaterView) -> Array:
        """The observation of one of its agents, of what all providers and all raters see."""
        roster, layout = self.game.roster, self.game.layout
        provider = view_of(providers, roster.provider_names.index(name)) if name in roster.provider_names else None
        rater = view_of(raters, roster.rater_names.index(name)) if name in roster.rater_names else None
        if provider is not None and rater is not None:
            trust = self.game.agent_trust(state)[roster.names.index(name)]
            return layout.flatten_both(AgentView(trust, provider, rater))
        if provider is not None:
            return layout.flatten(provider)
        assert rater is not None  # every agent has a role
        return layout.flatten(rater)

    def own_action(self, actions: Actions) -> Array:
        """What the compromised agents do among all agents' actions, as an action of the task, (A, ...)."""
        roster, parts = self.game.roster, []
        for name in self.compromised:
            if name in roster.provider_names:
                parts.append(actions.quality[roster.provider_names.index(name)][None, ...])
            if name in roster.rater_names:
                parts.append(actions.ratings[roster.rater_names.index(name)])
        return namespace(parts[0]).concat(parts)

    def _overrule(self, scripted: Actions, action: Array | Actions) -> Actions:
        """The joint action: that of the attacker's agents in place of what the script has for them."""
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


def make_task(
    scenario: str | Path | Scenario,
    compromised: Sequence[str],
    *,
    trust_model: str | TrustModel[Any] = "role-trust",
    objective: Objective = "damage",
    stealth: Stealth | Mapping[str, float] | None = None,
    knowledge: Knowledge = "black_box",
    others: Mapping[str, Policy] | None = None,
    accomplices: Sequence[str] = (),
    like: Array | None = None,
    **changes: Any,
) -> AttackTask:
    """Make an attack task.

    Args:
        scenario: the name of a preset, the path of a TOML or YAML file, or a `Scenario`.
        compromised: names of the agents that the learner controls.
        trust_model: the name of a trust model, or a model.
        objective: `"damage"`, `"exploit"`, `"promote"` or `"mislead"`, see `AttackTask`.
        stealth: `{"weight": ..., "tolerance": ...}`, the price of being told apart; None is free.
        knowledge: `"black_box"`, `"grey_box"` or `"white_box"`, see `AttackTask.observe`.
        others: agent's name -> policy of agents that are neither compromised nor honest.
        accomplices: the providers that `"promote"` is for.
        like: an array of the library, dtype and device to play with; by default NumPy's float32.
        **changes: other values of the scenario's fields, such as `max_cycles=200` or `noise=0.0`.

    Raises:
        ValueError: a name is unknown or a value is not allowed.
    """
    scenario = make_scenario(scenario)
    scenario = scenario.change(**changes) if changes else scenario
    game = Game(scenario, trust_model, np.zeros((), np.float32) if like is None else like)
    return AttackTask(
        game,
        compromised,
        objective=objective,
        stealth=make_stealth(stealth),
        knowledge=knowledge,
        others=others,
        accomplices=accomplices,
    )


def leaves(tree: Any) -> list[Array]:
    """The arrays of nested tuples, in order; None, and facts of all games, count for nothing."""
    if tree is None or isinstance(tree, bool):
        return []
    return [leaf for part in tree for leaf in leaves(part)] if isinstance(tree, tuple) else [tree]


def _replace(xp: Any, rows: Array, places: list[int], new: list[Array]) -> Array:
    """The rows, with new ones in some places."""
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
