"""What central trust models cost on lists of ratings: the time of a round, and its memory, by the number of ratings.

Beside the models stands a round of role-trust in plain NumPy, and the bandwidth of the memory. A list on which a round
is expected to take more than 10 seconds or 8 GB is left out, and a line says so. On a quiet machine a quarter of an
hour.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from roletrust_env import make_scenario
from roletrust_env.evaluation.resources import in_bytes, in_time
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust import TrustModel, trust_models
from roletrust_env.trust.run import edge_model, runs_on_edges
from studies.study import Recipe, Study
from studies.timing import (
    EACH,
    PLAIN,
    Edges,
    Measured,
    Spread,
    Timing,
    by_hand,
    bytes_per_s,
    copying,
    machine,
    measure,
    round_of,
)


class Options(NamedTuple):
    """Specs of central models, all that are installed if left out, and numbers of ratings."""

    model: tuple[str, ...] = ()
    ratings: tuple[int, ...] = (1_000_000, 10_000_000)


RECIPES = {"edge-costs": Recipe(Options(), {name: name for name in ("edge-costs.md", "edge-costs.csv")})}

SECONDS, MEMORY = 10.0, 8e9
"""Limits of a round: seconds, and peak memory in bytes."""

BYTES = 100
"""Memory that a rating of the plain round takes, which every list has."""

_HEADER = (
    *("model", "ratings_asked", "ratings", "ns_per_rating", "ns_per_rating_least", "ns_per_rating_greatest"),
    *("peak_bytes", "left_out"),
)
_REPEATS, _SLICE_S = 3, 0.05  # turns of each model, and their approximate length in seconds


class EdgeCell(NamedTuple):
    """A round of a model: its timing and its peak memory in bytes, or the reason why there is none."""

    timing: Timing | None
    memory: int = 0
    left_out: str = ""


EdgeCosts = dict[tuple[str, int], EdgeCell]
"""Rounds by the model's name and the number of ratings."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Time all models on all lists, and write their costs."""
    with Study(__name__, RECIPES, arguments) as study:
        sizes, scenario = sorted(study.options.ratings), make_scenario("paper-3x3")
        models = {name: parse_trust_model(name, scenario) for name in study.options.model or trust_models()}
        chosen = {
            name: edge_model(model) for name, model in models.items() if study.options.model or runs_on_edges(model)
        }
        with study.progress(len(chosen) * len(sizes)) as advance:
            (copied,) = measure([copying()], 5, 0.1)
            found = measure_lists(chosen, sizes, seed=study.seed, advance=advance)
        study.csv("edge-costs.csv", _HEADER, [_row(*where, cell) for where, cell in found.items()])
        parts = [
            "# What the trust models cost on lists of ratings",
            f"One round in float64 in which all pairs rate again, {EACH} ratings for each rater and each provider, the "
            f"median of the repeats; {PLAIN}: the round of role-trust by hand; memory: peak from nothing to the end of "
            f"a round, with the ratings. Copying an array moves {bytes_per_s(copied) / 1e9:.1f} GB/s.",
        ]
        for size in sizes:
            rows = [[name, *_numbers(cell)] for (name, n), cell in found.items() if n == size]
            table = markdown_table(["model", "ms a round", "M ratings/s", "memory"], rows, names=1)
            parts += [f"## {size:,} ratings", table]
        reasons = [
            f"- Left out: {name} on {n:,} ratings: {cell.left_out}."
            for (name, n), cell in found.items()
            if cell.left_out
        ]
        study.page("edge-costs.md", *parts, "\n".join(reasons), f"Made by `{study.command}` on {machine()}.")


def measure_lists(
    models: Mapping[str, TrustModel[Any]],
    sizes: Sequence[int],
    *,
    seed: int = 0,
    advance: Callable[[str], None] = lambda what: None,
) -> EdgeCosts:
    """Time a round of every model on lists of so many ratings, one after the other, since all would not fit.

    What a shorter list took grows with the number of ratings, and what would take too much is left out. The first row
    of each number is the round of role-trust in plain NumPy, see `timing.plain`.

    Args:
        models: Central models by name.
        sizes: Numbers of ratings.
        seed: Random seed of the ratings.
        advance: Called with the next step, once for each model and size.

    Raises:
        ValueError: A list would take more memory than the limit.
    """
    if (needed := BYTES * max(sizes)) > MEMORY:
        raise ValueError(
            f"a list of {max(sizes):,} ratings would take about {in_bytes(needed)} of memory, and "
            f"{in_bytes(MEMORY)} are allowed, {MEMORY / BYTES:,.0f} ratings"
        )
    found: EdgeCosts = {}
    for size in sorted(sizes):
        edges = Edges.of(size, seed)
        found[PLAIN, size] = _timed(by_hand(edges))
        for name, model in models.items():
            advance(f"{name}, {size:,} ratings")
            shorter = [cell for (other, n), cell in found.items() if other == name and n < size]
            reason = _too_much(shorter[-1], size) if shorter else ""
            if reason:
                found[name, size] = EdgeCell(None, left_out=reason)
            else:
                found[name, size] = _timed(round_of(name, model, edges))
    return found


def _timed(made: Measured) -> EdgeCell:
    (taken,) = measure([made.contestant], _REPEATS, _SLICE_S)
    return EdgeCell(taken, made.memory)


def _too_much(shorter: EdgeCell, size: int) -> str:
    """Return the reason to leave out a list, from what a shorter one took; empty if there is none."""
    if shorter.timing is None:
        return shorter.left_out
    growth = size / shorter.timing.contestant.ratings
    seconds, memory = shorter.timing.per_rating().median * size, shorter.memory * growth
    if seconds > SECONDS:
        return f"a round would take about {in_time(seconds)}"
    return f"a round would take about {in_bytes(memory)}" if memory > MEMORY else ""


def _row(name: str, size: int, cell: EdgeCell) -> tuple[Any, ...]:
    """Return a row of the table of numbers."""
    if cell.timing is None:
        return (name, size, *(None,) * 5, cell.left_out)
    each = Spread.of(1e9 * s for s in _each(cell.timing))
    return (name, size, cell.timing.contestant.ratings, *each, cell.memory, None)


def _numbers(cell: EdgeCell) -> tuple[str, str, str]:
    """Return milliseconds of a round, millions of ratings per second with their range, and the memory."""
    if cell.timing is None:
        return "-", "-", "-"
    rate = Spread.of(1e-6 / s for s in _each(cell.timing))
    time = f"{1e3 * Spread.of(cell.timing.seconds).median:,.1f}"
    return time, f"{rate.median:.2f} ({rate.low:.2f} - {rate.high:.2f})", in_bytes(cell.memory)


def _each(timing: Timing) -> list[float]:
    """Return the seconds for a rating in each repeat."""
    return [seconds / timing.contestant.ratings for seconds in timing.seconds]


if __name__ == "__main__":
    main()
