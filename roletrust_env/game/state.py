"""Actions, noise and state of a round, as tuples of arrays."""

from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from array_api_compat import to_device

from roletrust_env.arrays import Array, cast, check_within, namespace
from roletrust_env.game.brief import shapes
from roletrust_env.shapes import (
    AgentFlags,
    PairFlags,
    PerAgent,
    PerPair,
    PerProvider,
    PerRater,
    Shape,
)
from roletrust_env.trees import map_leaves
from roletrust_env.world.heterogeneity import AgentProperties
from roletrust_env.world.mobility import Motion
from roletrust_env.world.presence import Population
from roletrust_env.world.rating_delivery import Due, InTransit

Action: TypeAlias = Annotated[Array, Shape("A ...")]
"""Action of an attacker as one vector, shape (A, ...)."""


class Actions(NamedTuple):
    """The actions of all agents in one round.

    Attributes:
        quality: Quality of the services, shape (P, ...), in [0, 1].
        ratings: Ratings, shape (S, P, ...), in [0, 1].
        presence: Identities that agents with a reserve want to be present, boolean, shape (N, ...),
            see `Presence.step`; None changes nothing.
        withheld: Ratings that are not sent, boolean, shape (S, P, ...); None where all are sent.
        treatment: Share of its quality that each provider gives each rater, shape (S, P, ...), in
            [0, 1]; None where providers serve all raters alike.
        claims: Priority of a rating without a service, shape (S, P, ...), in [0, 1], see
            `RatingDelivery.open`; 0 sends none, and so does None. They are ignored where reports
            are verified.
    """

    quality: PerProvider
    ratings: PerPair
    presence: AgentFlags | None = None
    withheld: PairFlags | None = None
    treatment: PerPair | None = None
    claims: PerPair | None = None

    def __repr__(self) -> str:
        return shapes(self)


class CheckedActions(Actions):
    """Actions that an environment has checked: they fit the state, and lie in [0, 1]."""

    __slots__ = ()


class Counts(NamedTuple):
    """Services that each SR+SP agent rated and provided so far, shape (n_both, ...) each."""

    rated: Annotated[Array, Shape("n_both ...")]
    provided: Annotated[Array, Shape("n_both ...")]


class State(NamedTuple):
    """The state of a game after a round. Parts that a scenario does not use are None.

    Attributes:
        round: Number of rounds played, integer, shape (...).
        trust: State of the trust model.
        ratings: Ratings that arrived in the last round, shape (S, P, ...); 0 where none did.
        rated: Whether a rating arrived, boolean, shape (S, P, ...).
        quality: Quality delivered in the last round, shape (P, ...); for a provider that treats
            raters differently the mean over the raters that it served.
        service: Perceived quality of the services of the last round, shape (S, P, ...); 0
            elsewhere.
        awaiting: Whether there is such a service, which awaits its rating, boolean, shape (S, P,
            ...).
        value: Value of the next service of each provider, shape (P, ...).
        counts: Services that SR+SP agents rated and provided; None without such agents.
        population: Presence of the agents; None where it never changes.
        motion: Positions and waypoints of the agents, if they move.
        transit: Ratings that are late; None where none can be.
        properties: Properties in which agents differ; the abilities are those of the next services.
        met: Index of the provider of each cell of `service` and `awaiting`, shape (S, K), in a
            `SparseGame`, whose cells are (S, K) in place of (S, P, ...); None elsewhere.
        due: Services of earlier rounds that can still be rated; None where the deadline is 1.
    """

    round: Annotated[Array, Shape("...", "whole")]
    trust: Any
    ratings: PerPair
    rated: PairFlags
    quality: PerProvider
    service: PerPair
    awaiting: PairFlags
    value: PerProvider
    counts: Counts | None
    population: Population | None
    motion: Motion | None
    transit: InTransit | None
    properties: AgentProperties
    met: Annotated[Array, Shape("S K", "whole")] | None = None
    due: Due | None = None

    def __repr__(self) -> str:
        # The leaves may be anything: JAX maps trees to shapes, axes and tracers.
        shape: tuple[int, ...] = getattr(self.ratings, "shape", ())
        if len(shape) < 2:
            return shapes(self)
        single = isinstance(self.round, np.ndarray | np.generic) and not self.round.ndim
        at = f"round: {self.round}" if single else f"batch: {tuple(shape[2:])}"
        trust = type(self.trust).__name__
        return f"State({at}, raters: {shape[0]}, providers: {shape[1]}, trust: {trust})"


