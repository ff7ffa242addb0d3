"""What trust models cost: the time of an update by the size of the game, and how it grows."""

import math
import tracemalloc
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from time import perf_counter
from typing import Any, NamedTuple

from roletrust_env.arrays import namespace
from roletrust_env.evaluation.resources import in_bytes, in_time
from roletrust_env.trust import Traits, TrustModel
from roletrust_env.trust.model import start_model
from roletrust_experiments.timing.compiling import compile_ahead
from roletrust_experiments.timing.contestants import Contestant, Timing, compiled, measure, source

LIBRARIES = "NumPy", "compiled torch"


class Size(NamedTuple):
    """Numbers of raters and of providers."""

    raters: int
    providers: int

    def __str__(self) -> str:
        return f"{self.raters:,} x {self.providers:,}"


class Limits(NamedTuple):
    """What a single update may take.

    Attributes:
        seconds: of time.
        memory: bytes, at the worst moment.
        compiling: seconds until it is compiled.
    """

    seconds: float = 5.0
    memory: float = 3e9
    compiling: float = 120.0


LIMITS = Limits()


class Cell(NamedTuple):
    """One cell of the table: a timing, or why there is none."""

    timing: Timing | None
    left_out: str = ""


Found = dict[tuple[str, str, Size], Cell]
"""Cells by the model's name, the library and the size."""


def sizes(sides: Sequence[int], library: str) -> list[Size]:
    """The squares of these sides; on NumPy between the last two also those that are long in one direction alone."""
    squares = [Size(side, side) for side in sides]
    b, c = sides[-2:]
    return squares if library != "NumPy" else [*squares[:-1], Size(b, c), Size(c, b), squares[-1]]


def trust_update(name: str, model: TrustModel[Any], size: Size, library: str, seed: int) -> Contestant:
    """A trust model alone: one update in float32, of one game, in which all rate all, and what it publishes.

    Args:
        name: of the contestant.
        model: to be timed. One that asks who is who is told that rater i is provider i, and these do not rate
            themselves.
        size: of the game.
        library: `NumPy` or `compiled torch`.
        seed: of the ratings.
    """
    like, random = source(library, seed)
    ratings, others = (random.uniform(size) for _ in range(2))
    traits = Traits.of(model)
    peers = (namespace(like).eye(*size) > 0) & traits.takes_peers
    mask = None if traits.takes_full_rounds and not traits.takes_peers else ~peers

    def update(state: Any, ratings: Any) -> tuple[Any, Any, Any]:
        state = model.update(state, ratings, mask)
        return state, model.rater_trust(state), model.provider_trust(state)

    # After the second update every rating has one before it, as in the middle of a game.
    state = update(update(start_model(model, ratings, peers), ratings)[0], others)[0]
    taken = compiled(update) if library == "compiled torch" else update
    with warnings.catch_warnings():  # on caches that torch.compile looks through
        warnings.simplefilter("ignore")
        taken(state, ratings)
    return Contestant(name, 1, sum(size), lambda: taken(state, ratings), math.prod(size))


