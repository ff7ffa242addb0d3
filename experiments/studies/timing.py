"""Timing: contestants that take turns, and those that several studies measure.

Contestants are timed in turn and repeatedly, in this process, so that other work on the machine affects all alike.
"""

import contextlib
import importlib.util
import inspect
import math
import os
import platform
import time
import tracemalloc
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env import Random
from roletrust_env.arrays import namespace
from roletrust_env.trees import map_kinds
from roletrust_env.trust import Ratings, Traits, TrustModel
from roletrust_env.trust.model import start_model
from roletrust_env.trust.models.central.role_trust import RoleTrust
from roletrust_env.trust.run import start_on_edges

EACH = 10
"""Ratings of each rater, and of each provider, on average, in a list of ratings."""

PLAIN = "plain NumPy"
"""Name of what is written by hand for one case."""

_COPIED = 10_000_000  # numbers whose copying shows the bandwidth: more than a cache holds
_COPIED_BYTES = 16  # a number is read and written

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


class Contestant(NamedTuple):
    """A step to time.

    Attributes:
        name: Name in tables.
        games: Number of games that play in one step.
        agents: Number of agents in each game.
        step: Function that takes one step in every game.
        ratings: Number of ratings in each round of a game; 0 for games without ratings.
    """

    name: str
    games: int
    agents: int
    step: Callable[[], Any]
    ratings: int = 0


