"""What a coalition knows in common, and what it decides: the same features and decisions for any number of providers.

The compromised agents share what they see. Each provider gets the same features, so a network that treats providers
alike plays with 6 of them and with 60. `CoalitionTask` offers this as observation and action of an attack task.
"""

import numpy as np

from roletrust_env.arrays import Array, cast, mean_or_zero, namespace
from roletrust_env.game.attacker_side import places
from roletrust_env.game.coalition_features import CoalitionMemory, lie_ratings, provider_features, to_digits
from roletrust_env.game.game import Game
from roletrust_env.game.state import Actions, State
from roletrust_env.world.presence import PRESENT

IDENTITY_FEATURES = ("turn", "trust", "present", "succeeds", "provides", "clock")
"""Names of the features of an identity, see `Coalition.identity_features`."""


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
        return CoalitionMemory.begin(0 * state.quality + self._game.scenario.initial_trust)

    def remember(self, state: State, memory: CoalitionMemory) -> CoalitionMemory:
        """Return the memory with what the coalition sees in a state. Call it once in every round."""
        memory = memory.remember(self._published(state))
        if not self.rates:
            return memory
        return memory.perceive(state.service[self.raters, ...], state.awaiting[self.raters, ...])

    def features(self, state: State, memory: CoalitionMemory) -> Array:
        """Return the features of each provider, shape (F, P, ...), see `provider_features`.

        `last_lie` is the mean over the raters of the coalition. `own_trust` is the mean published ToR of them; without
        any, the mean ToP of its providers. The perceived quality is a mean over all its raters and rounds, so it has
        less noise than the perception of any honest rater.
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
                its lie about each provider, which all its raters tell, see `lie_ratings`. If it provides, the last P
                numbers are the qualities of the providers, and those of providers of others are ignored.
            memory: Memory after `remember`.
        """
        p = memory.total.shape[0]
        said = quality = 0 * memory.total + 1
        if self.rates:
            said = lie_ratings(memory, decision[:p, ...])
        if self.providers:
            quality = decision[-p:, ...]
        ratings = namespace(said).broadcast_to(said[None, ...], (self._game.roster.n_raters, *said.shape))
        return Actions(quality, ratings)

    def _published(self, state: State) -> Array:
        """Return the published trust that the coalition sees, to four digits, shape (P, ...).

        Raters see the trust of every provider. Providers see their own, and assume the mean of theirs for others.
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
