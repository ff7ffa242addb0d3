"""What the trust models cost: time per rating by size, and its growth with raters and providers.

The models take turns, so that other work on the machine affects all alike. A size at which an update is expected to
take more than 5 seconds or 3 GB is left out, and a line says so.

All models are compiled before a compiled one is timed, two at a time, in processes that can be stopped. Compiled code
stays in torch's cache on disk (its TORCHINDUCTOR_CACHE_DIR), so that an interrupted study continues where it stopped,
and a second one is quick. On a quiet machine up to 20 minutes, of which most is compiling.
"""

import math
import pickle
import tracemalloc
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from time import perf_counter
from typing import Any, NamedTuple

from roletrust_env import make_scenario
from roletrust_env.benchmarking.pool import WorkerPool
from roletrust_env.evaluation.resources import in_bytes, in_time
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust import Traits, TrustModel, trust_models
from studies.study import Recipe, Study
from studies.timing import Contestant, Size, Spread, Timing, machine, measure, torch_threads, trust_update

COMPILED = "compiled torch"


class Options(NamedTuple):
    """What is measured.

    Attributes:
        model: Specs of the trust models; all that are installed if left out.
        library: `NumPy` and `compiled torch`, NumPy first: what takes too long there is left out for the other.
        side: Numbers of raters, and of providers, two or more.
        compile_limit: Seconds that compiling one model for one size may take; longer is left out.
        threads: Number of threads of torch.
    """

    model: tuple[str, ...] = ()
    library: tuple[str, ...] = ("NumPy", COMPILED)
    side: tuple[int, ...] = (3, 30, 300)
    compile_limit: float = 120.0
    threads: int = 1


RECIPES = {"model-costs": Recipe(Options(), {name: name for name in ("model-costs.md", "model-costs.csv")})}

_HEADER = (
    *("model", "family", "grows_as", "library", "raters", "providers"),
    *("ns_per_rating", "ns_per_rating_least", "ns_per_rating_greatest", "left_out"),
)
_REPEATS, _SLICE_S = 5, 0.05  # turns of each model, and their approximate length in seconds
_WORKERS = 2  # that compile
_ENVIRONMENT = {"TORCHINDUCTOR_COMPILE_THREADS": "1"}  # there are as many workers as processors


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


class Cell(NamedTuple):
    """A cell of the table: a timing, or the reason why there is none."""

    timing: Timing | None
    left_out: str = ""


Found = dict[tuple[str, str, Size], Cell]
"""Cells by the model's name, the library and the size."""


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


def main(arguments: Sequence[str] | None = None) -> None:
    """Time all models, and write their costs."""
    with Study(__name__, RECIPES, arguments) as study:
        asked, sides = study.options, sorted(study.options.side)
        if len(sides) < 2:
            raise ValueError(f"--side {sides[0]} is the only size; growth needs at least two")
        scenario = make_scenario("paper-3x3")
        models = {name: parse_trust_model(name, scenario) for name in asked.model or trust_models()}
        steps = sum(len(sizes(sides, library)) for library in asked.library) + (COMPILED in asked.library) * len(sides)
        limits = Limits(compiling=asked.compile_limit)
        with study.progress(len(models) * steps) as advance, torch_threads(asked.threads):
            found = measure_models(
                models, sides, asked.library, limits=limits, threads=asked.threads, seed=study.seed, advance=advance
            )
        cells = [(where, Traits.of(models[where[0]]), cell) for where, cell in found.items()]
        study.csv(
            "model-costs.csv",
            _HEADER,
            [
                (name, traits.family, traits.cost, library, *size, *_spread(cell), cell.left_out or None)
                for (name, library, size), traits, cell in cells
            ],
        )
        parts = [
            "# What the trust models cost",
            "One update in float32 in which all raters rate all providers, the median of the repeats. S^ and P^ are "
            "the powers of the numbers of raters and of providers that its time grows by on NumPy, from "
            f"{sides[-2]:,} to {sides[-1]:,} of one with {sides[-1]:,} of the other; fixed costs make them less than "
            "the model's own.",
        ]
        for library in asked.library:
            headings, *rows = _lines(models, found, sides, library)
            parts += [f"## Nanoseconds per rating, {library}", markdown_table(headings, rows, names=2)]
        reasons = [
            f"- Left out: {name} on {library}, {size}: {cell.left_out}."
            for (name, library, size), _, cell in cells
            if cell.left_out
        ]
        study.page(
            "model-costs.md", *parts, "\n".join(reasons), f"Made by `{study.command}` on {machine(asked.threads)}."
        )


