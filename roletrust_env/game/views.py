"""The views of agents, as named fields and as the flat vector of an observation space.

A view is that of one agent and may have further axes: agents with a common view, then the batch. A
field has shape (...) if it is one number, (P, ...) if there is one per provider, (S, ...) if there
is one per rater.
"""

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import Array, namespace
from roletrust_env.game.brief import shapes
from roletrust_env.shapes import (
    GameFlags,
    PairFlags,
    PerGame,
    PerPair,
    PerProvider,
    PerRater,
    ProviderFlags,
    RaterFlags,
    Shape,
)

ObservationVector: TypeAlias = Annotated[Array, Shape("K ...")]
"""Observation of an agent or of an attacker as a flat vector, shape (K, ...)."""


class ProviderView(NamedTuple):
    """The view of a provider.

    Attributes:
        round: Number of the round, shape (...).
        trust: Its own ToP, shape (...).
        value: Value of its next service relative to the highest value, shape (...).
        quality: Quality of its last service, which has no rating yet, shape (...).
        ratings: Ratings of it that arrived in the last round, shape (S, ...); 0 where none did.
        rated: Whether a rating of it arrived, boolean, shape (S, ...).
    """

    round: PerGame
    trust: PerGame
    value: PerGame
    quality: PerGame
    ratings: PerRater
    rated: RaterFlags

    def __repr__(self) -> str:
        return shapes(self)


class RaterView(NamedTuple):
    """The view of a rater.

    Attributes:
        round: Number of the round, shape (...).
        trust: Its own ToR, shape (...).
        published: Published ToP of every provider, shape (P, ...).
        service: Perceived quality of the services that await its rating, shape (P, ...); 0 where
            none does. With a deadline above 1, these can be services of earlier rounds.
        awaiting: Whether a service awaits its rating, boolean, shape (P, ...).
        ratings: Its ratings that arrived in the last round, shape (P, ...); 0 where none did.
        rated: Whether its rating arrived, boolean, shape (P, ...).
    """

    round: PerGame
    trust: PerGame
    published: PerProvider
    service: PerProvider
    awaiting: ProviderFlags
    ratings: PerProvider
    rated: ProviderFlags

    def __repr__(self) -> str:
        return shapes(self)


class SparseRaterView(NamedTuple):
    """The view of a rater in a `SparseGame`: a `RaterView` with a row for each of the K providers
    that it met.

    A policy that takes providers one by one reads it like a `RaterView`.

    Attributes:
        round: Number of the round, shape (...).
        trust: Its own ToR, shape (...).
        published: Published ToP of the providers that it met, shape (K, ...).
        service: Perceived quality of the services that await its rating, shape (K, ...); 0 where
            none does.
        awaiting: Whether a service awaits its rating, boolean, shape (K, ...).
        ratings: Its ratings of those that it met the round before, as they arrived, shape (K, ...);
            0 where none did.
        rated: Whether such a rating arrived, boolean, shape (K, ...).
        met: Index of the provider of each row, whole, shape (K, ...).
    """

    round: PerGame
    trust: PerGame
    published: Annotated[Array, Shape("K ...")]
    service: Annotated[Array, Shape("K ...")]
    awaiting: Annotated[Array, Shape("K ...", "bool")]
    ratings: Annotated[Array, Shape("K ...")]
    rated: Annotated[Array, Shape("K ...", "bool")]
    met: Annotated[Array, Shape("K ...", "whole")]

    def __repr__(self) -> str:
        return shapes(self)


class AgentView(NamedTuple):
    """The view of an SR+SP agent: its own ToA, shape (...), and the views of its two roles."""

    trust: PerGame
    provider: ProviderView
    rater: RaterView

    def __repr__(self) -> str:
        return shapes(self)


class IdentityView(NamedTuple):
    """The view of an identity by its owner.

    Attributes:
        round: Number of the round, shape (...).
        trust: Trust of the identity by its role, shape (...).
        turn: 0 for the first identity of the owner, 1 and more for those in reserve, shape (...).
        present: Whether the identity is present, boolean, shape (...).
        succeeds: Whether the identity before it is gone for good, boolean, shape (...).
    """

    round: Annotated[Array, Shape("...", "number")]
    trust: PerGame
    turn: PerGame
    present: GameFlags
    succeeds: GameFlags

    def __repr__(self) -> str:
        return shapes(self)


View = TypeVar("View", ProviderView, RaterView)


