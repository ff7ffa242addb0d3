"""A coalition as one mind: what it remembers, the features of providers that it decides by, and its
actions.
"""

from typing import Annotated, NamedTuple, Self

import numpy as np

from roletrust_env.arrays import Array, cast, largest, mean_or_zero, mean_places, namespace
from roletrust_env.frozen import Frozen
from roletrust_env.game.accounts import Accounts, account_features
from roletrust_env.game.game import Game
from roletrust_env.game.state import Action, Actions, State
from roletrust_env.shapes import AgentFlags, PerGame, PerProvider, Shape
from roletrust_env.world.presence import PRESENT
from roletrust_env.world.roster import places

FEATURES = (
    "published",
    "published_rank",
    "published_change",
    "perceived",
    "perceived_rank",
    "published_less_perceived",
    "last_lie",
    "most_trusted",
    "lead",
    "perceived_gap",
    "accomplice",
    "served",
    "own_trust",
    "own_share",
    "clock",
)
"""Names of the features of a provider, see `provider_features`."""

REACH = 1.5
"""Largest distance of a lie from the perceived quality, before it is cut to [0, 1]."""

_STEPS = 10_000.0  # of published trust: providers that are alike tie, whatever the rounding errors
_CHANGES, _LEADS = (
    5.0,
    10.0,
)  # small differences of trust decide; this brings them near the size of other features


class CoalitionMemory(NamedTuple):
    """Memory of a coalition, or of a member of it.

    Attributes:
        total: Sum of the perceived qualities of each provider, over its raters and the rounds,
            shape (P, ...).
        count: Number of these perceptions, shape (P, ...).
        published: Published trust of each provider as far as it is seen, to four digits, shape (P,
            ...).
        change: Change of that trust in the last round, shape (P, ...).
        accounts: Accounts of the raters with the own providers; None where nobody treats raters by
            them.
        given: Quality of the last service of each own provider to each rater, as it was chosen,
            shape (S, n, ...).
    """

    total: PerProvider
    count: PerProvider
    published: PerProvider
    change: PerProvider
    accounts: Accounts | None = None
    given: Annotated[Array, Shape("S n ...")] | None = None

    @classmethod
    def begin(cls, published: PerProvider) -> Self:
        """Return the memory before the first round, from the trust at that time, shape (P, ...)."""
        return cls(0 * published, 0 * published, published, 0 * published)

    def remember(self, published: PerProvider) -> Self:
        """Return the memory with the published trust of a round, shape (P, ...). Call it once in
        every round.
        """
        return self._replace(published=published, change=published - self.published)

    def perceive(
        self,
        service: Annotated[Array, Shape("m P ...")],
        awaiting: Annotated[Array, Shape("m P ...", "bool")],
    ) -> Self:
        """Return the memory with the services of a round.

        Args:
            service: Quality that each rater perceives in each service, shape (n, P, ...).
            awaiting: Whether there is such a service, boolean, shape (n, P, ...).
        """
        count = self.count + awaiting.sum(axis=0, dtype=self.total.dtype)
        return self._replace(total=self.total + (service * awaiting).sum(axis=0), count=count)

    @property
    def perceived(self) -> PerProvider:
        """Mean perceived quality of each provider, shape (P, ...); its published trust where there
        is none.
        """
        where = namespace(self.total).where
        return where(self.count > 0, self.total / (self.count + (self.count == 0)), self.published)


def to_digits(trust: Array) -> Array:
    """Return published trust to four digits, so that providers that are alike tie."""
    return namespace(trust).round(_STEPS * trust) / _STEPS


