"""A run of a central trust model on edges, in the memory of the pairs that met."""

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.shapes import Shape
from roletrust_env.trees import Kind, arrays, kinds, map_kinds
from roletrust_env.trust.edges import (
    check_keys,
    edge_model,
    pair_ends,
    pair_keys,
    start_on_edges,
    takes_peers,
)
from roletrust_env.trust.key_index import Floats, Ints, KeyIndex
from roletrust_env.trust.model import Traits, TrustModel
from roletrust_env.trust.model_checks import needs_watching, watched_update
from roletrust_env.trust.ratings import Ratings, merge_repeats
from roletrust_env.trust.stored import restoring, taken, taken_counts
from roletrust_env.trust.trust_run import TrustRun

_SPARE = 7  # spare room for each pair that is known; zeros take no memory until they are written
_NEARLY_ALL = 4  # from one in so many on, all agents are updated


class _Touched(NamedTuple):
    """The agents of one role in a round: their places (all if None), their number, and the ratings'
    places in these.
    """

    agents: Ints | None
    size: int
    places: Ints


class EdgeRun(TrustRun):
    """A run of a central model on edges: only what a round touches is updated, and memory grows
    with pairs that met.

    A model whose formula is local (`local = True`: trust of an agent follows from its own ratings
    and the trust of their raters alone) takes time in proportion to the ratings of a round. Other
    models take time in proportion to all pairs that ever met.
    """

    def __init__(self, model: TrustModel[Any], *, one_role: bool = True) -> None:
        """Start without agents.

        Args:
            model: Central model.
            one_role: Whether raters and providers are different agents. Otherwise rater 7 and
                provider 7 are one agent.

        Raises:
            ValueError: The model does not run on edges.
        """
        self.model, self.rounds, self._watched = edge_model(model), 0, needs_watching(model)
        self._local = Traits.of(model).local
        self._one_role = one_role
        self._sizes: dict[Kind, int] = {"rater": 0, "provider": 0, "pair": 0, "age": 0}
        self._start = start_on_edges(model, (1, 1))
        self._state = map_kinds(lambda kind, leaf: leaf[:0], self._start)
        self._remembers = any(kind in ("pair", "age") for kind, _ in kinds(self._start))
        self._index = KeyIndex()
        self._marks = np.zeros(0, np.int32)  # a number for each agent, for a moment

    @property
    def shape(self) -> tuple[int, int]:
        """The number of raters and of providers."""
        return self._sizes["rater"], self._sizes["provider"]

    @property
    def rater_trust(self) -> Annotated[Floats, Shape("S")]:
        """The trust of each rater. See `TrustRun.rater_trust`."""
        return np.array(self.model.rater_trust(self._view(ages=False)))

    @property
    def provider_trust(self) -> Annotated[Floats, Shape("P")]:
        """The trust of each provider. See `TrustRun.provider_trust`."""
        return np.array(self.model.provider_trust(self._view(ages=False)))

    def play(self, raters: Ints, providers: Ints, values: Floats) -> None:
        """Play one round. See `TrustRun.play`.

        Raises:
            ValueError: A model of another package fails, see `watched_update`.
        """
        self._make_room(int(raters.max(initial=-1)) + 1, int(providers.max(initial=-1)) + 1)
        keys = pair_keys(raters, providers)
        pair = self._index.places(keys) if self._remembers else keys
        known = len(self._index)
        self._grow({"pair": known, "age": known})
        raters, providers, values, pair = merge_repeats(raters, providers, values, pair)
        if self._local:
            self._play_touched(raters, providers, values, pair)
        else:
            self._play_all(raters, providers, values, pair)
        self.rounds += 1

    def skip(self, rounds: int) -> None:
        """Play so many rounds without ratings. See `TrustRun.skip`.

        They are played until one of them changes nothing: then the others change nothing, either.
        """
        last = self.rounds + rounds
        changes = not self._local
        while changes and self.rounds < last:
            before = map_kinds(lambda kind, leaf: leaf.copy(), self._view())
            super().skip(1)
            pairs = zip(arrays(before), arrays(self._view()), strict=True)
            changes = not all(np.array_equal(old, new) for old, new in pairs)
        self.rounds = last

    def save(self) -> dict[str, npt.NDArray[Any]]:
        """Return all that the run keeps, by name. See `TrustRun.save`."""
        counts, state = np.array([*self.shape, self.rounds]), self._view(ages=False)
        leaves = {f"state_{n}": leaf for n, (_, leaf) in enumerate(kinds(state))}
        return {"counts": counts, "pairs": self._index.keys, **leaves}

    def load(self, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
        """Go on from what another run has kept. See `TrustRun.load`."""
        left = dict(arrays)
        raters, providers, rounds = taken_counts(left)
        keys = taken(left, "pairs", np.int64, (None if self._remembers else 0,))
        check_keys(keys, (raters, providers))
        sizes: dict[Kind, int] = {
            "rater": raters,
            "provider": providers,
            "pair": len(keys),
            "age": len(keys),
        }

        restored = restoring(left)
        state = map_kinds(
            lambda kind, leaf: restored(np.broadcast_to(leaf.dtype.type(), sizes[kind])),
            self._start,
        )
        index = KeyIndex.of(keys)
        self._state, self._index, self.rounds, self._sizes = state, index, rounds, sizes
        self._check_loaded(state, left)

    def join(self, raters: int, providers: int) -> None:
        """Make room for so many raters and providers. See `TrustRun.join`."""
        self._make_room(raters, providers)

    def _make_room(self, raters: int, providers: int) -> None:
        if not self._one_role:
            raters = providers = max(raters, providers)
        self._grow({"rater": raters, "provider": providers})

    def _grow(self, sizes: Mapping[Kind, int]) -> None:
        """Make room for so many entries of each kind, at the values of the start."""
        larger = {kind: size for kind, size in sizes.items() if size > self._sizes[kind]}

        def grown(kind: Kind, leaf: Floats, start: Floats) -> Floats:
            missing = larger.get(kind, 0) - len(leaf)
            if missing <= 0:
                return leaf
            if kind not in ("pair", "age"):
                return np.concatenate(
                    [leaf, np.full(max(missing, len(leaf)), start[0], start.dtype)]
                )
            new = np.zeros(len(leaf) + max(missing, _SPARE * len(leaf)), start.dtype)
            new[: len(leaf)] = leaf
            return new

        if larger:
            self._state = map_kinds(grown, self._state, self._start)
            self._sizes.update(larger)

    def _view(self, *, ages: bool = True) -> Any:
        """Return the state without spare room, with ages as of now; without `ages`, for a read-out,
        with stamps.
        """

        def cut(kind: Kind, leaf: Floats) -> Floats:
            used = leaf[: self._sizes[kind]]
            return self._ages(used) if kind == "age" and ages else used

        return map_kinds(cut, self._state)

    def _ages(self, stamps: Floats) -> Floats:
        """Return the rounds since a pair's last rating; a stamp is 1 more than the round before it,
        and 0 for none.
        """
        return np.where(stamps > 0, self.rounds + 1 - stamps, 0.0)

    def _play_touched(self, raters: Ints, providers: Ints, values: Floats, pair: Ints) -> None:
        """Update the agents and the pairs that have ratings in the round: a small game of their
        own.
        """
        touched_raters, touched_providers = (
            self._touched("rater", raters),
            self._touched("provider", providers),
        )
        ratings = Ratings(
            values,
            raters=touched_raters.places,
            providers=touched_providers.places,
            shape=(touched_raters.size, touched_providers.size),
        )
        places: dict[str, Ints | slice] = {
            "rater": slice(self._sizes["rater"])
            if touched_raters.agents is None
            else touched_raters.agents,
            "provider": slice(self._sizes["provider"])
            if touched_providers.agents is None
            else touched_providers.agents,
            "pair": pair,
            "age": pair,
        }

        def taken(kind: Kind, leaf: Floats) -> Floats:
            where = places[kind]
            values = leaf[where] if isinstance(where, slice) else leaf.take(where)
            return self._ages(values) if kind == "age" else values

        def put(kind: Kind, leaf: Floats, new: Floats) -> Floats:
            leaf[places[kind]] = self.rounds + 2 - new if kind == "age" else new
            return leaf

        after = self._updated(map_kinds(taken, self._state), ratings)
        self._state = map_kinds(put, self._state, after)

    def _updated(self, state: Any, ratings: Ratings) -> Any:
        """Return the state after a round; a model of another package is watched."""
        if self._watched:
            return watched_update(self.model, state, ratings, np.asarray(self.rounds))[0]
        return self.model.update(state, ratings)

    def _touched(self, kind: Kind, places: Ints) -> _Touched:
        """Return the agents of a role at some places, which may repeat."""
        size = self._sizes[kind]
        if len(places) * _NEARLY_ALL >= size:
            return _Touched(None, size, places)
        if len(self._marks) < size:
            self._marks = np.zeros(2 * size, np.int32)
        turn = np.arange(len(places), dtype=np.int32)
        self._marks[places] = turn
        agents = places.compress(
            self._marks.take(places) == turn
        )  # every agent once; no sort is needed
        self._marks[agents] = turn[: len(agents)]
        return _Touched(agents, len(agents), self._marks.take(places).astype(np.int64))

    def _play_all(self, raters: Ints, providers: Ints, values: Floats, pair: Ints) -> None:
        """Update all agents and all known pairs."""
        if not all(self.shape):  # there is nothing to compute
            return
        known = self._known_pairs()
        ratings = Ratings(
            values,
            raters=raters,
            providers=providers,
            shape=self.shape,
            twins=known.twins,
            pairs=known,
            slots=pair if self._remembers else None,
        )
        after = self._updated(self._view(), ratings)

        def put(kind: Kind, leaf: Floats, new: Floats) -> Floats:
            leaf[: self._sizes[kind]] = (
                np.where(new > 0, self.rounds + 2 - new, 0.0) if kind == "age" else new
            )
            return leaf

        self._state = map_kinds(put, self._state, after)

    def _known_pairs(self) -> Ratings:
        """Return all known pairs, without ratings."""
        raters, providers = pair_ends(self._index.keys)
        twins = (
            np.arange(self._sizes["provider"])
            if takes_peers(self.model) and not self._one_role
            else None
        )
        return Ratings(None, raters=raters, providers=providers, shape=self.shape, twins=twins)