def make_views(
    round: PerGame,
    tor: PerRater,
    top: PerProvider,
    value: PerProvider,
    quality: PerProvider,
    service: PerPair,
    awaiting: PairFlags,
    ratings: PerPair,
    rated: PairFlags,
) -> tuple[ProviderView, RaterView]:
    """Return the views of all providers, with one further axis (P, ...), and of all raters, with
    one (S, ...).

    Args:
        round: Number of the round, shape (...).
        tor: Trust of the raters, shape (S, ...).
        top: Trust of the providers, shape (P, ...).
        value: Value of the next service of each provider, shape (P, ...).
        quality: Quality of the last service of each provider, shape (P, ...).
        service: Perceived quality of the services that await their rating, shape (S, P, ...).
        awaiting: Whether a service awaits its rating, shape (S, P, ...).
        ratings: Ratings that arrived in the last round, shape (S, P, ...).
        rated: Whether a rating arrived, shape (S, P, ...).
    """
    broadcast = namespace(tor).broadcast_to
    of_each_rater = (grid.swapaxes(0, 1) for grid in (service, awaiting, ratings, rated))
    published = broadcast(top[:, None, ...], (*top.shape[:1], *tor.shape))
    provider = ProviderView(broadcast(round, top.shape), top, value, quality, ratings, rated)
    return provider, RaterView(broadcast(round, tor.shape), tor, published, *of_each_rater)


def view_of(views: View, place: int) -> View:
    """Return the view of one agent from those of all agents of its role, see `make_views`."""
    at: tuple[Any, ...] = (..., place, *[slice(None)] * (views.trust.ndim - 1))
    return type(views)(*(field[at] for field in views))


@dataclass(frozen=True)
class ViewLayout:
    """The positions of the fields of a view in the observation vector.

    An observation has shape (K, ...), every entry in [0, 1]: the fields of the view one after the
    other, the round as a share of the game's length. An SR+SP agent's is its ToA, then the
    provider's fields, then the rater's.

    Attributes:
        n_raters: S.
        n_providers: P.
        max_cycles: length of the game in rounds.
    """

    n_raters: int
    n_providers: int
    max_cycles: int

    @property
    def provider_size(self) -> int:
        """Size K of the observation of a provider: 4 + 2 S."""
        return 4 + 2 * self.n_raters

    @property
    def rater_size(self) -> int:
        """Size K of the observation of a rater: 2 + 5 P."""
        return 2 + 5 * self.n_providers

    def flatten(self, view: View) -> ObservationVector:
        """Return the observation vector of the view of a provider or a rater."""
        agent_ndim, (round, *rest) = view.trust.ndim, view
        parts = [
            field if field.ndim > agent_ndim else field[None, ...]
            for field in (round / self.max_cycles, *rest)
        ]
        return namespace(view.trust).concat(parts)

    def places(self) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """Return the positions of the entries of raters' observations, (K, S), and of providers',
        (K, P), in a vector.

        The vector has the clock, ToR (S), ToP (P), the value of the next services (P), delivered
        quality (P), perceived quality, what awaits a rating, ratings and where they arrived (S x P
        each). A single game is observed faster entry by entry than field by field.
        """
        s, p = self.n_raters, self.n_providers
        sizes = (1, s, p, p, p, *[s * p] * 4)
        clock, tor, top, value, quality, *grids = np.split(
            np.arange(sum(sizes)), np.cumsum(sizes)[:-1]
        )
        provider, rater = make_views(
            clock[0], tor, top, value, quality, *(grid.reshape(s, p) for grid in grids)
        )
        # The place of the clock is 0, as a share of the game's length too.
        return self.flatten(rater).astype(np.intp), self.flatten(provider).astype(np.intp)

    def flatten_both(self, view: AgentView) -> ObservationVector:
        """Return the observation vector of the view of an SR+SP agent."""
        parts = [view.trust[None, ...], self.flatten(view.provider), self.flatten(view.rater)]
        return namespace(view.trust).concat(parts)

    def provider(self, observation: ObservationVector) -> ProviderView:
        """Return the view in the observation of a provider."""
        o, s = observation, self.n_raters
        return ProviderView(self._round(o), o[1], o[2], o[3], o[4 : 4 + s], o[4 + s :] > 0.5)

    def rater(self, observation: ObservationVector) -> RaterView:
        """Return the view in the observation of a rater."""
        o, p = observation, self.n_providers
        published, service, awaiting, ratings, rated = (
            o[2 + k * p : 2 + (k + 1) * p] for k in range(5)
        )
        return RaterView(
            self._round(o), o[1], published, service, awaiting > 0.5, ratings, rated > 0.5
        )

    def both(self, observation: ObservationVector) -> AgentView:
        """Return the view in the observation of an SR+SP agent."""
        end = 1 + self.provider_size
        return AgentView(
            observation[0], self.provider(observation[1:end]), self.rater(observation[end:])
        )

    def _round(self, observation: Array) -> Array:
        return namespace(observation).round(observation[0] * self.max_cycles)