class Spread(NamedTuple):
    """Median, minimum and maximum of repeats."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Iterable[float]) -> "Spread":
        """Return the spread of values."""
        known = np.asarray(list(values))
        return cls(float(np.median(known)), float(known.min()), float(known.max()))


class Timing(NamedTuple):
    """Time of one step of a contestant in each repeat, in seconds."""

    contestant: Contestant
    seconds: tuple[float, ...]

    def env_steps(self) -> Spread:
        """Return the rounds of a game per second."""
        return Spread.of(self.contestant.games / s for s in self.seconds)

    def agent_steps(self) -> Spread:
        """Return the actions of an agent per second."""
        return Spread.of(self._acts / s for s in self.seconds)

    def per_rating(self) -> Spread:
        """Return the seconds for each rating of a round."""
        return Spread.of(self._for_a_rating)

    def times_faster(self, peer: "Timing") -> Spread:
        """Return the ratio of agent-steps per second to those of a peer, turn by turn."""
        pairs = zip(self.seconds, peer.seconds, strict=True)
        return Spread.of((self._acts / ours) / (peer._acts / theirs) for ours, theirs in pairs)

    def times_dearer(self, peer: "Timing") -> Spread:
        """Return the ratio of the time per rating to that of a peer, turn by turn."""
        return Spread.of(ours / theirs for ours, theirs in zip(self._for_a_rating, peer._for_a_rating, strict=True))

    @property
    def _acts(self) -> int:
        return self.contestant.games * self.contestant.agents

    @property
    def _for_a_rating(self) -> list[float]:
        return [s / (self.contestant.games * self.contestant.ratings) for s in self.seconds]


class Size(NamedTuple):
    """Numbers of raters and of providers."""

    raters: int
    providers: int

    def __str__(self) -> str:
        return f"{self.raters:,} x {self.providers:,}"


def measure(
    contestants: Sequence[Contestant], repeats: int, slice_s: float, advance: Callable[[], None] = lambda: None
) -> list[Timing]:
    """Time contestants in turn and repeatedly, so that other work on the machine affects all alike.

    Args:
        contestants: Contestants.
        repeats: Number of turns of each contestant.
        slice_s: Approximate length of a turn in seconds; a turn is at least one step.
        advance: Called after each turn.
    """
    steps = [_steps_in(contestant, slice_s) for contestant in contestants]
    seconds: list[list[float]] = [[] for _ in contestants]
    for _ in range(repeats):
        for contestant, n, found in zip(contestants, steps, seconds, strict=True):
            found.append(_time(contestant, n))
            advance()
    return [Timing(contestant, tuple(found)) for contestant, found in zip(contestants, seconds, strict=True)]


def _time(contestant: Contestant, steps: int) -> float:
    step = contestant.step
    start = time.perf_counter()
    for _ in range(steps):
        step()
    return (time.perf_counter() - start) / steps


def _steps_in(contestant: Contestant, seconds: float) -> int:
    """Return the number of steps that fill a time."""
    _time(contestant, 3)  # torch compiles one graph for the first round and one for those that follow
    steps = 1
    while (elapsed := _time(contestant, steps) * steps) < seconds / 4:
        steps *= 2
    return max(1, round(steps * seconds / elapsed))


@contextlib.contextmanager
def torch_threads(threads: int) -> Iterator[None]:
    """Set the number of threads of torch in a context; do nothing without torch."""
    if importlib.util.find_spec("torch") is None:
        yield
        return
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def machine(threads: int = 1) -> str:
    """Return the machine and the software that timings are of, in words."""
    packages = [f"Python {platform.python_version()}"]
    for name in ("numpy", "torch"):
        try:
            packages.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    return f"{os.cpu_count()} cores of {platform.machine()}, {', '.join(packages)}, torch on {threads} of them"


def compiled(step: Callable[..., Any]) -> Callable[..., Any]:
    """Return a step on tensors, compiled by torch into one graph."""
    import torch

    # Steps of several sizes share their code, and torch limits the compilations of a code by default.
    known = inspect.signature(torch.compile).parameters
    apart: Any = {"isolate_recompiles": True} if "isolate_recompiles" in known else {}
    # The library does not change during the timing; guards on the arguments stay.
    unguarded: dict[str, Any] = {"guard_filter_fn": torch.compiler.skip_guard_on_globals_unsafe}
    made: Any = torch.compile(step, dynamic=False, fullgraph=True, options=unguarded, **apart)
    in_inference: Callable[..., Any] = torch.inference_mode()(made)
    return in_inference


def source(library: str, seed: int) -> tuple[Any, Random]:
    """Return an array with the library and dtype, and a matching source of random numbers."""
    like: Any = np.zeros((), np.float32)
    if library != "NumPy":
        import torch

        like = torch.zeros(())
    return like, Random(np.random.default_rng(seed), like)


def trust_update(name: str, model: TrustModel[Any], size: Size, library: str, seed: int) -> Contestant:
    """Return a trust model as a contestant: one update in float32 in which all rate all, and the published trust.

    Args:
        name: Name of the contestant.
        model: Trust model. If it takes peers, rater i is provider i, and peers do not rate themselves.
        size: Size of the game.
        library: `NumPy` or `compiled torch`.
        seed: Random seed of the ratings.
    """
    like, random = source(library, seed)
    ratings, others = (random.uniform(size) for _ in range(2))
    traits = Traits.of(model)
    peers = (namespace(like).eye(*size) > 0) & traits.takes_peers
    mask = ~peers if traits.takes_peers else None

    def update(state: Any, ratings: Any) -> tuple[Any, Any, Any]:
        state = model.update(state, Ratings(ratings, mask))
        return state, model.rater_trust(state), model.provider_trust(state)

    # After the second update every rating has a predecessor, as in the middle of a game.
    state = update(update(start_model(model, ratings, peers), ratings)[0], others)[0]
    taken = compiled(update) if library == "compiled torch" else update
    with warnings.catch_warnings():  # on caches that torch.compile looks through
        warnings.simplefilter("ignore")
        taken(state, ratings)
    return Contestant(name, 1, sum(size), lambda: taken(state, ratings), math.prod(size))


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


def copying() -> Contestant:
    """Return the copying of an array as a contestant; a number counts as a rating."""
    source = np.ones(_COPIED)
    target = source.copy()
    return Contestant("copy", 1, 1, lambda: np.copyto(target, source), _COPIED)


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