def provider_features(
    memory: CoalitionMemory,
    *,
    last_lie: PerProvider,
    accomplice: Array,
    served: PerProvider,
    own_trust: PerGame,
    own_share: float,
    clock: PerGame,
) -> Annotated[Array, Shape("F P ...")]:
    """Return the features of each provider, shape (F, P, ...), in [-1, 1], in the order of
    `FEATURES`.

    - `published`, `published_rank`: its published trust to four digits, and the rank of that, 0 for
      the highest and 1 for the lowest; `published_change`: five times the change in the last round.
    - `perceived`, `perceived_rank`: its mean perceived quality, see `CoalitionMemory`, and the rank
      of that.
    - `published_less_perceived`: the difference of the two.
    - `last_lie`: rating of it that arrived in the last round, less the perceived quality.
    - `most_trusted`: 1 for a provider with the highest published trust, to which consumers go, else
      0; `lead`: ten times its published trust less the highest one of the others, cut to [-1, 1].
    - `perceived_gap`: distance to the best perceived quality.
    - `accomplice`: 1 for a provider of the coalition, else 0.
    - `served`: 1 if its service awaits a rating, else 0.
    - `own_trust`, `own_share`, `clock`: the same for all providers, see the arguments.

    Args:
        memory: Memory with what is seen in this round.
        last_lie: See above, shape (P, ...).
        accomplice: See above, shape (P,) or (P, 1, ...).
        served: See above, shape (P, ...).
        own_trust: Trust of the own agents, shape (...).
        own_share: Share of the raters that belong to the coalition.
        clock: Share of the game that is over, shape (...).
    """
    xp, published, perceived = namespace(memory.total), memory.published, memory.perceived
    nothing = 0 * published
    rows = (
        published,
        _rank(published),
        xp.clip(_CHANGES * memory.change, -1.0, 1.0),
        perceived,
        _rank(perceived),
        published - perceived,
        last_lie,
        cast(published == largest(published), published.dtype),
        xp.clip(_LEADS * (published - _best_other(published)), -1.0, 1.0),
        largest(perceived) - perceived,
        nothing + accomplice.reshape(-1, *[1] * (published.ndim - 1)),
        served,
        nothing + own_trust,
        nothing + own_share,
        nothing + clock,
    )
    return xp.stack(rows)


def lie_ratings(memory: CoalitionMemory, lie: PerProvider) -> PerProvider:
    """Return the ratings that tell a lie: the perceived quality plus `REACH` times (2 x - 1), cut
    to [0, 1].

    Args:
        memory: Memory with what is seen in this round.
        lie: Lie about each provider, x, shape (P, ...), in [0, 1]; 0.5 is the truth without noise.
    """
    return namespace(lie).clip(memory.perceived + REACH * (2 * lie - 1), 0.0, 1.0)


def _best_other(values: Array) -> Array:
    """Return the highest of the other values for each value along the first axis; the value itself
    if it is alone.
    """
    xp, top = namespace(values), largest(values)
    highest = values == top
    if values.shape[0] == 1:
        return values
    second = largest(xp.where(highest, xp.min(values, axis=0), values))
    alone = highest.sum(axis=0) == 1
    return xp.where(highest & alone, second, top)


def _rank(values: Array) -> Array:
    """Return the rank of each value along the first axis: 0 for the highest, 1 for the lowest; ties
    share the mean.
    """
    return mean_places(values) / max(1, values.shape[0] - 1)


IDENTITY_FEATURES = ("turn", "trust", "present", "succeeds", "provides", "clock")
"""Names of the features of an identity, see `Coalition.identity_features`."""


class Decision(NamedTuple):
    """The decision of a coalition in a round, in [0, 1]. None is what a coalition without these
    agents decides.

    Attributes:
        lie: Lie about each provider, which all its raters tell, see `lie_ratings`, shape (P, ...).
        quality: Quality of each provider, shape (P, ...); those of providers of others are ignored.
        silence: Above 0.5, its raters do not rate the provider, shape (P, ...); None rates all.
        treatment: Share of that quality for each rater by each own provider, shape (S, n, ...);
            None serves all alike.
        claims: Priority of a rating of each provider without a service, which all its raters have,
            shape (P, ...), see `RatingDelivery.open`; None claims nothing.
    """

    lie: PerProvider | None = None
    quality: PerProvider | None = None
    silence: PerProvider | None = None
    treatment: Annotated[Array, Shape("S n ...")] | None = None
    claims: PerProvider | None = None


