"""What an agent may see, as named fields and as the flat vector of its observation space.

Every view is of one agent and may have further axes: agents that are looked at together, then the batch. A field has
shape (...) if it is one number, (P, ...) if there is one per provider, (S, ...) if there is one per rater.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import Array, namespace
from roletrust_env.game.brief import shapes


class ProviderView(NamedTuple):
    """What a provider sees.

    Attributes:
        round: number of the round, (...).
        trust: its own ToP, (...).
        value: value of the service that it provides next, as a share of the dearest, (...).
        quality: of the service that it provided last, which nobody has rated yet, (...).
        ratings: the ratings of it that arrived in the last round, 0 where none did, (S, ...).
        rated: where a rater's rating arrived, boolean, (S, ...).
    """

    round: Array
    trust: Array
    value: Array
    quality: Array
    ratings: Array
    rated: Array

    def __repr__(self) -> str:
        return shapes(self)


class RaterView(NamedTuple):
    """What a rater sees.

    Attributes:
        round: number of the round, (...).
        trust: its own ToR, (...).
        published: the published ToP of every provider, (P, ...).
        service: the perceived quality of the services that await its rating, 0 where none does, (P, ...).
        awaiting: where a service awaits its rating, boolean, (P, ...).
        ratings: its ratings that arrived in the last round, 0 where none did, (P, ...).
        rated: where one arrived, boolean, (P, ...).
    """

    round: Array
    trust: Array
    published: Array
    service: Array
    awaiting: Array
    ratings: Array
    rated: Array

    def __repr__(self) -> str:
        return shapes(self)


class AgentView(NamedTuple):
    """What an agent with both roles sees: its own ToA, (...), and what each of its roles sees."""

    trust: Array
    provider: ProviderView
    rater: RaterView

    def __repr__(self) -> str:
        return shapes(self)


class IdentityView(NamedTuple):
    """What an owner of several identities knows of one of them.

    Attributes:
        round: number of the round, (...).
        trust: of the identity, by its role, (...).
        turn: 0 for the owner's first identity, from 1 on for those in reserve, (...).
        present: whether it is there, boolean, (...).
        succeeds: whether the identity before it is gone for good, boolean, (...).
    """

    round: Array
    trust: Array
    turn: Array
    present: Array
    succeeds: Array

    def __repr__(self) -> str:
        return shapes(self)


View = TypeVar("View", ProviderView, RaterView)


def look(
    round: Array,
    tor: Array,
    top: Array,
    value: Array,
    quality: Array,
    service: Array,
    awaiting: Array,
    ratings: Array,
    rated: Array,
) -> tuple[ProviderView, RaterView]:
    """What all providers see, with one further axis (P, ...), and what all raters see, with one (S, ...).

    Args:
        round: number of the round, (...).
        tor: trust of the raters, (S, ...).
        top: trust of the providers, (P, ...).
        value: of the service that each provider provides next, (P, ...).
        quality: of the service that each provided last, (P, ...).
        service: perceived quality of the services that await their rating, (S, P, ...).
        awaiting: which do, (S, P, ...).
        ratings: the ratings that arrived in the last round, (S, P, ...).
        rated: where they did, (S, P, ...).
    """
    over = namespace(tor).broadcast_to
    of_each_rater = (grid.swapaxes(0, 1) for grid in (service, awaiting, ratings, rated))
    published = over(top[:, None, ...], (*top.shape[:1], *tor.shape))
    provider = ProviderView(over(round, top.shape), top, value, quality, ratings, rated)
    return provider, RaterView(over(round, tor.shape), tor, published, *of_each_rater)


def view_of(views: View, place: int) -> View:
    """What one agent sees of what all of its role see, as from `look`."""
    at: tuple[Any, ...] = (..., place, *[slice(None)] * (views.trust.ndim - 1))
    return type(views)(*(field[at] for field in views))


@dataclass(frozen=True)
class Layout:
    """Where each field of a view stands in the observation vector.

    An observation has shape (K, ...), every entry in [0, 1]: the fields of the view one after the other, the round as a
    share of the game's length. An SR+SP agent's is its ToA, then the provider's fields, then the rater's.

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
        """K of a provider: 4 + 2 S."""
        return 4 + 2 * self.n_raters

    @property
    def rater_size(self) -> int:
        """K of a rater: 2 + 5 P."""
        return 2 + 5 * self.n_providers

    def flatten(self, view: View) -> Array:
        """The observation vector of a provider's or a rater's view."""
        one, (round, *rest) = view.trust.ndim, view
        parts = [field if field.ndim > one else field[None, ...] for field in (round / self.max_cycles, *rest)]
        return namespace(view.trust).concat(parts)

    def places(self) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """Where the entries of the raters' observations, (K, S), and of the providers', (K, P), are in a vector.

        The vector has the clock, ToR (S), ToP (P), the value of the next services (P), delivered quality (P), perceived
        quality, what awaits a rating, ratings and where they arrived (S x P each). A single game is observed faster
        entry by entry than field by field.
        """
        s, p = self.n_raters, self.n_providers
        sizes = (1, s, p, p, p, *[s * p] * 4)
        clock, tor, top, value, quality, *grids = np.split(np.arange(sum(sizes)), np.cumsum(sizes)[:-1])
        provider, rater = look(clock[0], tor, top, value, quality, *(grid.reshape(s, p) for grid in grids))
        # The place of the clock is 0, as a share of the game's length too.
        return self.flatten(rater).astype(np.intp), self.flatten(provider).astype(np.intp)

    def flatten_both(self, view: AgentView) -> Array:
        """The observation vector of an SR+SP agent's view."""
        parts = [view.trust[None, ...], self.flatten(view.provider), self.flatten(view.rater)]
        return namespace(view.trust).concat(parts)

    def provider(self, observation: Array) -> ProviderView:
        """The view that a provider's observation holds."""
        o, s = observation, self.n_raters
        return ProviderView(self._round(o), o[1], o[2], o[3], o[4 : 4 + s], o[4 + s :] > 0.5)

    def rater(self, observation: Array) -> RaterView:
        """The view that a rater's observation holds."""
        o, p = observation, self.n_providers
        published, service, awaiting, ratings, rated = (o[2 + k * p : 2 + (k + 1) * p] for k in range(5))
        return RaterView(self._round(o), o[1], published, service, awaiting > 0.5, ratings, rated > 0.5)

    def both(self, observation: Array) -> AgentView:
        """The view that an SR+SP agent's observation holds."""
        end = 1 + self.provider_size
        return AgentView(observation[0], self.provider(observation[1:end]), self.rater(observation[end:]))

    def _round(self, observation: Array) -> Array:
        return namespace(observation).round(observation[0] * self.max_cycles)
