"""Contestants with ratings as edges: a round of role-trust, the same sums in plain NumPy, and streams."""

import itertools
import tracemalloc
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.data import TrustStream
from roletrust_env.trees import map_kinds
from roletrust_env.trust import Ratings, TrustModel, make_trust_model
from roletrust_env.trust.edge_state import start_on_edges
from roletrust_env.trust.models.central.role_trust import RoleTrust
from studies.timing.contestants import Contestant, Timing

EACH = 10
"""Ratings of each rater, and of each provider, on average."""

PLAIN, EDGES, COPY = "plain NumPy", "role-trust on edges", "copy"

_COPIED = 10_000_000  # numbers whose copying shows the bandwidth: more than a cache holds
_COPIED_BYTES = 16  # a number is read and written
_BATCHES = 40  # drawn before the clock starts, and taken in turn; then a pair meets again

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


class Edges(NamedTuple):
    """Pairs that rate in every round, sorted by provider, and two rounds of ratings.

    Attributes:
        raters: Place of the rater of each pair, shape (E,).
        providers: Place of the provider of each pair, shape (E,).
        values: Ratings of two rounds, shape (2, E).
        side: Number of raters, and of providers.
    """

    raters: Ints
    providers: Ints
    values: Floats
    side: int

    @classmethod
    def of(cls, ratings: int, seed: int) -> "Edges":
        """Return about so many random pairs."""
        rng, side = np.random.default_rng(seed), max(2, ratings // EACH)
        keys = np.unique(rng.integers(0, side**2, ratings))
        return cls(keys % side, keys // side, rng.random((2, len(keys))), side)

    @property
    def size(self) -> int:
        """Bytes of the arrays."""
        return self.raters.nbytes + self.providers.nbytes + self.values.nbytes


class Measured(NamedTuple):
    """A contestant and its peak memory in bytes, from nothing to the end of a round."""

    contestant: Contestant
    memory: int


def rounds(edges: Edges) -> list[Measured]:
    """Return a round of role-trust in which all pairs rate again: in plain NumPy, and on edges."""
    return [by_hand(edges), round_of(EDGES, RoleTrust(), edges)]


def by_hand(edges: Edges) -> Measured:
    """Return the round of role-trust in plain NumPy."""
    return _measured(PLAIN, edges, lambda: plain(edges))


def round_of(name: str, model: TrustModel[Any], edges: Edges) -> Measured:
    """Return a round of a central model in which all pairs rate again."""
    return _measured(name, edges, lambda: on_edges(edges, model))


def on_edges(edges: Edges, model: TrustModel[Any]) -> Callable[[], Any]:
    """Return a function that plays the third round of a central model, and returns the state after it."""
    shape = (edges.side, edges.side)
    state = map_kinds(
        lambda kind, leaf: np.zeros(len(edges.raters)) if kind in ("pair", "age") else leaf,
        start_on_edges(model, shape),
    )

    def after(state: Any, values: Floats) -> Any:
        return model.update(state, Ratings(values, raters=edges.raters, providers=edges.providers, shape=shape))

    for values in edges.values:
        state = after(state, values)
    return lambda: after(state, edges.values[0])


def plain(edges: Edges) -> Callable[[], Any]:
    """Return a function that plays the third round of role-trust, written by hand for this one case in NumPy."""
    raters, providers, (first, second), side = edges
    model = RoleTrust()
    given, received = (np.maximum(np.bincount(agents, minlength=side), 1) for agents in (raters, providers))
    rates, provides = (np.bincount(agents, minlength=side) > 0 for agents in (raters, providers))

    def after(tor: Floats, top: Floats, last: Floats | None, values: Floats) -> tuple[Floats, Floats, Floats]:
        average = np.bincount(providers, values, side) / received
        gaps = np.sqrt(np.abs(values - average[providers]))
        quality = 1 - np.bincount(raters, gaps, side) / given
        tor = np.where(rates, tor + model.lam * (quality - tor), tor)
        rho = np.sinc(1 - values) if last is None else np.sinc(1 - values) * np.sinc(values - last)
        quality = np.bincount(providers, rho * tor[raters] * values, side) / received
        return tor, np.where(provides, top + model.lam * (quality - top), top), values.copy()

    start = np.full(side, model.initial)
    state = after(*after(start, start, None, first), second)
    return lambda: after(*state, first)


def stream(batch: int, agents: int, seed: int) -> Contestant:
    """Return a stream of role-trust with so many raters and as many providers, known by numbers, as a contestant."""
    rng, everyone = np.random.default_rng(seed), np.arange(agents)
    taken = TrustStream(make_trust_model("role-trust"))
    for raters, providers in ((everyone, rng.permutation(agents)), (rng.permutation(agents), everyone)):
        taken.update(raters, providers, rng.random(agents))
    drawn = [
        (rng.integers(0, agents, batch), rng.integers(0, agents, batch), rng.random(batch)) for _ in range(_BATCHES)
    ]
    batches = itertools.cycle(drawn)
    return Contestant(f"stream in batches of {batch:,}", 1, 2 * agents, lambda: taken.update(*next(batches)), batch)


def copying() -> Contestant:
    """Return the copying of an array as a contestant; a number counts as a rating."""
    source = np.ones(_COPIED)
    target = source.copy()
    return Contestant(COPY, 1, 1, lambda: np.copyto(target, source), _COPIED)


def bytes_per_s(copied: Timing) -> float:
    """Return the bytes that copying reads and writes in a second, from its timing."""
    return _COPIED_BYTES / copied.per_rating().median


def _measured(name: str, edges: Edges, make: Callable[[], Callable[[], Any]]) -> Measured:
    tracemalloc.start()
    try:
        step = make()
        step()
        memory = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    return Measured(Contestant(name, 1, 2 * edges.side, step, len(edges.raters)), memory + edges.size)
