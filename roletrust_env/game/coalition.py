"""What a coalition knows in common, and what it decides: the same features and decisions for any number of providers.

The compromised agents share what they see. Each provider gets the same features, so a network that treats providers
alike plays with 6 of them and with 60. `CoalitionTask` offers this as observation and action of an attack task.
"""

from typing import NamedTuple

import numpy as np

from roletrust_env.arrays import Array, cast, largest, mean_or_zero, mean_places, namespace
from roletrust_env.game.attacker_side import places
from roletrust_env.game.game import Game
from roletrust_env.game.state import Actions, State
from roletrust_env.world.presence import PRESENT

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
"""Names of the features of a provider, see `Coalition.features`."""

IDENTITY_FEATURES = ("turn", "trust", "present", "succeeds", "provides", "clock")
"""Names of the features of an identity, see `Coalition.identity_features`."""

REACH = 1.5
"""Largest distance of a lie from the perceived quality, before it is cut to [0, 1]."""

_STEPS = 10_000.0  # of published trust: providers that are alike tie, whatever the rounding errors
_CHANGES, _LEADS = 5.0, 10.0  # small differences of trust decide; this brings them near the size of other features


class CoalitionMemory(NamedTuple):
    """What a coalition remembers.

    Attributes:
        total: Sum of the perceived qualities of each provider, over its raters and the rounds, shape (P, ...).
        count: Number of these perceptions, shape (P, ...).
        published: Published trust of each provider as far as the coalition sees it, shape (P, ...).
        change: Change of that trust in the last round, shape (P, ...).
    """

    total: Array
    count: Array
    published: Array
    change: Array


