"""Cost of central models with ratings as a list: the time of a round, and its memory, by the number of ratings."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from roletrust_env.evaluation.resources import in_bytes, in_time
from roletrust_env.trust import TrustModel
from studies.timing import edges as timing
from studies.timing.contestants import Timing, measure
from studies.timing.models import Limits

LIMITS = Limits(seconds=10.0, memory=8e9)

BYTES = 100
"""Memory that a rating of the plain round takes, which every list has."""


class EdgeCell(NamedTuple):
    """A round of a model: its timing and its peak memory in bytes, or the reason why there is none."""

    timing: Timing | None
    memory: int = 0
    left_out: str = ""


EdgeCosts = dict[tuple[str, int], EdgeCell]
"""Rounds by the model's name and the number of ratings."""


def measure_lists(
    models: Mapping[str, TrustModel[Any]],
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
    for size in sorted(sizes):
        edges = timing.Edges.of(size, seed)
        found[timing.PLAIN, size] = _timed(timing.by_hand(edges), repeats, slice_s)
        for name, model in models.items():
            advance(f"{name}, {size:,} ratings")
            shorter = [cell for (other, n), cell in found.items() if other == name and n < size]
            reason = _too_much(shorter[-1], size, limits) if shorter else ""
            if reason:
                found[name, size] = EdgeCell(None, left_out=reason)
            else:
                found[name, size] = _timed(timing.round_of(name, model, edges), repeats, slice_s)
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
