"""The cells of a game: the pairs of a rater and a provider for which a round has numbers, and what
is summed over them.

The rules of a round are written once, in `Game.step`, for arrays whose first axis is the rater and
whose second axis is its cells. In `Cells` a rater has a cell for every provider. In `MetCells` it
has one for each provider that it meets in a round, so that time and memory grow with the services
of a round, not with S times P.
"""

from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import Array, namespace
from roletrust_env.frozen import Frozen
from roletrust_env.shapes import PerProvider, PerRater, ProviderFlags, Shape
from roletrust_env.trust.edge_run import EdgeRun
from roletrust_env.trust.edges import edge_model, start_on_edges, takes_peers
from roletrust_env.trust.key_index import Floats
from roletrust_env.trust.model import Traits, TrustModel, start_model
from roletrust_env.trust.model_checks import needs_watching, try_trust_model, watched_update
from roletrust_env.trust.ratings import Ratings, sum_at
from roletrust_env.world.access import meet
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Encounters, Scenario

MOST_CELLS = 4_000_000
"""Number of pairs up to which encounters are played on a grid."""

Met = Any
"""Index of the provider of each cell, whole, shape (S, K); None on a grid, where it is the place of
the cell."""

PerCell: TypeAlias = Annotated[Array, Shape("S K ...")]
"""Array with an entry for each cell, shape (S, K, ...)."""

CellFlags: TypeAlias = Annotated[Array, Shape("S K ...", "bool")]
"""Boolean array with an entry for each cell, shape (S, K, ...)."""


class Cells(Frozen):
    """The cells of a game: those of all pairs, arrays of shape (S, P, ...), for any trust model and
    array library.

    Below, K is the number of cells of a rater, here P.

    Attributes:
        width: Number of cells K of each rater.
        not_self: Whether rater and provider are two agents, boolean, shape (S, P).
    """

    def __init__(
        self, scenario: Scenario, roster: Roster, model: TrustModel[Any], like: Array
    ) -> None:
        """Try the model on one round.

        Raises:
            ValueError: The model fails, see `try_trust_model`; or the scenario is for a
                `SparseGame`.
        """
        xp, cells = namespace(like), roster.n_raters * roster.n_providers
        if isinstance(scenario.access, Encounters) and cells > MOST_CELLS:
            raise ValueError(
                f"scenario {scenario.name!r} has {roster.n_raters:,} x {roster.n_providers:,} "
                "pairs, of which only "
                "some meet in a round: too many for Game and for environments; "
                "roletrust_env.SparseGame plays it"
            )
        self.width, self._rule, self._model = roster.n_providers, scenario.access, model
        self.not_self = xp.asarray(roster.not_self.copy(), device=like.device)
        self._peers = xp.asarray(~roster.not_self, device=like.device)
        self._own = xp.asarray(roster.own_provider.copy(), device=like.device)
        self._places = xp.arange(roster.n_providers, device=like.device)
        try_trust_model(model, self._peers, like)
        self._watched = needs_watching(model)
        self._personal = Traits.of(model).family == "personal"

    def start(self, nothing: PerCell) -> tuple[Any, PerProvider]:
        """Return the state of the trust model before any rating, and zeros of shape (P, ...).

        Args:
            nothing: Zeros of shape (S, K, ...).
        """
        return start_model(self._model, nothing, self._peers), nothing[0]

    def nobody(self, shape: tuple[int, ...]) -> tuple[Met, CellFlags]:
        """Return providers of the cells, and flags that are false, where nobody has met yet. Shape
        (S, K, ...).
        """
        return None, for_batch(self.not_self & False, shape)

    def meet(
        self, shape: tuple[int, ...], noise: Annotated[Array, Shape("S k ...")] | None
    ) -> tuple[Met, CellFlags]:
        """Return the providers of the cells of a round, and whether rater and provider meet,
        boolean.

        Args:
            shape: Shape (S, K, ...) of the cells.
            noise: Uniform noise of encounters, shape (S, k, ...); of no use where nobody meets by
                chance.
        """
        if not isinstance(self._rule, Encounters):
            return None, for_batch(self.not_self, shape)
        batch = (1,) * (len(shape) - 2)
        own, places = self._own.reshape(-1, *batch), self._places.reshape(1, -1, *batch)
        met, mask = (
            meet(self._rule, own, self.width, noise),
            for_batch(self.not_self & False, shape),
        )
        for n in range(self._rule.providers):
            mask = mask | (met[:, n : n + 1, ...] == places)
        return None, mask

    def update(
        self,
        trust: Any,
        met: Met,
        ratings: PerCell,
        rated: CellFlags | None,
        service: PerCell,
        served: CellFlags | None,
        round: Annotated[Array, Shape("...", "whole")],
    ) -> tuple[Any, PerRater, PerProvider]:
        """Return the state of the trust model after the ratings of a round, and the trust as `read`
        does.

        Args:
            trust: State of the trust model before the round.
            met: Providers of the cells.
            ratings: Ratings, shape (S, K, ...).
            rated: Whether there is a rating, boolean, shape (S, K, ...); None if everywhere.
            service: Perceived quality of the services of the round before, shape (S, K, ...), which
                only the judges of a personal model remember.
            served: Whether there was a service, boolean, shape (S, K, ...); None if everywhere.
            round: Number of the round, shape (...).
        """
        own = Ratings(service, served) if self._personal else None
        given = Ratings(ratings, rated, experience=own)
        if self._watched:
            return watched_update(self._model, trust, given, round)
        after = self._model.update(trust, given)
        return after, *self.read(after)

    def read(self, trust: Any) -> tuple[PerRater, PerProvider]:
        """Return the trust of the raters, shape (S, ...), and of the providers, shape (P, ...), in
        a state.
        """
        return self._model.rater_trust(trust), self._model.provider_trust(trust)

    def of_providers(self, values: Annotated[Array, Shape("P ...", "any")], met: Met) -> Array:
        """Return the provider's value for each cell, from shape (P, ...), in a shape that
        broadcasts with the cells.
        """
        return values[None, ...]

    def counts(self, flags: CellFlags, met: Met, dtype: Any) -> PerProvider:
        """Return in how many cells of each provider a flag is true, shape (P, ...)."""
        return flags.sum(axis=0, dtype=dtype)

    def anywhere(self, flags: CellFlags, met: Met) -> ProviderFlags:
        """Return whether a flag is true in any cell of each provider, shape (P, ...)."""
        return flags.any(axis=0)


