"""The game: the transition from one round to the next, pure and batched.

One round is: ratings arrive -> trust -> presence -> services -> rewards. Providers and raters act
at once. So the ratings of a round are for the services of the round before, and on the first step
there is nothing to rate.

Random numbers are drawn outside and passed in. So a planner cannot foresee the noise, and one game
and a batch of games can have the same noise.
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

import numpy as np

from roletrust_env.arrays import Array, cast, copy, mean_or_zero, namespace, whole_dtype
from roletrust_env.frozen import Frozen
from roletrust_env.game.brief import game_facts
from roletrust_env.game.cells import Cells, for_batch
from roletrust_env.game.noise import NoiseSource
from roletrust_env.game.policy import Policy
from roletrust_env.game.state import (
    Actions,
    Counts,
    Noise,
    State,
    fitted,
    intended,
    rateable,
)
from roletrust_env.game.views import ProviderView, RaterView, ViewLayout, make_views
from roletrust_env.randomness import Random, generator
from roletrust_env.shapes import (
    AgentFlags,
    PairFlags,
    PerAgent,
    PerPair,
    PerProvider,
    PerRater,
    Shape,
)
from roletrust_env.trust import TrustModel, agent_trust
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.world import access, mobility, rating_delivery
from roletrust_env.world.heterogeneity import AgentPropertySampler
from roletrust_env.world.presence import PRESENT, Population, Presence
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Choice, Everyone, InRange, Scenario
from roletrust_env.world.service import Perturbations, make_service


class Payoff:
    """The values of services, and the rewards of agents.

    Args:
        scenario: Scenario with the values and the weights.
        roster: Agents of the scenario.
        like: Array of the library, dtype and device to work with.
    """

    def __init__(self, scenario: Scenario, roster: Roster, like: Array) -> None:
        self._weights, self._initial, self._roster = (
            scenario.rewards,
            scenario.initial_trust,
            roster,
        )
        self._values = None
        if len(set(scenario.values)) > 1:
            shares = np.asarray(scenario.values) / max(scenario.values)
            self._values = namespace(like).asarray(shares, dtype=like.dtype, device=like.device)
        self._cost = scenario.rewards.quality_cost * max(scenario.values)

    def next_value(self, value: PerProvider, noise: PerProvider | None) -> PerProvider:
        """Return the value of the next service of each provider, shape (P, ...), relative to the
        highest value.
        """
        if self._values is None or noise is None:
            return value
        return self._values[cast(noise * len(self._values), whole_dtype(noise))]

    def rewards(
        self,
        tor: PerRater,
        top: PerProvider,
        counts: Counts | None,
        quality: PerProvider,
        value: PerProvider,
    ) -> PerAgent:
        """Return the rewards, shape (N, ...).

        Args:
            tor: Trust of the raters, shape (S, ...).
            top: Trust of the providers, shape (P, ...).
            counts: Services that SR+SP agents rated and provided; None without such agents.
            quality: Delivered quality, shape (P, ...).
            value: Value of the services, shape (P, ...).
        """
        costs = self._cost * quality if self._values is None else self._cost * value * quality
        weights, roster = self._weights, self._roster
        of_both = None
        if counts is not None:
            of_both = weights.agent_trust * self._both_trust(tor, top, counts) - roster.both(costs)
        of_raters = tor if weights.rater_trust == 1 else weights.rater_trust * tor
        of_providers = top if weights.provider_trust == 1 else weights.provider_trust * top
        return self._of_agents(of_raters, of_providers - costs, of_both)

    def agent_trust(self, tor: PerRater, top: PerProvider, counts: Counts | None) -> PerAgent:
        """Return the trust of every agent by its role, shape (N, ...)."""
        toa = None if counts is None else self._both_trust(tor, top, counts)
        return self._of_agents(tor, top, toa)

    def _both_trust(self, tor: Array, top: Array, counts: Counts) -> Array:
        both = self._roster.both
        return agent_trust(
            both(tor),
            both(top),
            rated=counts.rated,
            provided=counts.provided,
            initial=self._initial,
        )

    def _of_agents(self, of_raters: Array, of_providers: Array, of_both: Array | None) -> Array:
        """Return an array over agents, shape (N, ...), from one each over raters, providers and
        SR+SP agents.
        """
        parts = [of_raters, of_providers]
        if of_both is not None:
            both = self._roster.n_both
            parts = [of_raters[: self._roster.n_raters - both], of_providers[:-both], of_both]
        return namespace(of_raters).concat(parts)


class Game(Frozen):
    """The rules of one scenario under one trust model.

    Args:
        scenario: Scenario of the game.
        trust_model: Name of a trust model, which is made with the `lam` and `initial_trust` of the
            scenario; or a trust model as it is.
        like: Array of the library, dtype and device to play with; by default NumPy's float64.

    Attributes:
        scenario: Scenario of the game.
        model: Trust model.
        roster: Agents of the scenario.
        layout: Positions of the fields of a view in an observation.
        like: Array of the library, dtype and device.
    """

    def __init__(
        self,
        scenario: Scenario,
        trust_model: str | TrustModel[Any] | Mapping[str, Any] = "role-trust",
        like: Array | None = None,
    ) -> None:
        if not isinstance(scenario, Scenario):
            raise ValueError(
                f"scenario is {scenario!r}; it must be a Scenario: make_scenario() makes one by "
                "name"
            )
        self.scenario = scenario
        like = np.zeros(()) if like is None else like
        if str(like.dtype).removeprefix("torch.") not in ("float32", "float64"):
            raise ValueError(
                f"like is of dtype {like.dtype}; games are played in float32 or float64"
            )
        self.like = like = namespace(like).zeros_like(like)  # the user's may be written to
        if isinstance(trust_model, str):
            offered = {"lam": scenario.lam, "initial": scenario.initial_trust}
            trust_model = trust_models.make(
                trust_model, **trust_models.accepted_parameters(trust_model, offered)
            )
        if isinstance(trust_model, Mapping):
            trust_model = trust_models.read(trust_model)
        if isinstance(trust_model, type) or not isinstance(trust_model, TrustModel):
            raise ValueError(
                f"trust_model is {trust_model!r}; it must be a trust model, or the name of one"
            )
        by_model = isinstance(scenario.access, Choice) and scenario.access.by == "model"
        if by_model and not hasattr(trust_model, "preference"):
            raise ValueError(
                f"trust model {trust_model!r} has no choice rule, a method preference(state, "
                "noise); access.by must be 'published' or 'own'"
            )
        self.model = trust_model
        self.roster = roster = Roster.of(scenario)
        self._cells = self._make_cells()
        self.layout = ViewLayout(roster.n_raters, roster.n_providers, scenario.max_cycles)
        self.service = make_service(scenario, roster, like)
        self.presence = Presence(scenario, roster, like)
        self._property_sampler = AgentPropertySampler(roster, like)
        self._on_numpy = isinstance(like, np.ndarray)
        self._noise_source = NoiseSource(
            scenario, roster, self.presence.changes, like, self._cells.width
        )
        self._nowhere = self._constant(np.nan, like.dtype)
        # `where` takes a number at twice the cost of a small array.
        self._zero = self._constant(0, like.dtype)
        self._perturbations = Perturbations(scenario, like)
        always, self._duty = True, None
        if any(group.turns for group in scenario.agents):
            rating, providing = roster.role_schedule(scenario.max_cycles)
            always = bool(rating.all() and providing.all())
            self._duty = None if always else (self._constant(rating), self._constant(providing))
        open_to_all = always and not self.presence.changes and isinstance(scenario.access, Everyone)
        self._lossless = (
            scenario.ratings.lost == scenario.ratings.late == 0 and scenario.ratings.open is None
        )
        self._everyone = open_to_all and not roster.n_both  # then no service is ever masked
        self._payoff = Payoff(scenario, roster, like)
        # The state of the model after the last round with its published trust, so that the trust is
        # read out once.
        self._published: dict[str, tuple[Any, tuple[Array, Array]]] = {}

    def __repr__(self) -> str:
        return f"{type(self).__name__}({game_facts(self)})"

    def _make_cells(self) -> Cells:
        """Return the pairs for which a round of this game has numbers."""
        grid = Cells(self.scenario, self.roster, self.model, self.like)
        self._not_self = grid.not_self
        return grid

    def check_policy(self, policy: Policy, memory: Any) -> None:
        """Refuse a policy that this game cannot seat, by its memory before the first round; here
        every one can play.
        """

    def random(self, seed: int | None = None) -> Random:
        """Return a source of random numbers with the array library, dtype and device of this game.

        Args:
            seed: Random seed; None takes fresh entropy.
        """
        return Random(generator(seed), self.like)

    def draw(self, random: Random, batch: tuple[int, ...] = (), *, start: bool = False) -> Noise:
        """Draw the noise of one round, or of the start.

        Args:
            random: Source of random numbers.
            batch: Shape of the batch.
            start: Whether the noise is for `start`, which uses further fields.
        """
        if self._on_numpy and not (start and self._noise_source.starts):
            drawn: Noise = random.draw_noise(self._noise_source, batch)
            return drawn
        return self.noise(random.round_key(), batch, start=start)

    def noise(self, key: Array, batch: tuple[int, ...] = (), *, start: bool = False) -> Noise:
        """Return the noise of one round, or of the start, as a function of its key: that of `draw`.

        A compiler that sees this and `step` together makes the numbers where they are used.

        Args:
            key: Key of the round, see `Random.round_key`.
            batch: Shape of the batch.
            start: Whether the noise is for `start`, which uses further fields.
        """
        return self._noise_source.make_round(key, batch, start)

    def random_end(self, random: Random, batch: tuple[int, ...] = ()) -> Any:
        """Return the number of rounds after which games that begin now end at random.

        It is in no state, as no agent knows it. Games that measure or search do not end at random,
        see `Scenario.round_weights`.

        Args:
            random: Source of random numbers, which has drawn the noise of the start.
            batch: Shape of the batch.

        Returns:
            Whole numbers of the batch's shape, or one for all; above `max_cycles` where a game is
            cut off before.
        """
        never, continuation = self.scenario.max_cycles + 1, self.scenario.continuation
        return never if continuation == 1 else random.lengths(continuation, never, batch)

    def start(self, noise: Noise) -> State:
        """Return the state before the first round."""
        xp, rules, roster = namespace(self.like), self.scenario, self.roster
        nothing = xp.zeros_like(noise.perception)
        trust, of_providers = self._cells.start(nothing)
        met, nobody = self._cells.nobody(nothing.shape)
        traits = noise.ability, noise.bias, noise.scale
        # No two parts share an array: a compiler would have to compile anew when later ones do not.
        return State(
            round=xp.zeros_like(nothing[0, 0, ...], dtype=whole_dtype(nothing)),
            trust=trust,
            ratings=nothing,
            rated=nobody,
            quality=xp.zeros_like(of_providers),
            service=xp.zeros_like(nothing),
            awaiting=self._cells.nobody(nothing.shape)[1],
            value=self._payoff.next_value(of_providers + 1, noise.value),
            counts=Counts(
                0.0 * nothing[: roster.n_both, 0, ...], 0.0 * nothing[: roster.n_both, 0, ...]
            )
            if roster.n_both
            else None,
            population=self.presence.start(noise.presence) if self.presence.changes else None,
            motion=mobility.scatter(rules.access, noise.position, noise.goal)
            if isinstance(rules.access, InRange)
            else None,
            transit=rating_delivery.start(rules.ratings, nothing)
            if rules.ratings.late > 0
            else None,
            properties=self._property_sampler.start(nothing[:, 0, ...], of_providers, *traits),
            met=met,
            due=rating_delivery.Due(xp.zeros_like(nothing), xp.zeros_like(nothing))
            if rules.ratings.deadline > 1
            else None,
        )

    def step(self, state: State, actions: Actions, noise: Noise) -> tuple[State, PerAgent]:
        """Play one round.

        Args:
            state: State before the round; it is not changed.
            actions: Actions of all agents. Those of absent agents, and ratings of services that
                were not received, are ignored, unless they are claims of a scenario with open
                reports. A withheld rating is not sent in this round, not even as a claim, but
                the service counts as provided.
            noise: Noise of the round.

        Returns:
            The state after the round, and the rewards, shape (N, ...), in the order of
            `roster.names`.

        Raises:
            ValueError: The shapes of the actions are not those of the state, or a trust model
                fails; or, on NumPy, an action is NaN or outside [0, 1].
        """
        xp, rules, roster, cells = namespace(self.like), self.scenario, self.roster, self._cells
        actions = fitted(actions, state)
        withheld, population = actions.withheld, state.population
        ready, awaiting = rateable(state)
        sent = self._sent(state, awaiting, actions, noise)
        ratings, rated, transit = rating_delivery.deliver(
            rules.ratings, state.transit, actions.ratings, sent, noise.lost, noise.late
        )
        complete = withheld is None and self._is_complete(state)
        if complete:
            ratings = copy(ratings)  # their sender may write to its array again
        given, received = (None, None) if complete else (rated, state.awaiting)
        trust, tor, top = cells.update(
            state.trust, state.met, ratings, given, state.service, received, state.round
        )
        if self._on_numpy:
            self._published["last"] = trust, (tor, top)

        counts = state.counts
        if counts is not None:
            # A service counts for both when its round is over, so that the trust by which somebody
            # is cut off is the one that is published.
            counts = Counts(
                counts.rated + roster.both(rated.sum(axis=1, dtype=tor.dtype)),
                counts.provided + roster.both(cells.counts(state.awaiting, state.met, top.dtype)),
            )

        if population is not None:
            agents = self._payoff.agent_trust(tor, top, counts)
            population = self.presence.step(
                population, state.round + 1, agents, noise.presence, actions.presence
            )
        motion = state.motion
        if motion is not None and isinstance(rules.access, InRange):
            motion = mobility.move(rules.access, motion, noise.goal)

        met, served = self._served(state, population, motion, (trust, top), noise)
        chosen = intended(actions, state.properties)
        if actions.treatment is not None:
            quality = mean_or_zero(chosen, served)
        else:
            if self._everyone:
                chosen = copy(chosen)
            else:
                chosen = xp.where(cells.anywhere(served, met), chosen, self._zero)
            quality = chosen
        strength = self._perturbations.strength(state.round)
        perception = state.properties.perception
        offered = chosen if met is None else cells.of_providers(chosen, met)
        service = self.service.perceive(
            offered, strength, state.round, noise.perception, perception
        )
        if not self._everyone:
            service = xp.where(served, service, self._zero)
        after = State(
            round=state.round + 1,
            trust=trust,
            ratings=ratings if complete else xp.where(rated, ratings, self._zero),
            rated=rated,
            quality=quality,
            service=service,
            awaiting=served,
            value=self._payoff.next_value(state.value, noise.value),
            counts=counts,
            population=population,
            motion=motion,
            transit=transit,
            properties=state.properties
            if noise.drift is None and noise.switch is None
            else self._property_sampler.step(state.properties, noise.drift, noise.switch),
            met=met,
            due=None
            if state.due is None
            else rating_delivery.remaining(
                rules.ratings,
                state.due,
                ready,
                state.awaiting,
                awaiting & ~sent & ~served & self._present_pairs(population, served.shape),
            ),
        )
        return after, self._payoff.rewards(tor, top, counts, quality, state.value)

    def published(self, state: State) -> tuple[PerRater, PerProvider]:
        """Return the published trust: ToR of the raters, shape (S, ...), and ToP of the providers,
        shape (P, ...).
        """
        trust, published = self._published.get("last", (None, None))
        if published is not None and trust is state.trust:  # most often that of the last round
            return published
        return self._cells.read(state.trust)

    def known_trust(self, state: State) -> PerPair:
        """Return the trust of each provider as each rater knows it, shape (S, P, ...); NaN where
        they are one agent.

        A rater has a view of its own under a personal model, and knows the published trust under
        any other.
        """
        shape, judge_trust = state.ratings.shape, getattr(self.model, "judge_trust", None)
        own = for_batch(self._not_self, shape)
        known = (
            self.published(state)[1][None, ...] if judge_trust is None else judge_trust(state.trust)
        )
        return namespace(known).where(own, known, self._nowhere)

    def agent_trust(self, state: State) -> PerAgent:
        """Return the trust of every agent, shape (N, ...): ToR of an SR, ToP of an SP, ToA of an
        SR+SP agent.
        """
        return self._payoff.agent_trust(*self.published(state), state.counts)

    def present(self, state: State) -> AgentFlags | None:
        """Return whether each agent is present, boolean, shape (N, ...); None where everybody
        always is.
        """
        return None if state.population is None else state.population.phase == PRESENT

    def offered(self, before: State, actions: Actions, after: State) -> PerProvider | PerPair:
        """Return the quality on offer in a round, shape (P, ...); NaN where a provider did not
        serve.

        Delivered quality is 0 where no rater came, but a consumer could still have had the quality
        on offer. Where a provider treats raters differently, the shape is (S, P, ...): the quality
        on offer for each rater.
        """
        xp, quality = namespace(self.like), intended(actions, before.properties)
        for _, providing in self._acting(before, after.population):
            quality = xp.where(providing, quality, self._nowhere)
        return quality

    def views(self, state: State) -> tuple[ProviderView, RaterView]:
        """Return the views of all providers, with one further axis (P, ...), and of all raters,
        with one (S, ...).
        """
        return make_views(
            self._clock(state),
            *self.published(state),
            state.value,
            state.quality,
            *rateable(state),
            state.ratings,
            state.rated,
        )

    def observations(
        self, state: State
    ) -> tuple[
        Annotated[Array, Shape("K n ...")],
        Annotated[Array, Shape("L m ...")],
        Annotated[Array, Shape("M o ...")] | None,
    ]:
        """Return the observation vectors of the SR, (K, n, ...), the SP and the SR+SP agents, None
        without any.
        """
        provider, rater = self.views(state)
        of_raters, of_providers = self.layout.flatten(rater), self.layout.flatten(provider)
        both = self.roster.n_both
        if not both:
            return of_raters, of_providers, None
        trust = self.agent_trust(state)[self.roster.n_agents - both :]
        n_sr, n_sp = self.roster.n_raters - both, self.roster.n_providers - both
        of_both = namespace(self.like).concat(
            [trust[None, ...], of_providers[:, n_sp:, ...], of_raters[:, n_sr:, ...]]
        )
        return of_raters[:, :n_sr, ...], of_providers[:, :n_sp, ...], of_both

    def _sent(self, state: State, awaiting: PairFlags, actions: Actions, noise: Noise) -> PairFlags:
        """Return which ratings are sent in this round, boolean, shape (S, P, ...).

        Args:
            state: State before the round.
            awaiting: Whether there is a service to rate, boolean, shape (S, P, ...).
            actions: Actions of all agents.
            noise: Noise of the round.
        """
        rule, claimed = self.scenario.ratings, None
        reports = awaiting if actions.withheld is None else awaiting & ~actions.withheld
        if rule.open is not None and actions.claims is not None:
            claimed = self._present_pairs(state.population, awaiting.shape)
            claimed = claimed if actions.withheld is None else claimed & ~actions.withheld
        return rating_delivery.choose_reports(rule, reports, claimed, actions.claims, noise.claim)

    def _present_pairs(self, population: Population | None, shape: tuple[int, ...]) -> PairFlags:
        """Return whether rater and provider are two agents that are present, boolean, in the shape
        (S, P, ...).
        """
        pairs = for_batch(self._not_self, shape)
        if population is None:
            return pairs
        present = population.phase == PRESENT
        raters, providers = self.roster.raters(present), self.roster.providers(present)
        return pairs & raters[:, None, ...] & providers[None, ...]

    def _acting(self, state: State, population: Population | None) -> Iterator[tuple[Array, Array]]:
        """Yield which raters and which providers act in this round, once for each reason not to
        act.
        """
        xp, roster = namespace(self.like), self.roster
        if self._duty is not None:
            rating, providing = (xp.moveaxis(duty[state.round], -1, 0) for duty in self._duty)
            yield rating, providing
        if population is not None and state.population is not None:
            # A newcomer acts from its first full round on, and who leaves in this round serves
            # nobody any more.
            acting = (population.phase == PRESENT) & (state.population.phase == PRESENT)
            yield roster.raters(acting), roster.providers(acting)

    def _served(
        self,
        state: State,
        population: Population | None,
        motion: mobility.Motion | None,
        trust: tuple[Any, PerProvider],
        noise: Noise,
    ) -> tuple[Any, Array]:
        """Return the providers of the cells in this round, and whether each serves the rater,
        boolean, (S, K, ...).
        """
        rules, roster, cells = self.scenario, self.roster, self._cells
        met, served = cells.meet(state.awaiting.shape, noise.choice)
        for rating, providing in self._acting(state, population):
            served = served & rating[:, None, ...] & cells.of_providers(providing, met)
        if motion is not None and isinstance(rules.access, InRange):
            position = motion.position
            near = access.in_range(
                roster.raters(position), roster.providers(position), rules.access.radius
            )
            served = served & near
        if isinstance(rules.access, Choice):
            preference = self._preference(rules.access, *trust, noise.choice)
            served = access.choose_providers(
                rules.access, preference, served, noise.choice, noise.explore
            )
        return met, served

    def _preference(
        self, rule: Choice, trust: Any, top: PerProvider, noise: PerPair
    ) -> Annotated[Array, Shape("R P ...")]:
        """Return how much each rater wants each provider, shape (S, P, ...), or (1, P, ...) if all
        want the same.
        """
        judge_trust = getattr(self.model, "judge_trust", None)
        if rule.by == "model":
            preference: Array = self.model.preference(trust, noise)  # type: ignore[attr-defined]
            return preference
        if rule.by == "own" and judge_trust is not None:
            own: Array = judge_trust(trust)
            return own
        return top[None, ...]

    def _is_complete(self, state: State) -> bool:
        """Return whether every pair has a service that awaits its rating, in all games of a batch.

        A game on NumPy knows it from the round; other libraries do not branch on a value.
        """
        if not (self._lossless and self._everyone and self._on_numpy):
            return False
        return bool(state.round.min() > 0)

    def _clock(self, state: State) -> Array:
        """Return the number of the round, in the dtype of the game."""
        return cast(state.round, self.like.dtype)

    def _constant(self, values: Any, dtype: Any = None) -> Array:
        return namespace(self.like).asarray(values, dtype=dtype, device=self.like.device)
