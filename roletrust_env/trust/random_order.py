"""Agents at random places, so that a trust model cannot know who attacks by where it stands among
the agents.
"""

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from roletrust_env.arrays import Array, namespace
from roletrust_env.shapes import PerPair, PerProvider, PerRater, Shape
from roletrust_env.trust.model import Traits, TrustModel, start_model
from roletrust_env.trust.ratings import Ratings


class OrderedState(NamedTuple):
    """State of a model, and the agents at the places that it sees: raters (S, ...) and providers
    (P, ...).
    """

    inner: Any
    raters: Annotated[Array, Shape("S ...", "whole")]
    providers: Annotated[Array, Shape("P ...", "whole")]


@dataclass(frozen=True, eq=False)
class RandomOrder:
    """A trust model that sees the agents of each game in another order, which stays the same during
    the game.

    Trust comes back in the order of the game. A model that treats all agents alike gives the same
    trust as without.

    Attributes:
        model: The trust model.
        seed: Random seed of the orders.
    """

    model: TrustModel[Any]
    seed: int = 0

    takes_peers = True

    def __getattr__(self, name: str) -> Any:
        """Return a property of the model, see `Traits`, or `judge_trust` or `preference` if the
        model has it.
        """
        own = {"judge_trust": self._judge_trust, "preference": self._preference}
        if name not in (*Traits._fields, *own):
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        attribute = getattr(self.model, name)
        return own.get(name, attribute)

    def start(self, like: PerPair, peers: Any) -> OrderedState:
        """Draw the order of each game. See `TrustModel.start`.

        Games that differ only by the attacker, along all axes of the batch but the last, have the
        same order.

        Raises:
            ValueError: An agent is both rater and provider: its two places cannot change apart from
                each other.
        """
        if bool(peers.any()):
            raise ValueError("agents cannot change places where one is both rater and provider")
        xp, (raters, providers, *batch) = namespace(like), like.shape
        random, games = np.random.default_rng(self.seed), batch[-1:]
        orders = (np.argsort(random.random((many, *games)), axis=0) for many in (raters, providers))
        spread = (
            np.broadcast_to(
                order.reshape(len(order), *[1] * len(batch[:-1]), *games), (len(order), *batch)
            )
            for order in orders
        )
        return OrderedState(
            start_model(self.model, like, peers),
            *(xp.asarray(array.copy(), device=like.device) for array in spread),
        )

    def update(self, state: OrderedState, ratings: Ratings) -> OrderedState:
        """Return the state after one more round. See `TrustModel.update`."""
        experience = ratings.experience
        own = None if experience is ratings else _in_order(experience, state)
        return state._replace(inner=self.model.update(state.inner, _in_order(ratings, state, own)))

    def rater_trust(self, state: OrderedState) -> PerRater:
        """Return the trust of each rater. See `TrustModel.rater_trust`."""
        return _back(self.model.rater_trust(state.inner), state.raters)

    def provider_trust(self, state: OrderedState) -> PerProvider:
        """Return the trust of each provider. See `TrustModel.provider_trust`."""
        return _back(self.model.provider_trust(state.inner), state.providers)

    def _judge_trust(self, state: OrderedState) -> PerPair:
        return _both_back(self.model.judge_trust(state.inner), state)  # type: ignore[attr-defined]

    def _preference(self, state: OrderedState, noise: PerPair) -> PerPair:
        wanted = self.model.preference(state.inner, _seen(noise, state))  # type: ignore[attr-defined]
        return _both_back(wanted, state)


def _in_order(ratings: Ratings, state: OrderedState, experience: Ratings | None = None) -> Ratings:
    """Return ratings in the order that the model sees, with this experience."""
    mask = None if ratings.mask is None else _seen(ratings.mask, state)
    return Ratings(_seen(ratings.values, state), mask, experience=experience)


def _seen(values: Array, state: OrderedState) -> Array:
    """Return values of shape (S, P, ...) in the order that the model sees."""
    return _take(_take(values, state.raters[:, None, ...], 0), state.providers[None, ...], 1)


def _both_back(values: Array, state: OrderedState) -> Array:
    """Return values of shape (S, P, ...) in the order of the game."""
    return _back(_back(values, state.raters[:, None, ...]), state.providers[None, ...], axis=1)


def _back(values: Array, order: Array, axis: int = 0) -> Array:
    """Return values in the order of the game."""
    return _take(values, namespace(order).argsort(order, axis=axis), axis)


def _take(values: Array, places: Array, axis: int) -> Array:
    """Return the values at places along an axis; of size 1, the other axis is broadcast."""
    xp = namespace(values)
    return xp.take_along_axis(values, xp.broadcast_to(places, values.shape), axis=axis)