class SparseTrust(NamedTuple):
    """Trust of a game on slots after a round. The run is shared and goes on, so a state is stepped
    from once.

    Attributes:
        run: Run of all agents and pairs.
        rounds: Number of rounds that the run had played.
        tor: Trust of the raters, shape (S,).
        top: Trust of the providers, shape (P,).
    """

    run: EdgeRun
    rounds: int
    tor: Annotated[Floats, Shape("S")]
    top: Annotated[Floats, Shape("P")]


class MetCells(Cells):
    """The cells of the pairs that meet: arrays of shape (S, K), for one game with encounters on
    NumPy.

    Attributes:
        width: Number of providers K that a rater meets in a round.
    """

    _rule: Encounters

    def __init__(self, rule: Encounters, roster: Roster, model: Any) -> None:
        """Take a model that runs on edges.

        Raises:
            ValueError: The model does not run on edges, or takes peers while agents have two roles.
        """
        self.width, self._rule, self._model = rule.providers, rule, edge_model(model)
        if takes_peers(model) and roster.n_both:
            raise ValueError(
                f"trust model {model!r} depends on which rater is which provider, and a sparse "
                "game does not tell it; "
                "give the scenario agents of one role, SR and SP, or take another model"
            )
        self._shape = roster.n_raters, roster.n_providers
        self._own = roster.own_provider
        self._raters = np.repeat(np.arange(self._shape[0]), self.width)

    def start(self, nothing: PerCell) -> tuple[Any, PerProvider]:
        """See `Cells.start`."""
        run, first = EdgeRun(self._model), start_on_edges(self._model, self._shape)
        run.join(*self._shape)
        trust = self._model.rater_trust(first), self._model.provider_trust(first)
        return SparseTrust(run, 0, *trust), np.zeros(self._shape[1])

    def nobody(self, shape: tuple[int, ...]) -> tuple[Met, CellFlags]:
        """See `Cells.nobody`."""
        return np.zeros(shape, np.int64), np.zeros(shape, bool)

    def meet(self, shape: tuple[int, ...], noise: PerCell | None) -> tuple[Met, CellFlags]:
        """See `Cells.meet`."""
        return meet(self._rule, self._own, self._shape[1], noise), np.ones(shape, bool)

    def update(
        self,
        trust: SparseTrust,
        met: Met,
        ratings: PerCell,
        rated: CellFlags | None,
        service: PerCell,
        served: CellFlags | None,
        round: Annotated[Array, Shape("...", "whole")],
    ) -> tuple[SparseTrust, PerRater, PerProvider]:
        """See `Cells.update`.

        Raises:
            ValueError: The state has been stepped from already.
        """
        if trust.rounds != trust.run.rounds:
            raise ValueError(
                f"round {trust.rounds} of this sparse game has been played, and its trust has gone "
                "on to round "
                f"{trust.run.rounds}; step from the newest state, or start another game"
            )
        flags: npt.NDArray[np.bool_] = np.ones(ratings.shape, bool) if rated is None else rated
        where = np.flatnonzero(flags)
        trust.run.play(self._raters[where], met.reshape(-1)[where], ratings.reshape(-1)[where])
        run = trust.run
        after = SparseTrust(run, run.rounds, run.rater_trust, run.provider_trust)
        return after, *self.read(after)

    def read(self, trust: SparseTrust) -> tuple[PerRater, PerProvider]:
        """See `Cells.read`."""
        return trust.tor, trust.top

    def of_providers(
        self, values: Annotated[Array, Shape("P ...", "any")], met: Met
    ) -> Annotated[Array, Shape("S K", "any")]:
        """See `Cells.of_providers`."""
        return values[met]

    def counts(self, flags: CellFlags, met: Met, dtype: Any) -> PerProvider:
        """See `Cells.counts`."""
        return sum_at(met[flags], np.ones(int(flags.sum()), dtype), self._shape[1])

    def anywhere(self, flags: CellFlags, met: Met) -> ProviderFlags:
        """See `Cells.anywhere`."""
        reached = np.zeros(self._shape[1], bool)
        reached[met[flags]] = True
        return reached


def for_batch(constant: Array, shape: tuple[int, ...]) -> Array:
    """Return a constant, such as one of shape (S, P), for every game of a batch.

    It is a view and not a copy: on the CPU, compiled torch takes as long to write booleans as for
    the trust model.
    """
    if constant.shape == shape:
        return constant
    batch = (1,) * (len(shape) - constant.ndim)
    return namespace(constant).broadcast_to(constant.reshape(constant.shape + batch), shape)
