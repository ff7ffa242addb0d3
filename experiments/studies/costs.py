"""What the trust models cost: time per rating by size, and its growth with raters and providers.

The models take turns, so that other work on the machine affects all alike. All models are compiled
before a compiled one is timed, two at a time, in processes that are stopped after two minutes; what
takes longer is left out, and a line says so. Compiled code stays in torch's cache on disk (its
TORCHINDUCTOR_CACHE_DIR), so that a second study is quick. On a quiet machine up to 20 minutes, of
which most is compiling.
"""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

from roletrust_agents.smooth import one_thread
from roletrust_env import make_scenario
from roletrust_env.benchmarking.pool import WorkerPool
from roletrust_env.evaluation.resources import in_time
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust import Traits, TrustModel, trust_models
from studies.study import Recipe, Study
from studies.timing import (
    COMPILED,
    Contestant,
    Size,
    Timing,
    machine,
    measure,
    spread,
    times_figure,
    trust_update,
)


class Options(NamedTuple):
    """What is measured.

    Attributes:
        model: Specs of the trust models; all that are installed if left out.
        library: `NumPy` and `compiled torch`.
        side: Numbers of raters, and of providers, two or more.
    """

    model: tuple[str, ...] = ()
    library: tuple[str, ...] = ("NumPy", COMPILED)
    side: tuple[int, ...] = (3, 30, 300)


RECIPES = {
    "model-costs": Recipe(
        Options(), {name: name for name in ("model-costs.md", "model-costs.csv", "model-costs.png")}
    )
}

_BELOW = "```{toctree}\n:hidden:\n\nedge-costs\n```"
_HEADER = (
    *("model", "family", "grows_as", "library", "raters", "providers"),
    *("ns_per_rating", "ns_per_rating_least", "ns_per_rating_greatest", "left_out"),
)
_REPEATS, _SLICE_S = 5, 0.05  # turns of each model, and their approximate length in seconds
_WORKERS, _COMPILING_S = 2, 120.0  # that compile, and the time that a model has for it
_ENVIRONMENT = {"TORCHINDUCTOR_COMPILE_THREADS": "1"}  # there are as many workers as processors


class Cell(NamedTuple):
    """A cell of the table: a timing, or the reason why there is none."""

    timing: Timing | None
    left_out: str = ""


Found = dict[tuple[str, str, Size], Cell]
"""Cells by the model's name, the library and the size."""


def main(study: Study[Options]) -> None:
    """Time all models, and write their costs."""
    asked, sides, scenario = study.options, sorted(study.options.side), make_scenario("paper-3x3")
    models = {name: parse_trust_model(name, scenario) for name in asked.model or trust_models()}
    costs: Found = {}
    with one_thread():
        for library in asked.library:
            costs |= measure_models(models, sides, library, study.seed)
    cells = [(where, Traits.of(models[where[0]]), cell) for where, cell in costs.items()]
    rows = [
        (
            name,
            traits.family,
            traits.cost,
            library,
            *size,
            *(cell.timing.each() if cell.timing else [None] * 3),
            cell.left_out or None,
        )
        for (name, library, size), traits, cell in cells
    ]
    study.csv("model-costs.csv", _HEADER, rows)
    largest = Size(sides[-1], sides[-1])
    pictured = {
        f"{library}, {largest}": {
            name: cell.timing.each()
            for (name, *where), cell in costs.items()
            if cell.timing and where == [library, largest]
        }
        for library in asked.library
    }
    study.figure("model-costs.png", times_figure(pictured))
    parts = [
        "# What the trust models cost",
        "![Nanoseconds per rating of each trust model, on NumPy and on compiled "
        "torch](model-costs.png)",
        "Each line of the grid is ten times the one before. One update in float32 in which all "
        "raters rate all "
        "providers, the median of the repeats. S^ and P^ are the powers of the numbers of raters "
        "and of providers "
        f"that its time grows by on NumPy, from {sides[-2]:,} to {sides[-1]:,} of one with "
        f"{sides[-1]:,} of the "
        "other; fixed costs make them less than the model's own.",
    ]
    for library in asked.library:
        headings, *lines = _lines(models, costs, sides, library)
        parts += [f"## Nanoseconds per rating, {library}", markdown_table(headings, lines, names=2)]
    reasons = [
        f"- Left out: {name} on {library}, {size}: {cell.left_out}."
        for (name, library, size), cell in costs.items()
        if cell.left_out
    ]
    study.page(
        "model-costs.md",
        *parts,
        "\n".join(reasons),
        f"Made by `{study.command}` on {machine()}.",
        _BELOW,
    )


