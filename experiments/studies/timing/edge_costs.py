"""Cost of central models with ratings as a list: the time of a round, and its memory, by the number of ratings."""

import importlib.util
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from roletrust_env.evaluation.resources import in_bytes, in_time
from roletrust_env.trust.central import Central
from studies.timing import edges as timing
from studies.timing.contestants import Timing, measure
from studies.timing.models import Limits

LISTS = "edges", "fused"
"""Ways to add up: NumPy, and loops compiled by numba."""

LIMITS = Limits(seconds=10.0, memory=8e9)

BYTES = 100
"""Memory that a rating of the plain round takes, which every list has."""


class EdgeCell(NamedTuple):
    """A round of a model: its timing and its peak memory in bytes, or the reason why there is none."""

    timing: Timing | None
    memory: int = 0
    left_out: str = ""


EdgeCosts = dict[tuple[str, str, int], EdgeCell]
"""Rounds by the model's name, the way to add up and the number of ratings."""


def measure_lists(
    models: Mapping[str, Central],
    sizes: Sequence[int],
    *,
    limits: Limits = LIMITS,
    repeats: int = 3,
    slice_s: float = 0.05,
    seed: int = 0,
    advance: Callable[[str], None] = lambda what: None,
) -> EdgeCosts:
    """Time a round of every model on lists of so many ratings, one after the other, since all would not fit.

    The first row of each number is the round of role-trust in plain NumPy, see `timing.edges.plain`.

    Args:
        models: Central models by name.
        sizes: Numbers of ratings.
        limits: Limits of a round. What a shorter list took grows with the number of ratings.
        repeats: Number of turns of each model.
        slice_s: Approximate length of a turn in seconds.
        seed: Random seed of the ratings.
        advance: Called with the next step, once for each model and size.

    Raises:
        ValueError: A list would take more memory than the limit.
    """
    if (needed := BYTES * max(sizes)) > limits.memory:
        raise ValueError(
            f"a list of {max(sizes):,} ratings would take about {in_bytes(needed)} of memory, and "
            f"{in_bytes(limits.memory)} are allowed, {limits.memory / BYTES:,.0f} ratings"
        )
    found: EdgeCosts = {}
    ways = LISTS if importlib.util.find_spec("numba") is not None else LISTS[:1]
    for size in sorted(sizes):
        edges = timing.Edges.of(size, seed)
        found[timing.PLAIN, LISTS[0], size] = _timed(timing.by_hand(edges), repeats, slice_s)
        for name, model in models.items():
            advance(f"{name}, {size:,} ratings")
            for way in ways:
                shorter = [cell for (one, of, n), cell in found.items() if (one, of) == (name, way) and n < size]
                reason = _too_much(shorter[-1], size, limits) if shorter else ""
                if reason:
                    found[name, way, size] = EdgeCell(None, left_out=reason)
                    continue
                made = timing.round_of(name, model, edges, fused=way == LISTS[1])
                found[name, way, size] = _timed(made, repeats, slice_s)
    return found


def _timed(made: timing.Measured, repeats: int, slice_s: float) -> EdgeCell:
    (taken,) = measure([made.contestant], repeats, slice_s)
    return EdgeCell(taken, made.memory)


def _too_much(shorter: EdgeCell, size: int, limits: Limits) -> str:
    """Return the reason to leave out a list, from what a shorter one took; empty if there is none."""
    if shorter.timing is None:
        return shorter.left_out
    growth = size / shorter.timing.contestant.ratings
    seconds, memory = shorter.timing.per_rating().median * size, shorter.memory * growth
    if seconds > limits.seconds:
        return f"a round would take about {in_time(seconds)}"
    return f"a round would take about {in_bytes(memory)}" if memory > limits.memory else ""