class Trial(NamedTuple):
    """What one update took: seconds, and bytes at the worst moment."""

    seconds: float
    memory: float

    @classmethod
    def of(cls, contestant: Contestant) -> "Trial":
        """Of a contestant on NumPy: the shortest of three steps, which other work disturbed least, and one traced."""

        def timed() -> float:
            began = perf_counter()
            contestant.step()
            return perf_counter() - began

        seconds = min(timed() for _ in range(3))
        tracemalloc.start()
        try:
            contestant.step()
            return cls(seconds, tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()


def too_much(trials: Mapping[Size, Trial], size: Size, limits: Limits) -> str:
    """Why a size is left out, in words; empty if it is not.

    What an update would take is what it took with fewer raters, times what it took with fewer providers, by what it
    took with fewer of both: right if it grows as a product of powers. Where these were not tried nothing is left out.
    """
    fewer = [small for small in trials if small.raters < size.raters and small.providers < size.providers]
    corners = [
        [trials[at] for at in (small, Size(size.raters, small.providers), Size(small.raters, size.providers))]
        for small in fewer
        if {Size(size.raters, small.providers), Size(small.raters, size.providers)} <= trials.keys()
    ]
    if not corners:
        return ""
    small, long, wide = corners[-1]
    seconds = long.seconds * wide.seconds / small.seconds
    memory = long.memory * wide.memory / max(1, small.memory)
    if seconds > limits.seconds:
        return f"an update would take about {in_time(seconds)}"
    return f"an update would take about {in_bytes(memory)}" if memory > limits.memory else ""


def measure_models(
    models: Mapping[str, TrustModel[Any]],
    sides: Sequence[int],
    libraries: Iterable[str] = LIBRARIES[:1],
    *,
    limits: Limits = LIMITS,
    repeats: int = 5,
    slice_s: float = 0.05,
    threads: int = 1,
    seed: int = 0,
    advance: Callable[[str], None] = lambda what: None,
) -> Found:
    """Time every model at every size, those of one size in turn; with torch, once all are compiled.

    Args:
        models: by name.
        sides: of the squares, growing.
        libraries: of `LIBRARIES`, NumPy first: what takes too much there is left out elsewhere, too.
        limits: of an update, see `too_much`.
        repeats: how many turns each model gets.
        slice_s: how long a turn lasts, about.
        threads: of torch, as it is set; those that compile ahead are told.
        seed: of the ratings.
        advance: called with what is done next: before each model is made ready, and before each is compiled.
    """
    found: Found = {}
    trials: dict[str, dict[Size, Trial]] = {name: {} for name in models}
    for library in libraries:
        undone: dict[tuple[str, Size], str] = {}
        if library == "compiled torch":
            undone = _compile_all(models, sides, trials, limits, threads, seed, advance)
        for size in sizes(sides, library):
            ready: list[Contestant] = []
            for name, model in models.items():
                advance(f"{library}, {size}")
                reason = undone.get((name, size)) or too_much(trials[name], size, limits)
                try:
                    if not reason:
                        ready.append(trust_update(name, model, size, library, seed))
                except Exception as error:  # whatever a foreign model raises, or a compiler that is not there
                    reason = str(error).strip().partition("\n")[0] or repr(error)
                found[name, library, size] = Cell(None, reason)
            if library == "NumPy":
                for contestant in ready:
                    trials[contestant.name][size] = Trial.of(contestant)
            for timing in measure(ready, repeats, slice_s):
                found[timing.contestant.name, library, size] = Cell(timing)
    return found


def _compile_all(
    models: Mapping[str, TrustModel[Any]],
    sides: Sequence[int],
    trials: Mapping[str, Mapping[Size, Trial]],
    limits: Limits,
    threads: int,
    seed: int,
    advance: Callable[[str], None],
) -> dict[tuple[str, Size], str]:
    """Compile all that does not take too much, into torch's cache; what was not done, and why."""
    library = "compiled torch"
    jobs = {
        (name, size): (name, model, size, library, seed)
        for size in sizes(sides, library)
        for name, model in models.items()
        if not too_much(trials[name], size, limits)
    }
    return compile_ahead(
        trust_update, jobs, limits.compiling, threads, lambda cell: advance(f"compiling {cell[0]}, {cell[1]}")
    )


def growth(found: Found, name: str) -> tuple[float, float]:
    """The powers of S and of P that the time of an update on NumPy grew by, at the largest sizes; NaN if unknown."""
    seconds = {
        size: cell.timing.per_rating().median * math.prod(size)
        for (model, library, size), cell in found.items()
        if (model, library) == (name, "NumPy") and cell.timing
    }

    def power(grows: int) -> float:
        stays = 1 - grows
        pairs = [(a, b) for a in seconds for b in seconds if a[stays] == b[stays] and a[grows] < b[grows]]
        if not pairs:
            return math.nan
        a, b = max(pairs, key=lambda pair: math.prod(pair[1]))
        return math.log(seconds[b] / seconds[a]) / math.log(b[grows] / a[grows])

    return power(0), power(1)
