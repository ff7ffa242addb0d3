"""What a round takes and what it leaves behind: actions, luck and state, as tuples of arrays."""

from typing import Any, NamedTuple

from roletrust_env.arrays import Array, cast
from roletrust_env.game.brief import shapes
from roletrust_env.world.heterogeneity import Nature
from roletrust_env.world.mobility import Places
from roletrust_env.world.presence import Population
from roletrust_env.world.rating_delivery import InTransit


class Actions(NamedTuple):
    """What the agents do in one round.

    Attributes:
        quality: of the services, shape (P, ...), in [0, 1].
        ratings: shape (S, P, ...), in [0, 1].
        presence: which identities those with a reserve want to be there, boolean, (N, ...), see `Presence.step`; None
            leaves everybody where they are.
        withheld: which ratings are not sent after all, boolean, (S, P, ...); None where nobody withholds any.
        treatment: the share of its quality that each provider gives each rater, (S, P, ...), in [0, 1]; None where
            everybody serves all raters alike.
    """

    quality: Array
    ratings: Array
    presence: Array | None = None
    withheld: Array | None = None
    treatment: Array | None = None

    def __repr__(self) -> str:
        return shapes(self)


class Counts(NamedTuple):
    """Services that each SR+SP agent rated and provided so far, shape (n_both, ...) each."""

    rated: Array
    provided: Array


class State(NamedTuple):
    """All that a round leaves behind. Parts that a scenario has no use for are None.

    Attributes:
        round: number of rounds played, (...), integer.
        trust: the trust model's own state.
        ratings: the ratings that arrived in the last round, 0 where none did, (S, P, ...).
        rated: where they did, (S, P, ...), boolean.
        quality: as delivered in the last round, (P, ...); of a provider that treats raters differently the mean over
            those it served.
        service: the perceived quality of the services that await their rating, 0 elsewhere, (S, P, ...).
        awaiting: which do, (S, P, ...), boolean.
        value: of the service that each provider provides next, (P, ...).
        counts: services rated and provided so far by SR+SP agents, if there are any.
        population: who is present, if that changes.
        places: where the agents are, if they move.
        transit: the ratings that are late, if any can be.
        nature: what agents are like, as far as they differ from the usual.
        full: whether, in every game, every service awaits its rating, so that nobody need look at `awaiting`.
    """

    round: Array
    trust: Any
    ratings: Array
    rated: Array
    quality: Array
    service: Array
    awaiting: Array
    value: Array
    counts: Counts | None
    population: Population | None
    places: Places | None
    transit: InTransit | None
    nature: Nature
    full: bool

    def __repr__(self) -> str:
        s, p, *batch = self.ratings.shape
        at = f"round: {int(self.round)}" if not batch else f"batch: {tuple(batch)}"
        return f"State({at}, raters: {s}, providers: {p}, trust: {type(self.trust).__name__})"


class Noise(NamedTuple):
    """The luck of one round: uniform in [0, 1), but for `perception`, standard normal. None where unused.

    Shapes: `perception`, `lost`, `late`, `choice` (S, P, ...); `presence` (N, ...); `value` (P, ...); `goal`
    (N, 2, ...); and at the start only `position` (N, 2, ...), `ability` (P, ...), `bias` and `scale` (S, ...).
    """

    perception: Array
    lost: Array | None = None
    late: Array | None = None
    choice: Array | None = None
    presence: Array | None = None
    value: Array | None = None
    goal: Array | None = None
    position: Array | None = None
    ability: Array | None = None
    bias: Array | None = None
    scale: Array | None = None

    def __repr__(self) -> str:
        return shapes(self)


def intended(actions: Actions, nature: Nature) -> Array:
    """The quality that providers have chosen, as far as they are able, (P, ...); or for each rater, (S, P, ...)."""
    quality = actions.quality if nature.ability is None else nature.ability * actions.quality
    return quality if actions.treatment is None else actions.treatment * quality


def fitted(actions: Actions, state: State) -> Actions:
    """Actions in the dtype of a state, so that nobody's double precision spreads to the whole of a game.

    Raises:
        ValueError: they are not of the shapes that the state asks for.
    """
    if actions.quality.shape != state.quality.shape or actions.ratings.shape != state.ratings.shape:
        raise ValueError(
            f"actions have shapes {tuple(actions.quality.shape)} and {tuple(actions.ratings.shape)}; needed are "
            f"(P, ...) = {tuple(state.quality.shape)} and (S, P, ...) = {tuple(state.ratings.shape)}"
        )
    wanted, population = actions.presence, state.population
    if wanted is not None and (population is None or wanted.shape != population.phase.shape):
        raise ValueError(
            f"presence has the shape {tuple(wanted.shape)}; it must be (N, ...), or None where nobody comes or goes"
        )
    for name, cells, nobody in (
        ("withheld", actions.withheld, "withholds a rating"),
        ("treatment", actions.treatment, "treats raters differently"),
    ):
        if cells is not None and cells.shape != state.ratings.shape:
            raise ValueError(
                f"{name} has the shape {tuple(cells.shape)}; it must be (S, P, ...) = "
                f"{tuple(state.ratings.shape)}, or None where nobody {nobody}"
            )
    parts = {"quality": actions.quality, "ratings": actions.ratings, "treatment": actions.treatment}
    dtype = state.ratings.dtype
    others = {name: cast(part, dtype) for name, part in parts.items() if part is not None and part.dtype != dtype}
    return actions._replace(**others) if others else actions