class Coalition(Frozen):
    """The compromised agents of a game as one mind.

    Args:
        game: Game.
        identities: Names of the compromised agents and of their identities in reserve.
        wide: Whether its raters can be silent, and claim ratings where reports are open, and its
            providers keep accounts of the raters, to treat each by its own.

    Attributes:
        rates: Whether any of them rates.
        raters: Indices of its raters on the rater axis.
        providers: Indices of its providers on the provider axis.
        silent: Whether it decides on silence.
        claims: Whether it decides on claims.
        treats: Whether its providers keep accounts.
        has_reserve: Whether any of them has identities in reserve.
    """

    def __init__(self, game: Game, identities: tuple[str, ...], *, wide: bool = False) -> None:
        roster = game.roster
        self._game = game
        self.raters = places(identities, roster.rater_names)
        self.providers = places(identities, roster.provider_names)
        self.rates = bool(self.raters)
        self.silent, self.treats = wide and self.rates, wide and bool(self.providers)
        self.claims = self.silent and game.scenario.ratings.open is not None
        own = np.isin(np.arange(roster.n_providers), self.providers)
        xp, like = namespace(game.like), game.like
        self._accomplice = xp.asarray(own, dtype=like.dtype, device=like.device)
        ally = np.isin(np.arange(roster.n_raters), self.raters).astype(float)
        of_raters = np.stack([ally, np.arange(roster.n_raters) / max(1, roster.n_raters - 1)])
        self._of_raters = xp.asarray(of_raters, dtype=like.dtype, device=like.device)
        columns = [
            self.providers.index(p) if p in self.providers else -1
            for p in range(roster.n_providers)
        ]
        self._columns = columns  # of a treatment by own providers; the last one is that of others
        self._agents = places(identities, roster.names)
        turn = np.asarray([roster.identity_index[place] for place in self._agents], float)
        self._before = [roster.previous_identity[place] for place in self._agents]
        provides = [roster.names[place] in roster.provider_names for place in self._agents]
        about = np.stack([turn / max(1.0, turn.max()), np.asarray(provides, float)])
        self._about = xp.asarray(about, dtype=like.dtype, device=like.device)
        self.has_reserve = bool(turn.max() > 0)
        self._share = len(self.raters) / roster.n_raters

    def begin(self, state: State) -> CoalitionMemory:
        """Return the memory before the first round."""
        memory = CoalitionMemory.begin(0 * state.quality + self._game.scenario.initial_trust)
        if not self.treats:
            return memory
        nothing = 0 * state.ratings[:, self.providers, ...]
        return memory._replace(accounts=Accounts.begin(nothing), given=nothing)

    def remember(self, state: State, memory: CoalitionMemory) -> CoalitionMemory:
        """Return the memory with what the coalition sees in a state. Call it once in every
        round.
        """
        memory = memory.remember(self._published(state))
        if memory.accounts is not None:
            mine = state.ratings[:, self.providers, ...], state.rated[:, self.providers, ...]
            memory = memory._replace(accounts=memory.accounts.hear(*mine))
        if not self.rates:
            return memory
        return memory.perceive(state.service[self.raters, ...], state.awaiting[self.raters, ...])

    def features(self, state: State, memory: CoalitionMemory) -> Annotated[Array, Shape("F P ...")]:
        """Return the features of each provider, shape (F, P, ...), see `provider_features`.

        `last_lie` is the mean over the raters of the coalition. `own_trust` is the mean published
        ToR of them; without any, the mean ToP of its providers. The perceived quality is a mean
        over all its raters and rounds, so it has less noise than the perception of any honest
        rater.
        """
        xp, perceived = namespace(memory.total), memory.perceived
        lie = served = 0 * perceived
        if self.rates:
            rated = state.rated[self.raters, ...]
            said = mean_or_zero(state.ratings[self.raters, ...], rated)
            lie = xp.where(rated.any(axis=0), said - perceived, lie)
            served = cast(state.awaiting[self.raters, ...].any(axis=0), perceived.dtype)
        return provider_features(
            memory,
            last_lie=lie,
            accomplice=self._accomplice,
            served=served,
            own_trust=self._own_trust(state),
            own_share=self._share,
            clock=cast(state.round, perceived.dtype) / self._game.scenario.max_cycles,
        )

    def account_features(self, memory: CoalitionMemory) -> Annotated[Array, Shape("A S n ...")]:
        """Return the features of the accounts of raters with own providers, (A, S, n, ...), see
        `account_features`.

        The best provider of others is the one with the best perceived quality, see
        `CoalitionMemory`.
        """
        if memory.accounts is None or memory.given is None:
            raise ValueError(
                "the memory has no accounts: the coalition is not wide, or has no providers"
            )
        perceived, xp = memory.perceived, namespace(memory.total)
        others = self._accomplice.reshape(-1, *[1] * (perceived.ndim - 1)) == 0
        ally, place = self._of_raters.reshape(2, -1, *[1] * perceived.ndim)
        return account_features(
            memory.accounts,
            best_other=largest(xp.where(others, perceived, 0 * perceived)),
            given=memory.given,
            ally=ally,
            place=place,
        )

    def identity_features(self, state: State) -> Annotated[Array, Shape("I n ...")]:
        """Return the features of each own identity, shape (I, n, ...), in [0, 1], in the order of
        `IDENTITY_FEATURES`.

        - `turn`: 0 for the first identity of an agent, 1 for its last one in reserve.
        - `trust`: its published trust by its role.
        - `present`: whether it is present; `succeeds`: whether the identity before it is gone for
          good.
        - `provides`: whether it provides.
        - `clock`: share of the game that is over.
        """
        assert state.population is not None  # somebody has a reserve
        xp, phase = namespace(self._about), state.population.phase
        trust = self._game.agent_trust(state)[self._agents, ...]
        nothing = 0 * trust
        turn, provides = self._about.reshape(*self._about.shape, *[1] * (trust.ndim - 1))
        present, succeeds = phase[self._agents, ...] == PRESENT, phase[self._before, ...] > PRESENT
        clock = cast(state.round, trust.dtype) / self._game.scenario.max_cycles
        flags = (cast(flag, trust.dtype) for flag in (present, succeeds))
        return xp.stack([nothing + turn, trust, *flags, nothing + provides, nothing + clock])

    def wanted(self, chosen: Annotated[Array, Shape("n ...", "bool")]) -> AgentFlags:
        """Return which identities of all agents shall be present, boolean, shape (N, ...), from a
        choice for own ones.

        Args:
            chosen: Whether each own identity shall be present, boolean, shape (n, ...).
        """
        xp, n = namespace(chosen), len(self._game.roster.names)
        order = [
            self._agents.index(place) if place in self._agents else len(self._agents)
            for place in range(n)
        ]
        return xp.concat([chosen, chosen[:1, ...] & False])[order, ...]

    def decision(self, flat: Action) -> Decision:
        """Return the decision of an action, shape (action_size, ...), in [0, 1].

        As far as the coalition decides on them: lies about each provider, qualities of each
        provider, silence about each provider, the treatment of each rater by each own provider, and
        claims about each provider.
        """
        at, parts = 0, dict[str, Array]()
        for name, size in self.sizes.items():
            parts[name], at = flat[at : at + size, ...], at + size
        if self.treats:
            shape = (self._game.roster.n_raters, len(self.providers), *flat.shape[1:])
            parts["treatment"] = parts["treatment"].reshape(shape)
        return Decision(**parts)

    @property
    def sizes(self) -> dict[str, int]:
        """Size of each part of an action that the coalition decides on, in the order of
        `Decision`.
        """
        raters, providers = self._game.roster.n_raters, self._game.roster.n_providers
        parts = {
            "lie": providers * self.rates,
            "quality": providers * bool(self.providers),
            "silence": providers * self.silent,
            "treatment": raters * len(self.providers) * self.treats,
            "claims": providers * self.claims,
        }
        return {name: size for name, size in parts.items() if size}

    @property
    def action_size(self) -> int:
        """Size of an action, see `decision`."""
        return sum(self.sizes.values())

    def actions(self, decision: Decision, memory: CoalitionMemory) -> Actions:
        """Return the actions of all agents that follow from a decision; those of other agents have
        no meaning.

        Args:
            decision: Decision, see `Decision`.
            memory: Memory after `remember`.
        """
        xp, s, nothing = namespace(memory.total), self._game.roster.n_raters, 0 * memory.total
        lie, quality, silence, treatment, claims = decision
        said = nothing + 1 if lie is None else lie_ratings(memory, lie)
        ratings = xp.broadcast_to(said[None, ...], (s, *said.shape))
        withheld = (
            None if silence is None else xp.broadcast_to(silence[None, ...] > 0.5, ratings.shape)
        )
        if treatment is not None:
            treatment = xp.concat([treatment, 0 * treatment[:, :1, ...] + 1], axis=1)[
                :, self._columns, ...
            ]
        return Actions(
            nothing + 1 if quality is None else quality,
            ratings,
            None,
            withheld,
            treatment,
            None if claims is None else xp.broadcast_to(claims[None, ...], ratings.shape),
        )

    def gave(self, memory: CoalitionMemory, actions: Actions) -> CoalitionMemory:
        """Return the memory with the services that the own providers chose in this round."""
        if memory.given is None or actions.treatment is None:
            return memory
        chosen = (actions.treatment * actions.quality[None, ...])[:, self.providers, ...]
        return memory._replace(given=chosen)

    def _published(self, state: State) -> Array:
        """Return the published trust that the coalition sees, to four digits, shape (P, ...).

        Raters see the trust of every provider. Providers see their own, and assume the mean of
        theirs for others.
        """
        top = to_digits(self._game.published(state)[1])
        if self.rates:
            return top
        own = top[self.providers, ...]
        accomplice = self._accomplice.reshape(-1, *[1] * (top.ndim - 1)) > 0
        return namespace(top).where(accomplice, top, own.mean(axis=0))

    def _own_trust(self, state: State) -> Array:
        tor, top = self._game.published(state)
        own = tor[self.raters, ...] if self.rates else top[self.providers, ...]
        return own.mean(axis=0)
