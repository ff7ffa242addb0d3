"""Cost of trust models: the time of an update by the size of the game, and its growth."""

import math
import tracemalloc
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from time import perf_counter
from typing import Any, NamedTuple

from roletrust_env.arrays import namespace
from roletrust_env.evaluation.resources import in_bytes, in_time
from roletrust_env.trust import Ratings, Traits, TrustModel
from roletrust_env.trust.model import start_model
from studies.timing.compiling import compile_ahead
from studies.timing.contestants import Contestant, Timing, compiled, measure, source

LIBRARIES = "NumPy", "compiled torch"


class Size(NamedTuple):
    """Numbers of raters and of providers."""

    raters: int
    providers: int

    def __str__(self) -> str:
        return f"{self.raters:,} x {self.providers:,}"


class Limits(NamedTuple):
    """Limits of a single update.

    Attributes:
        seconds: Time in seconds.
        memory: Peak memory in bytes.
        compiling: Time to compile in seconds.
    """

    seconds: float = 5.0
    memory: float = 3e9
    compiling: float = 120.0


LIMITS = Limits()


class Cell(NamedTuple):
    """A cell of the table: a timing, or the reason why there is none."""

    timing: Timing | None
    left_out: str = ""


Found = dict[tuple[str, str, Size], Cell]
"""Cells by the model's name, the library and the size."""


def sizes(sides: Sequence[int], library: str) -> list[Size]:
    """Return the square sizes; for NumPy, also the rectangles of the last two sides."""
    squares = [Size(side, side) for side in sides]
    b, c = sides[-2:]
    return squares if library != "NumPy" else [*squares[:-1], Size(b, c), Size(c, b), squares[-1]]


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


class Trial(NamedTuple):
    """Time in seconds and peak memory in bytes of one update."""

    seconds: float
    memory: float

    @classmethod
    def of(cls, contestant: Contestant) -> "Trial":
        """Measure a contestant on NumPy: the shortest of three steps, and the memory of one."""

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
    """Return the reason to leave out a size; empty if there is none.

    The forecast is the cost with fewer raters, times the cost with fewer providers, divided by the cost with fewer of
    both. It is exact if the cost grows as a product of powers. Without these three trials nothing is left out.
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
    """Time every model at every size, with the models of one size in turn, and for torch after all compilations.

    Args:
        models: Trust models by name.
        sides: Sides of the squares, in ascending order.
        libraries: Some of `LIBRARIES`, NumPy first: what takes too long there is left out for the others.
        limits: Limits of an update, see `too_much`.
        repeats: Number of turns of each model.
        slice_s: Approximate length of a turn in seconds.
        threads: Number of threads of torch, also for compiling processes.
        seed: Random seed of the ratings.
        advance: Called with the next step: before each model is prepared, and before each is compiled.
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
                except Exception as error:  # from a foreign model, or without a compiler
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
    """Compile all models within the limits into torch's cache. Return the reasons for those that failed."""
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
    """Return the powers of S and P in the time of an update on NumPy, at the largest sizes; NaN if unknown."""
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
