"""The game: its state and the transition from one round to the next, pure and batched.

One round is: ratings arrive -> trust -> who is present -> services -> rewards. Providers and raters act at once, so the
ratings of a round are for the services of the round before, and on the first step there is nothing to rate.

Everything here is a function of its arguments and of constants. Random numbers are drawn outside and passed in, so that
a planner cannot foresee luck, and so that one game and a batch of games can be given the same luck.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from roletrust_env.arrays import Array, cast, copied, mean_where, namespace
from roletrust_env.game.brief import game_facts
from roletrust_env.game.noise import NoiseSource
from roletrust_env.game.payoff import Payoff
from roletrust_env.game.state import Actions, Counts, Noise, State, fitted, intended
from roletrust_env.game.views import Layout, ProviderView, RaterView, look
from roletrust_env.randomness import Random
from roletrust_env.trust import TrustModel, check_trust_model
from roletrust_env.trust.model import Traits, start_model
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.trust.model_checks import needs_watching, watched_update
from roletrust_env.world import access, mobility, rating_delivery
from roletrust_env.world.heterogeneity import Natures
from roletrust_env.world.perturbation import Perturbations
from roletrust_env.world.presence import PRESENT, Population, Presence
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Choice, Everyone, InRange, Scenario
from roletrust_env.world.service import make_service


class Game:
    """The rules of one scenario under one trust model.

    Args:
        scenario: what is played.
        trust_model: the name of a trust model, which is made with the scenario's `lam` and `initial_trust`; or a model,
            which keeps its own.
        like: an array of the library, dtype and device to play with; by default NumPy's float64.

    Attributes:
        scenario: as given.
        model: the trust model.
        roster: who is who.
        layout: where each field of a view stands in an observation.
        like: an array of the library, dtype and device that it plays with.
    """

    def __init__(
        self, scenario: Scenario, trust_model: str | TrustModel[Any] = "role-trust", like: Array | None = None
    ) -> None:
        if not isinstance(scenario, Scenario):
            raise ValueError(f"scenario is {scenario!r}; it must be a Scenario: make_scenario() makes one by name")
        self.scenario = scenario
        self.like = like = np.zeros(()) if like is None else like
        if str(like.dtype).removeprefix("torch.") not in ("float32", "float64"):
            raise ValueError(f"like is of dtype {like.dtype}; games are played in float32 or float64")
        if isinstance(trust_model, str):
            offered = {"lam": scenario.lam, "initial": scenario.initial_trust}
            trust_model = trust_models.make(trust_model, **trust_models.taken(trust_model, offered))
        if isinstance(trust_model, type) or not isinstance(trust_model, TrustModel):
            raise ValueError(f"trust_model is {trust_model!r}; it must be a trust model, or the name of one")
        self.model = trust_model
        self.roster = roster = Roster.of(scenario)
        self._peers = self._constant(~roster.stranger)
        check_trust_model(trust_model, self._peers, like)
        self.layout = Layout(roster.n_raters, roster.n_providers, scenario.max_cycles)
        self.service = make_service(scenario, roster, like)
        self.presence = Presence(scenario, roster, like)
        self._natures = Natures(roster, like)
        self._on_numpy = isinstance(like, np.ndarray)
        self._luck = NoiseSource(scenario, roster, self.presence.changes, like)
        self._stranger = self._constant(roster.stranger)
        self._everybody = self._constant(np.ones(roster.n_agents), like.dtype)
        self._nowhere = self._constant(np.nan, like.dtype)
        self._zero = self._constant(0, like.dtype)  # `where` takes a number at twice the cost of a small array
        self._perturbations = Perturbations(scenario, like)
        rating, providing = roster.on_duty(scenario.max_cycles)
        always = bool(rating.all() and providing.all())
        self._duty = None if always else (self._constant(rating), self._constant(providing))
        open_to_all = always and not self.presence.changes and isinstance(scenario.access, Everyone)
        self._lossless = scenario.ratings.lost == scenario.ratings.late == 0
        self._watched = needs_watching(trust_model)
        self._takes_full_rounds = Traits.of(trust_model).takes_full_rounds
        self._everyone = open_to_all and bool(roster.stranger.all())  # then no service is ever masked
        self._payoff = Payoff(scenario, roster, like)
        # The state of the model after the last round with its published trust, so that the trust is read out once.
        self._published: tuple[Any, tuple[Array, Array] | None] = (None, None)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({game_facts(self)})"

    def random(self, seed: int | None = None) -> Random:
        """A source of luck for this game: of its array library, dtype and device.

        Args:
            seed: makes it reproducible; None takes fresh entropy.
        """
        return Random(np.random.default_rng(seed), self.like)

    def draw(self, random: Random, batch: tuple[int, ...] = (), *, start: bool = False) -> Noise:
        """Draw the luck of one round, or of the start.

        Args:
            random: the source.
            batch: shape of the batch.
            start: whether this is for `start`, which takes luck of its own.
        """
        if self._on_numpy and not (start and self._luck.starts):
            return random.deal(self._luck, batch)
        return self.luck(random.round_key(), batch, start=start)

    def luck(self, key: Array, batch: tuple[int, ...] = (), *, start: bool = False) -> Noise:
        """The luck of one round, or of the start, as a function of its key: what `draw` draws.

        A compiler that sees this and `step` together makes the numbers where they are used.

        Args:
            key: of the round, see `Random.round_key`.
            batch: shape of the batch.
            start: whether this is for `start`, which takes luck of its own.
        """
        return self._luck.of_round(key, batch, start)

    def start(self, noise: Noise) -> State:
        """The state before the first round."""
        xp, rules, roster = namespace(self.like), self.scenario, self.roster
        nothing = xp.zeros_like(noise.perception)
        # No two parts share an array: a compiler would have to compile anew when later ones do not.
        return State(
            round=xp.zeros_like(nothing[0, 0, ...], dtype=xp.int64),
            trust=start_model(self.model, nothing, self._peers),
            ratings=nothing,
            rated=self._over(self._stranger & False, nothing.shape),
            quality=xp.zeros_like(nothing[0]),
            service=xp.zeros_like(nothing),
            awaiting=self._over(self._stranger & False, nothing.shape),
            value=self._payoff.next_value(nothing[0] + 1, noise.value),
            counts=Counts(0.0 * nothing[: roster.n_both, 0, ...], 0.0 * nothing[: roster.n_both, 0, ...])
            if roster.n_both
            else None,
            population=self.presence.start(noise.presence) if self.presence.changes else None,
            places=mobility.place(rules.access, noise.position, noise.goal)
            if isinstance(rules.access, InRange)
            else None,
            transit=rating_delivery.start(rules.ratings, nothing) if rules.ratings.late > 0 else None,
            nature=self._natures.start(nothing, noise.ability, noise.bias, noise.scale),
            full=False,
        )

    def step(self, state: State, actions: Actions, noise: Noise) -> tuple[State, Array]:
        """Play one round.

        Args:
            state: before the round; it is left as it is.
            actions: of all agents; those of absent agents, and ratings of services that do not await one, are ignored.
                A rating that is withheld never arrives, and the service was provided all the same.
            noise: the luck of the round.

        Returns:
            The state after the round, and the rewards, shape (N, ...), in the order of `roster.names`.

        Raises:
            ValueError: the shapes of the actions are not those of the state, or a trust model of another package fails.
        """
        xp, rules, roster = namespace(self.like), self.scenario, self.roster
        actions = fitted(actions, state)
        withheld, population = actions.withheld, state.population
        sent = state.awaiting if withheld is None else state.awaiting & ~withheld
        ratings, rated, transit = rating_delivery.deliver(
            rules.ratings, state.transit, actions.ratings, sent, noise.lost, noise.late
        )
        full = state.full and self._lossless and withheld is None
        if full:
            ratings = copied(ratings)  # whoever sent them may write to theirs again
        mask = None if full and self._takes_full_rounds else rated
        if self._watched:
            trust, tor, top = watched_update(self.model, state.trust, ratings, mask, state.round)
        else:
            trust = self.model.update(state.trust, ratings, mask)
            tor, top = self.model.rater_trust(trust), self.model.provider_trust(trust)
        if self._on_numpy:
            self._published = trust, (tor, top)

        counts = state.counts
        if counts is not None:
            # A service counts for both when its round is over, so that the trust by which somebody is cut off is the
            # one that is published.
            counts = Counts(
                counts.rated + roster.both(rated.sum(axis=1, dtype=tor.dtype)),
                counts.provided + roster.both(state.awaiting.sum(axis=0, dtype=top.dtype)),
            )

        if population is not None:
            agents = self._payoff.agent_trust(tor, top, counts)
            population = self.presence.step(population, state.round + 1, agents, noise.presence, actions.presence)
        places = state.places
        if places is not None and isinstance(rules.access, InRange):
            places = mobility.move(rules.access, places, noise.goal)

        served = self._served(state, population, places, top, noise)
        chosen = intended(actions, state.nature)
        if actions.treatment is not None:
            quality = mean_where(chosen, served)
        else:
            chosen = quality = copied(chosen) if self._everyone else xp.where(served.any(axis=0), chosen, self._zero)
        strength, taste = self._perturbations.strength(state.round), state.nature.taste
        service = self.service.perceive(chosen, strength, state.round, noise.perception, taste)
        if not self._everyone:
            service = xp.where(served, service, self._zero)
        after = State(
            round=state.round + 1,
            trust=trust,
            ratings=ratings if full else xp.where(rated, ratings, self._zero),
            rated=rated,
            quality=quality,
            service=service,
            awaiting=served,
            value=self._payoff.next_value(state.value, noise.value),
            counts=counts,
            population=population,
            places=places,
            transit=transit,
            nature=state.nature,
            full=self._everyone,
        )
        return after, self._payoff.rewards(tor, top, counts, quality, state.value)

    def published(self, state: State) -> tuple[Array, Array]:
        """The trust of the raters, ToR (S, ...), and that of the providers, ToP (P, ...), as published."""
        trust, published = self._published
        if trust is state.trust and published is not None:  # most often that of the last round
            return published
        return self.model.rater_trust(state.trust), self.model.provider_trust(state.trust)

    def agent_trust(self, state: State) -> Array:
        """The trust of every agent, shape (N, ...): ToR of an SR, ToP of an SP, ToA of an SR+SP agent."""
        return self._payoff.agent_trust(*self.published(state), state.counts)

    def present(self, state: State) -> Array | None:
        """Which agents are present, shape (N, ...), boolean; None where everybody always is."""
        return None if state.population is None else state.population.phase == PRESENT

    def offered(self, before: State, actions: Actions, after: State) -> Array:
        """The quality that each provider had for whoever came in a round, (P, ...); NaN where it did not serve.

        What it delivered is 0 where nobody came; what a consumer could have had is not. Where any provider treats
        raters differently it is what each of them could have had, (S, P, ...).

        Args:
            before: the state before the round.
            actions: of all agents in the round.
            after: the state after it.
        """
        xp, quality = namespace(self.like), intended(actions, before.nature)
        for _, providing in self._acting(before, after.population):
            quality = xp.where(providing, quality, self._nowhere)
        return quality

    def views(self, state: State) -> tuple[ProviderView, RaterView]:
        """What all providers see, with one further axis (P, ...), and what all raters see, with one (S, ...)."""
        return look(
            self._clock(state),
            *self.published(state),
            state.value,
            state.quality,
            state.service,
            state.awaiting,
            state.ratings,
            state.rated,
        )

    def observations(self, state: State) -> tuple[Array, Array, Array | None]:
        """The observation vectors of the SR, (K, n, ...), of the SP and of the SR+SP agents (None without any)."""
        provider, rater = self.views(state)
        of_raters, of_providers = self.layout.flatten(rater), self.layout.flatten(provider)
        both = self.roster.n_both
        if not both:
            return of_raters, of_providers, None
        trust = self.agent_trust(state)[self.roster.n_agents - both :]
        n_sr, n_sp = self.roster.n_raters - both, self.roster.n_providers - both
        of_both = namespace(self.like).concat([trust[None, ...], of_providers[:, n_sp:, ...], of_raters[:, n_sr:, ...]])
        return of_raters[:, :n_sr, ...], of_providers[:, :n_sp, ...], of_both

    @property
    def summary_size(self) -> int:
        """Number of entries of `summary`."""
        s, p, n = self.roster.n_raters, self.roster.n_providers, self.roster.n_agents
        return 1 + s + 3 * p + n + 4 * s * p + (2 * n if isinstance(self.scenario.access, InRange) else 0)

    def summary(self, state: State) -> Array:
        """The whole state as a vector, shape (summary_size, ...), every entry in [0, 1].

        In this order: clock; ToR (S); ToP (P); value of the next services (P); delivered quality (P); who is present
        (N); and, row by row, perceived quality of the services that await a rating, which ones do, ratings that arrived
        and where they did (S x P each); where robots move, their positions as shares of the arena (N x 2).
        """
        xp, batch = namespace(self.like), state.round.shape
        tor, top = self.published(state)
        present = self.present(state)
        if present is None:
            present = self._over(self._everybody, (self.roster.n_agents, *batch))
        parts = [self._clock(state) / self.scenario.max_cycles, tor, top, state.value, state.quality, present]
        parts += [state.service, state.awaiting, state.ratings, state.rated]
        if state.places is not None and isinstance(self.scenario.access, InRange):
            parts.append(state.places.position / self.scenario.access.arena)
        return xp.concat([part.reshape(-1, *batch) for part in parts])

    def _acting(self, state: State, population: Population | None) -> Iterator[tuple[Array, Array]]:
        """Which raters and which providers act in this round, by each of the reasons for which some may not."""
        xp, roster = namespace(self.like), self.roster
        if self._duty is not None:
            rating, providing = (xp.moveaxis(duty[state.round], -1, 0) for duty in self._duty)
            yield rating, providing
        if population is not None and state.population is not None:
            # A newcomer acts from its first full round on, and who leaves in this round serves nobody any more.
            acting = (population.phase == PRESENT) & (state.population.phase == PRESENT)
            yield roster.raters(acting), roster.providers(acting)

    def _served(
        self,
        state: State,
        population: Population | None,
        places: mobility.Places | None,
        top: Array,
        noise: Noise,
    ) -> Array:
        """Who is served by whom in this round, shape (S, P, ...), boolean."""
        rules, roster = self.scenario, self.roster
        served = self._over(self._stranger, state.awaiting.shape)
        for rating, providing in self._acting(state, population):
            served = served & rating[:, None, ...] & providing[None, ...]
        if places is not None and isinstance(rules.access, InRange):
            position = places.position
            near = access.in_range(roster.raters(position), roster.providers(position), rules.access.radius)
            served = served & near
        if isinstance(rules.access, Choice):
            served = access.choose(rules.access, top, served, noise.choice)
        return served

    def _clock(self, state: State) -> Array:
        """The number of the round, in the dtype of everything else."""
        return cast(state.round, self.like.dtype)

    def _over(self, constant: Array, shape: tuple[int, ...]) -> Array:
        """A constant, such as one of shape (S, P), for every game of a batch.

        A view and not a copy: on the CPU, compiled torch takes as long to write booleans as for the whole trust model.
        """
        if constant.shape == shape:
            return constant
        batch = (1,) * (len(shape) - constant.ndim)
        return namespace(constant).broadcast_to(constant.reshape(constant.shape + batch), shape)

    def _constant(self, values: Any, dtype: Any = None) -> Array:
        return namespace(self.like).asarray(values, dtype=dtype, device=self.like.device)