def sizes(sides: Sequence[int], library: str) -> list[Size]:
    """Return the square sizes; for NumPy, also the rectangles of the last two sides."""
    squares = [Size(side, side) for side in sides]
    b, c = sides[-2:]
    return squares if library != "NumPy" else [*squares[:-1], Size(b, c), Size(c, b), squares[-1]]


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
    libraries: Iterable[str],
    *,
    limits: Limits,
    threads: int = 1,
    seed: int = 0,
    advance: Callable[[str], None] = lambda what: None,
) -> Found:
    """Time every model at every size, with the models of one size in turn, and for torch after all compilations.

    Args:
        models: Trust models by name.
        sides: Sides of the squares, in ascending order.
        libraries: See `Options`, NumPy first: what takes too long there is left out for the others.
        limits: Limits of an update, see `too_much`.
        threads: Number of threads of torch, also for compiling processes.
        seed: Random seed of the ratings.
        advance: Called with the next step: before each model is prepared, and before each is compiled.
    """
    found: Found = {}
    trials: dict[str, dict[Size, Trial]] = {name: {} for name in models}
    for library in libraries:
        undone: dict[tuple[str, Size], str] = {}
        if library == COMPILED:
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
            for timing in measure(ready, _REPEATS, _SLICE_S):
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
    library = COMPILED
    jobs = {
        (name, size): (name, model, size, library, seed)
        for size in sizes(sides, library)
        for name, model in models.items()
        if not too_much(trials[name], size, limits)
    }
    return compile_ahead(jobs, limits.compiling, threads, lambda cell: advance(f"compiling {cell[0]}, {cell[1]}"))


def compile_ahead(
    jobs: Mapping[tuple[str, Size], tuple[Any, ...]],
    limit_s: float,
    threads: int,
    advance: Callable[[tuple[str, Size]], None],
    work: Callable[..., object] = trust_update,
) -> dict[tuple[str, Size], str]:
    """Run jobs in two other processes, and stop those that take too long.

    Args:
        jobs: Arguments of each job; those that cannot be pickled are skipped.
        limit_s: Time limit of a job in seconds, without the start of the process and the import of torch.
        threads: Number of threads of torch, which the compiled code depends on.
        advance: Called with each key before its job begins.
        work: Function of a module; its results and exceptions are discarded.

    Returns:
        The reason for each key whose job did not finish: it was stopped, or its process crashed.
    """
    sent = {key: job for key, job in jobs.items() if _can_be_sent(job)}
    undone: dict[tuple[str, Size], str] = {}
    crew: WorkerPool[tuple[str, Size]] = WorkerPool(
        partial(_compile, work), _WORKERS, _ENVIRONMENT, partial(_load_torch, threads)
    )
    with crew, suppress(ChildProcessError):
        for key, answer in crew.run(sent, limit_s, advance=advance):
            if answer.timed_out:
                undone[key] = f"compiling takes more than {in_time(limit_s)}"
            elif answer.exit_code is not None:
                undone[key] = "the compiling process crashed"
    return undone


def _can_be_sent(job: tuple[Any, ...]) -> bool:
    with suppress(pickle.PicklingError, AttributeError, TypeError):  # pickle raises different errors
        pickle.dumps(job)
        return True
    return False


def _compile(work: Callable[..., object], *job: Any) -> None:
    """Run a job."""
    with suppress(Exception):  # the timing process raises it again
        work(*job)


def _load_torch(threads: int) -> None:
    """Set the number of threads of torch, if it is installed."""
    torch_threads(threads).__enter__()


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


def _lines(models: Mapping[str, TrustModel[Any]], found: Found, sides: Sequence[int], library: str) -> list[list[str]]:
    """Return the table of a library: its headings, and a row for each model."""
    grows = library == "NumPy"
    lines = [["model", "grows as", *(f"{side}x{side}" for side in sides), *(["S^", "P^"] if grows else [])]]
    for name, model in models.items():
        cells = [_nanoseconds(found[name, library, Size(side, side)]) for side in sides]
        powers = ["-" if math.isnan(power) else f"{power:.2f}" for power in growth(found, name)]
        lines.append([name, Traits.of(model).cost, *cells, *(powers if grows else [])])
    return lines


def _nanoseconds(cell: Cell) -> str:
    if cell.timing is None:
        return "-"
    value = 1e9 * cell.timing.per_rating().median
    return f"{value:,.{int(value < 100)}f}"


def _spread(cell: Cell) -> Sequence[float | None]:
    """Return nanoseconds per rating: the median, the least and the greatest."""
    return Spread.of(1e9 * s for s in cell.timing.per_rating()) if cell.timing else (None, None, None)


if __name__ == "__main__":
    main()