def sizes(sides: Sequence[int], library: str) -> list[Size]:
    """Return the square sizes; for NumPy, also the rectangles of the last two sides."""
    squares = [Size(side, side) for side in sides]
    b, c = sides[-2:]
    return squares if library != "NumPy" else [*squares[:-1], Size(b, c), Size(c, b), squares[-1]]


def measure_models(
    models: Mapping[str, TrustModel[Any]], sides: Sequence[int], library: str, seed: int = 0
) -> Found:
    """Time every model at every size, with the models of one size in turn, and for torch after all
    compilations.

    Args:
        models: Trust models by name.
        sides: Sides of the squares, in ascending order.
        library: See `Options`.
        seed: Random seed of the ratings.
    """
    costs: Found = {}
    jobs = {
        (name, s): (name, model, s, library, seed)
        for s in sizes(sides, library)
        for name, model in models.items()
    }
    undone = compile_ahead(jobs) if library == COMPILED else {}
    for size in sizes(sides, library):
        ready: list[Contestant] = []
        for name in models:
            reason = undone.get((name, size), "")
            try:
                if not reason:
                    ready.append(trust_update(*jobs[name, size]))
            except Exception as error:  # from a foreign model, or without a compiler
                reason = str(error).strip().partition("\n")[0] or repr(error)
            costs[name, library, size] = Cell(None, reason)
        for timing in measure(ready, _REPEATS, _SLICE_S):
            costs[timing.contestant.name, library, size] = Cell(timing)
    return costs


def compile_ahead(jobs: Mapping[tuple[str, Size], tuple[Any, ...]]) -> dict[tuple[str, Size], str]:
    """Compile models into torch's cache, and return the reason for each that does not come to its
    end.

    Args:
        jobs: Arguments of `trust_update`.
    """
    undone: dict[tuple[str, Size], str] = {}
    crew: WorkerPool[tuple[str, Size]] = WorkerPool(_compile, _WORKERS, _ENVIRONMENT, _load_torch)
    with crew:
        for key, answer in crew.run(jobs, _COMPILING_S):
            if answer.timed_out:
                undone[key] = f"compiling takes more than {in_time(_COMPILING_S)}"
            elif answer.exit_code is not None:
                undone[key] = "the compiling process crashed"
    return undone


def _compile(*job: Any) -> None:
    with suppress(Exception):  # the timing process raises it again
        trust_update(*job)


def _load_torch() -> None:
    one_thread().__enter__()  # for the life of the process


def growth(costs: Found, name: str) -> tuple[float, float]:
    """Return the powers of S and P in the time of an update on NumPy, at the largest sizes; NaN if
    unknown.
    """
    seconds = {
        size: spread(cell.timing.seconds).value
        for (model, library, size), cell in costs.items()
        if (model, library) == (name, "NumPy") and cell.timing
    }

    def power(grows: int) -> float:
        stays = 1 - grows
        pairs = [
            (a, b) for a in seconds for b in seconds if a[stays] == b[stays] and a[grows] < b[grows]
        ]
        if not pairs:
            return math.nan
        a, b = max(pairs, key=lambda pair: math.prod(pair[1]))
        return math.log(seconds[b] / seconds[a]) / math.log(b[grows] / a[grows])

    return power(0), power(1)


def _lines(
    models: Mapping[str, TrustModel[Any]], costs: Found, sides: Sequence[int], library: str
) -> list[list[str]]:
    """Return the table of a library: its headings, and a row for each model."""
    grows = library == "NumPy"
    lines = [
        [
            "model",
            "grows as",
            *(f"{side}x{side}" for side in sides),
            *(["S^", "P^"] if grows else []),
        ]
    ]
    for name, model in models.items():
        cells = [_nanoseconds(costs[name, library, Size(side, side)]) for side in sides]
        powers = ["-" if math.isnan(power) else f"{power:.2f}" for power in growth(costs, name)]
        lines.append([name, Traits.of(model).cost, *cells, *(powers if grows else [])])
    return lines


def _nanoseconds(cell: Cell) -> str:
    if cell.timing is None:
        return "-"
    value = cell.timing.each().value
    return f"{value:,.{int(value < 100)}f}"