class Coalition:
    """The compromised agents of a game as one mind.

    Args:
        game: Game.
        identities: Names of the compromised agents and of their identities in reserve.

    Attributes:
        rates: Whether any of them rates.
        raters: Indices of its raters on the rater axis.
        providers: Indices of its providers on the provider axis.
        action_size: Size of a decision, see `actions`.
        has_reserve: Whether any of them has identities in reserve.
    """

    def __init__(self, game: Game, identities: tuple[str, ...]) -> None:
        roster = game.roster
        self._game = game
        self.raters = places(identities, roster.rater_names)
        self.providers = places(identities, roster.provider_names)
        self.rates = bool(self.raters)
        self.action_size = roster.n_providers * (self.rates + bool(self.providers))
        own = np.isin(np.arange(roster.n_providers), self.providers)
        xp, like = namespace(game.like), game.like
        self._accomplice = xp.asarray(own, dtype=like.dtype, device=like.device)
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
        nothing = 0 * state.quality
        published = nothing + self._game.scenario.initial_trust
        return CoalitionMemory(nothing, nothing, published, nothing)

    def remember(self, state: State, memory: CoalitionMemory) -> CoalitionMemory:
        """Return the memory with what the coalition sees in a state. Call it once in every round."""
        published = self._published(state)
        total, count = memory.total, memory.count
        if self.rates:
            awaiting = state.awaiting[self.raters, ...]
            total = total + (state.service[self.raters, ...] * awaiting).sum(axis=0)
            count = count + awaiting.sum(axis=0, dtype=total.dtype)
        return CoalitionMemory(total, count, published, published - memory.published)

    def perceived(self, memory: CoalitionMemory) -> Array:
        """Return the mean perceived quality of each provider, shape (P, ...); its published trust where there is none.

        It is the mean over all its raters and rounds, so it has less noise than the perception of any honest rater.
        """
        xp = namespace(memory.total)
        return xp.where(memory.count > 0, memory.total / (memory.count + (memory.count == 0)), memory.published)

    def features(self, state: State, memory: CoalitionMemory) -> Array:
        """Return the features of each provider, shape (F, P, ...), in [-1, 1], in the order of `FEATURES`.

        - `published`, `published_rank`: its published trust to four digits, and the rank of that, 0 for the highest and
          1 for the lowest; `published_change`: five times the change in the last round.
        - `perceived`, `perceived_rank`: its mean perceived quality, see `perceived`, and the rank of that.
        - `published_less_perceived`: the difference of the two.
        - `last_lie`: mean rating of it by the coalition that arrived in the last round, less the perceived quality.
        - `most_trusted`: 1 for a provider with the highest published trust, to which consumers go, else 0; `lead`: ten
          times its published trust less the highest one of the others, cut to [-1, 1].
        - `perceived_gap`: distance to the best perceived quality.
        - `accomplice`: 1 for a provider of the coalition, else 0.
        - `served`: 1 if its service awaits a rating of the coalition, else 0.
        - `own_trust`: mean published ToR of the raters of the coalition; without any, mean ToP of its providers.
        - `own_share`: share of the raters that belong to the coalition.
        - `clock`: share of the game that is over.
        """
        xp, published, perceived = namespace(memory.total), memory.published, self.perceived(memory)
        nothing = 0 * published
        lie = served = nothing
        if self.rates:
            rated = state.rated[self.raters, ...]
            said = mean_or_zero(state.ratings[self.raters, ...], rated)
            lie = xp.where(rated.any(axis=0), said - perceived, nothing)
            served = cast(state.awaiting[self.raters, ...].any(axis=0), published.dtype)
        accomplice = self._accomplice.reshape(-1, *[1] * (published.ndim - 1))
        clock = cast(state.round, published.dtype) / self._game.scenario.max_cycles
        rows = (
            published,
            _rank(published),
            xp.clip(_CHANGES * memory.change, -1.0, 1.0),
            perceived,
            _rank(perceived),
            published - perceived,
            lie,
            cast(published == largest(published), published.dtype),
            xp.clip(_LEADS * (published - _best_other(published)), -1.0, 1.0),
            largest(perceived) - perceived,
            nothing + accomplice,
            served,
            nothing + self._own_trust(state),
            nothing + self._share,
            nothing + clock,
        )
        return xp.stack(rows)

    def identity_features(self, state: State) -> Array:
        """Return the features of each own identity, shape (I, n, ...), in [0, 1], in the order of `IDENTITY_FEATURES`.

        - `turn`: 0 for the first identity of an agent, 1 for its last one in reserve.
        - `trust`: its published trust by its role.
        - `present`: whether it is present; `succeeds`: whether the identity before it is gone for good.
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

    def wanted(self, chosen: Array) -> Array:
        """Return which identities of all agents shall be present, boolean, shape (N, ...), from a choice for own ones.

        Args:
            chosen: Whether each own identity shall be present, boolean, shape (n, ...).
        """
        xp, n = namespace(chosen), len(self._game.roster.names)
        order = [self._agents.index(place) if place in self._agents else len(self._agents) for place in range(n)]
        return xp.concat([chosen, chosen[:1, ...] & False])[order, ...]

    def actions(self, decision: Array, memory: CoalitionMemory) -> Actions:
        """Return the actions of all agents that follow from a decision; those of other agents have no meaning.

        Args:
            decision: Decision of shape (action_size, ...), in [0, 1]. If the coalition rates, the first P numbers are
                its lie about each provider: all its raters report the perceived quality plus `REACH` times (2 x - 1),
                cut to [0, 1], so 0.5 is the truth without noise. If it provides, the last P numbers are the qualities
                of the providers, and those of providers of others are ignored.
            memory: Memory after `remember`.
        """
        xp, p = namespace(decision), memory.total.shape[0]
        said = quality = 0 * memory.total + 1
        if self.rates:
            said = xp.clip(self.perceived(memory) + REACH * (2 * decision[:p, ...] - 1), 0.0, 1.0)
        if self.providers:
            quality = decision[-p:, ...]
        ratings = xp.broadcast_to(said[None, ...], (self._game.roster.n_raters, *said.shape))
        return Actions(quality, ratings)

    def _published(self, state: State) -> Array:
        """Return the published trust that the coalition sees, to four digits, shape (P, ...).

        Raters see the trust of every provider. Providers see their own, and assume the mean of theirs for others.
        """
        top = self._game.published(state)[1]
        top = namespace(top).round(_STEPS * top) / _STEPS
        if self.rates:
            return top
        own = top[self.providers, ...]
        accomplice = self._accomplice.reshape(-1, *[1] * (top.ndim - 1)) > 0
        return namespace(top).where(accomplice, top, own.mean(axis=0))

    def _own_trust(self, state: State) -> Array:
        tor, top = self._game.published(state)
        own = tor[self.raters, ...] if self.rates else top[self.providers, ...]
        return own.mean(axis=0)


def _best_other(values: Array) -> Array:
    """Return the highest of the other values for each value along the first axis; the value itself if it is alone."""
    xp, top = namespace(values), largest(values)
    highest = values == top
    if values.shape[0] == 1:
        return values
    second = largest(xp.where(highest, xp.min(values, axis=0), values))
    alone = highest.sum(axis=0) == 1
    return xp.where(highest & alone, second, top)


def _rank(values: Array) -> Array:
    """Return the rank of each value along the first axis: 0 for the highest, 1 for the lowest; ties share the mean."""
    return mean_places(values) / max(1, values.shape[0] - 1)