class Noise(NamedTuple):
    """The noise of one round: uniform in [0, 1), except `perception` and `drift`, which are
    standard normal. None where unused.

    Shapes: `perception`, `lost`, `late` (S, P, ...), in a `SparseGame` (S, K); `claim` (S, P, ...);
    `choice` (S, P, ...), for encounters with k providers (S, k, ...); `explore` (S, ...);
    `presence` (N, ...); `value`, `drift`, `switch` (P, ...); `goal` (N, 2, ...); and at the start
    only `position` (N, 2, ...), `ability` (P, ...), `bias` and `scale` (S, ...).
    """

    perception: PerPair
    lost: PerPair | None = None
    late: PerPair | None = None
    choice: Annotated[Array, Shape("S k ...")] | None = None
    presence: PerAgent | None = None
    value: PerProvider | None = None
    goal: Annotated[Array, Shape("N 2 ...")] | None = None
    position: Annotated[Array, Shape("N 2 ...")] | None = None
    ability: PerProvider | None = None
    bias: PerRater | None = None
    scale: PerRater | None = None
    explore: PerRater | None = None
    claim: PerPair | None = None
    drift: PerProvider | None = None
    switch: PerProvider | None = None

    def __repr__(self) -> str:
        return shapes(self)


_IN_RANGE = "quality", "ratings", "treatment", "claims"
"""Fields of `Actions` whose values lie in [0, 1]."""


def intended(actions: Actions, properties: AgentProperties) -> PerProvider | PerPair:
    """Return the chosen quality within the ability of the providers, shape (P, ...), or (S, P, ...)
    for each rater.
    """
    quality = (
        actions.quality if properties.ability is None else properties.ability * actions.quality
    )
    return quality if actions.treatment is None else actions.treatment * quality


def rateable(state: State) -> tuple[PerPair, PairFlags]:
    """Return the perceived quality of the services that can be rated, shape (S, P, ...), and a mask
    of them.
    """
    if state.due is None:
        return state.service, state.awaiting
    service = namespace(state.service).where(state.awaiting, state.service, state.due.service)
    return service, state.awaiting | (state.due.rounds > 0)


def fitted(actions: Actions, state: State) -> Actions:
    """Return the actions in the dtype of a state, so that double precision does not spread to the
    whole game.

    Raises:
        ValueError: The actions have other shapes than the state needs; or, on NumPy, are NaN or
            outside [0, 1].
    """
    if isinstance(actions, CheckedActions):
        return actions
    cells, population, dtype = state.ratings.shape, state.population, state.ratings.dtype
    agents = None if population is None else population.phase.shape
    needed = state.quality.shape, cells, agents, cells, cells, cells
    for name, part, shape in zip(Actions._fields, actions, needed, strict=True):
        if part is None:
            continue
        if part.shape != shape:
            raise ValueError(
                f"{name} must {f'have shape {tuple(shape)}' if shape else 'be None'}, "
                f"got shape {tuple(part.shape)}"
            )
        if name in _IN_RANGE and isinstance(part, np.ndarray):  # others may be compiling
            check_within(name, part)
    if actions.quality.dtype == actions.ratings.dtype == dtype and actions.treatment is None:
        return actions
    return actions._replace(
        **{
            name: cast(part, dtype)
            for name in _IN_RANGE
            if (part := getattr(actions, name)) is not None
        }
    )


def first_game(state: State) -> State:
    """Return the state of the first game of a batch, (E,), on the CPU; a single game's state is
    returned as it is.
    """
    return one_game(state, (0,)) if state.round.ndim else state


def one_game(state: State, place: tuple[int, ...]) -> State:
    """Return the state of one game of a batch, on the CPU.

    Args:
        state: State of a batch.
        place: Index of the game along the axes of the batch.
    """
    game: State = map_leaves(lambda leaf: to_device(leaf[..., *place], "cpu"), state)
    return game
