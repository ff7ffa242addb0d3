"""The trust of a growing number of agents, from rounds of edges: only what a round touches is updated."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.trees import Kind, kinds, map_kinds
from roletrust_env.trust.edge_state import start_on_edges, takes_peers
from roletrust_env.trust.key_index import Ints, KeyIndex
from roletrust_env.trust.model import Traits, TrustModel
from roletrust_env.trust.ratings import Ratings, merge_repeats

Floats = npt.NDArray[np.float64]

_PROVIDER_BITS = 31
_NEARLY_ALL = 4  # from one in so many on, all agents are updated


class _Touched(NamedTuple):
    """The agents of one role in a round: their places (all if None), their number, and the ratings' places in these."""

    some: Ints | None
    size: int
    places: Ints


class Ledger:
    """Trust of raters and providers by their places 0, 1, 2, ..., in NumPy, which is updated round by round.

    A model whose formula is local (`local = True`: trust of an agent follows from its own ratings and the trust of
    their raters alone) takes time in proportion to the ratings of a round. Other models take time in proportion to all
    pairs that ever met.

    Attributes:
        model: Central model.
        rounds: Number of rounds so far.
    """

    def __init__(self, model: TrustModel[Any], *, one_role: bool = True) -> None:
        """Start without agents.

        Args:
            model: Central model.
            one_role: Whether raters and providers are different agents. Otherwise rater 7 and provider 7 are one agent.
        """
        self.model, self.rounds = model, 0
        self._local = Traits.of(model).local
        self._one_role = one_role
        self._sizes: dict[str, int] = {"rater": 0, "provider": 0}
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
    def n_pairs(self) -> int:
        """The number of pairs that have a memory; 0 for a model without one."""
        return len(self._index)

    @property
    def rater_trust(self) -> Floats:
        """The trust of each rater, shape (S,), in [0, 1]."""
        return np.array(self.model.rater_trust(self._view(ages=False)))

    @property
    def provider_trust(self) -> Floats:
        """The trust of each provider, shape (P,), in [0, 1]."""
        return np.array(self.model.provider_trust(self._view(ages=False)))

    def play(self, raters: Ints, providers: Ints, values: Floats) -> None:
        """Play one round. Agents with a place beyond all earlier ones join with the initial trust.

        Args:
            raters: Place of the rater of each rating, shape (E,), at least 0.
            providers: Place of the provider of each rating, shape (E,), at least 0.
            values: Ratings, shape (E,), in [0, 1].
        """
        self.join(int(raters.max(initial=-1)) + 1, int(providers.max(initial=-1)) + 1)
        keys = (raters << _PROVIDER_BITS) | providers
        pair = self._index.places(keys) if self._remembers else keys
        self._grow("pair", self.n_pairs)
        raters, providers, values, pair = merge_repeats(raters, providers, values, pair)
        if self._local:
            self._play_touched(raters, providers, values, pair)
        elif all(self.shape):  # without agents there is nothing to compute
            self._play_all(raters, providers, values, pair)
        self.rounds += 1

    def skip(self, rounds: int) -> None:
        """Play so many rounds without ratings."""
        if self._local:
            self.rounds += rounds
            return
        nobody = np.zeros(0, np.int64)
        for _ in range(rounds):
            self.play(nobody, nobody, np.zeros(0))

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return all that the ledger keeps, by name, for `restore`."""
        counts, state = np.array([*self.shape, self.rounds]), self._view(ages=False)
        leaves = {f"state_{n}": leaf for n, (_, leaf) in enumerate(kinds(state))}
        return {"counts": counts, "pairs": self._index.keys, **leaves}

    def restore(self, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
        """Go on from what another ledger of the same model has kept.

        Raises:
            ValueError: The arrays do not fit together.
        """
        raters, providers, rounds = (int(count) for count in arrays["counts"])
        keys, place = arrays["pairs"], iter(range(100))
        sizes = {"rater": raters, "provider": providers, "pair": len(keys), "age": len(keys)}

        def restored(kind: Kind, leaf: Floats) -> Floats:
            stored: Floats = np.array(arrays[f"state_{next(place)}"])
            if stored.shape != (sizes[kind],) or stored.dtype != leaf.dtype:
                raise ValueError(f"{stored.shape} values of {stored.dtype} where {sizes[kind]} of {leaf.dtype} belong")
            return stored

        state, index = map_kinds(restored, self._start), KeyIndex.of(keys)
        self._state, self._index, self.rounds = state, index, rounds
        self._sizes = {"rater": raters, "provider": providers}

    def join(self, raters: int, providers: int) -> None:
        """Make room for so many raters and providers; new ones have the initial trust."""
        if not self._one_role:
            raters = providers = max(raters, providers)
        for kind, size in (("rater", raters), ("provider", providers)):
            if size > self._sizes[kind]:
                self._grow(kind, size)
                self._sizes[kind] = size

    def remove(self, raters: Ints, providers: Ints) -> None:
        """Let agents leave, with their trust and the memory of their pairs; those after them move up.

        It takes time in proportion to all agents and pairs. What their ratings did to the trust of others stays where a
        model keeps that trust; models that compute it from the memory of all pairs do so in the next round.

        Args:
            raters: Places of raters that leave; places without a rater are ignored.
            providers: Places of providers that leave.
        """
        if not self._one_role:
            raters = providers = np.union1d(raters, providers)
        stay = {"rater": staying(self.shape[0], raters), "provider": staying(self.shape[1], providers)}
        keys = self._index.keys
        rater, provider = keys >> _PROVIDER_BITS, keys & ((1 << _PROVIDER_BITS) - 1)
        pairs = np.flatnonzero(stay["rater"][rater] & stay["provider"][provider])
        chosen = {**{kind: np.flatnonzero(flags) for kind, flags in stay.items()}, "pair": pairs, "age": pairs}
        self._state = map_kinds(lambda kind, leaf: leaf[chosen[kind]], self._state)
        self._sizes = {kind: len(chosen[kind]) for kind in stay}
        rater, provider = (
            moved(flags)[places[pairs]] for flags, places in zip(stay.values(), (rater, provider), strict=True)
        )
        self._index = KeyIndex.of((rater << _PROVIDER_BITS) | provider)

    def _grow(self, kind: str, size: int) -> None:
        """Give the arrays of a kind room for so many entries, at the values of the start."""

        def grown(which: Kind, leaf: Floats, start: Floats) -> Floats:
            if ("pair" if which == "age" else which) != kind or size <= len(leaf):
                return leaf
            more = np.full(max(size, 2 * len(leaf)) - len(leaf), start[0] if kind != "pair" else 0.0, start.dtype)
            return np.concatenate([leaf, more])

        self._state = map_kinds(grown, self._state, self._start)

    def _view(self, *, ages: bool = True) -> Any:
        """Return the state without spare room, with ages as of now; without `ages`, for a read-out, with stamps."""
        sizes = {**self._sizes, "pair": self.n_pairs, "age": self.n_pairs}

        def cut(kind: Kind, leaf: Floats) -> Floats:
            return self._ages(leaf[: sizes[kind]]) if kind == "age" and ages else leaf[: sizes[kind]]

        return map_kinds(cut, self._state)

    def _ages(self, stamps: Floats) -> Floats:
        """Return the rounds since a pair's last rating; a stamp is 1 more than the round before it, and 0 for none."""
        return np.where(stamps > 0, self.rounds + 1 - stamps, 0.0)

    def _play_touched(self, raters: Ints, providers: Ints, values: Floats, pair: Ints) -> None:
        """Update the agents and the pairs that have ratings in the round: a small game of their own."""
        one, other = self._touched("rater", raters), self._touched("provider", providers)
        places: dict[str, Ints | slice] = {
            "rater": slice(self._sizes["rater"]) if one.some is None else one.some,
            "provider": slice(self._sizes["provider"]) if other.some is None else other.some,
            "pair": pair,
        }

        def taken(kind: Kind, leaf: Floats) -> Floats:
            return self._ages(leaf[pair]) if kind == "age" else leaf[places[kind]]

        def put(kind: Kind, leaf: Floats, new: Floats) -> Floats:
            if kind == "age":
                leaf[pair] = self.rounds + 2 - new
            else:
                leaf[places[kind]] = new
            return leaf

        ratings = Ratings(values, raters=one.places, providers=other.places, shape=(one.size, other.size))
        after = self.model.update(map_kinds(taken, self._state), ratings)
        self._state = map_kinds(put, self._state, after)

    def _touched(self, kind: str, places: Ints) -> _Touched:
        """Return the agents of a role at some places, which may repeat."""
        size = self._sizes[kind]
        if len(places) * _NEARLY_ALL >= size:
            return _Touched(None, size, places)
        if len(self._marks) < size:
            self._marks = np.zeros(2 * size, np.int32)
        turn = np.arange(len(places), dtype=np.int32)
        self._marks[places] = turn
        some = places.take(np.flatnonzero(self._marks.take(places) == turn))  # every agent once; no sort is needed
        self._marks[some] = turn[: len(some)]
        return _Touched(some, len(some), self._marks.take(places).astype(np.int64))

    def _play_all(self, raters: Ints, providers: Ints, values: Floats, pair: Ints) -> None:
        """Update all agents and all known pairs."""
        twins = np.arange(self._sizes["provider"]) if takes_peers(self.model) and not self._one_role else None
        keys = self._index.keys
        ratings = Ratings(
            values,
            raters=raters,
            providers=providers,
            shape=self.shape,
            twins=twins,
            pairs=Ratings(
                None,
                raters=keys >> _PROVIDER_BITS,
                providers=keys & ((1 << _PROVIDER_BITS) - 1),
                shape=self.shape,
                twins=twins,
            ),
            slots=pair if self._remembers else None,
        )
        after = self.model.update(self._view(), ratings)
        sizes = {**self._sizes, "pair": self.n_pairs, "age": self.n_pairs}

        def put(kind: Kind, leaf: Floats, new: Floats) -> Floats:
            leaf[: sizes[kind]] = np.where(new > 0, self.rounds + 2 - new, 0.0) if kind == "age" else new
            return leaf

        self._state = map_kinds(put, self._state, after)


def staying(size: int, leaving: Ints) -> npt.NDArray[np.bool_]:
    """Return whether the agent at each of so many places stays."""
    flags = np.ones(size, bool)
    flags[leaving[leaving < size]] = False
    return flags


def moved(stay: npt.NDArray[np.bool_]) -> Ints:
    """Return the new place of each agent that stays, where others leave."""
    return np.cumsum(stay, dtype=np.int64) - 1
