"""Timing: contestants that take turns, in this process, so that other work on the machine affects
all alike.
"""

import math
import os
import platform
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from roletrust_env import Random
from roletrust_env.arrays import namespace
from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.provenance import software
from roletrust_env.trust import Ratings, Traits, TrustModel
from roletrust_env.trust.model import start_model
from roletrust_experiments.plots.charts import Panel, Series, panels_figure

COMPILED = "compiled torch"
"""Name of the library in which a step is one graph."""


class Contestant(NamedTuple):
    """A step to time.

    Attributes:
        name: Name in tables.
        step: Function that takes one step.
        amount: Number of ratings, or of actions of agents, in a step.
    """

    name: str
    step: Callable[[], Any]
    amount: int


def spread(values: Sequence[float] | np.ndarray) -> Interval:
    """Return the median of repeats, with the least and the greatest."""
    return Interval(*map(float, np.percentile(values, (50, 0, 100))))


class Timing(NamedTuple):
    """Time of one step of a contestant in each repeat, in seconds."""

    contestant: Contestant
    seconds: tuple[float, ...]

    def each(self) -> Interval:
        """Return the nanoseconds for each rating or action."""
        return spread(1e9 * np.array(self.seconds) / self.contestant.amount)

    def rate(self) -> Interval:
        """Return the millions of ratings or actions per second."""
        return spread(self.contestant.amount / np.array(self.seconds) / 1e6)

    def ratio(self, peer: "Timing") -> float:
        """Return how many times faster than a peer this is: the lower quartile over the repeats."""
        own, other = (
            np.asarray(timing.seconds) / timing.contestant.amount for timing in (self, peer)
        )
        return float(np.quantile(other / own, 0.25))


class Size(NamedTuple):
    """Numbers of raters and of providers."""

    raters: int
    providers: int

    def __str__(self) -> str:
        return f"{self.raters:,} x {self.providers:,}"


def measure(contestants: Sequence[Contestant], repeats: int, slice_s: float) -> list[Timing]:
    """Time contestants in turn and repeatedly.

    Args:
        contestants: Contestants.
        repeats: Number of turns of each contestant.
        slice_s: Approximate length of a turn in seconds; a turn is at least one step.
    """
    steps = [_steps_in(contestant, slice_s) for contestant in contestants]
    seconds: list[list[float]] = [[] for _ in contestants]
    for _ in range(repeats):
        for contestant, n, times in zip(contestants, steps, seconds, strict=True):
            times.append(_time(contestant, n))
    return [
        Timing(contestant, tuple(times))
        for contestant, times in zip(contestants, seconds, strict=True)
    ]


def _time(contestant: Contestant, steps: int) -> float:
    step = contestant.step
    start = time.perf_counter()
    for _ in range(steps):
        step()
    return (time.perf_counter() - start) / steps


def _steps_in(contestant: Contestant, seconds: float) -> int:
    """Return the number of steps that fill a time."""
    _time(
        contestant, 3
    )  # torch compiles one graph for the first round and one for those that follow
    steps = 1
    while (elapsed := _time(contestant, steps) * steps) < seconds / 4:
        steps *= 2
    return max(1, round(steps * seconds / elapsed))


def times_figure(intervals: Mapping[str, Mapping[str, Interval]]) -> Figure:
    """Return the nanoseconds per rating of contestants, in a row each; the outer keys are the
    labels of the series.
    """
    series = [
        Series(label, list(times), list(times.values())) for label, times in intervals.items()
    ]
    panel = Panel("", "", "nanoseconds per rating", series, "log")
    return panels_figure("", [panel], "bars: least to greatest of the repeats")


def machine() -> str:
    """Return the machine and the software that timings are of, in words."""
    packages = software()["packages"]
    return (
        f"{os.cpu_count()} cores of {platform.machine()}, Python {platform.python_version()}, "
        f"numpy {packages['numpy']}, torch {packages['torch']} on 1 of them"
    )


def compiled(step: Callable[..., Any]) -> Callable[..., Any]:
    """Return a step on tensors, compiled by torch into one graph."""
    import torch

    settings: dict[str, Any] = {
        # Steps of several sizes share their code, and torch limits the compilations of a code by
        # default.
        "isolate_recompiles": True,
        # The library does not change during the timing; guards on the arguments stay.
        "options": {"guard_filter_fn": torch.compiler.skip_guard_on_globals_unsafe},
    }
    made: Any = torch.compile(step, dynamic=False, fullgraph=True, **settings)
    in_inference: Callable[..., Any] = torch.inference_mode()(made)
    return in_inference


def source(library: str, seed: int, device: str = "cpu") -> tuple[Any, Random]:
    """Return an array with the library, device and dtype, and a matching source of random
    numbers.
    """
    like: Any = np.zeros((), np.float32)
    if "torch" in library:
        import torch

        like = torch.zeros((), device=device)
    return like, Random(np.random.default_rng(seed), like)


def trust_update(
    name: str, model: TrustModel[Any], size: Size, library: str, seed: int
) -> Contestant:
    """Return a trust model as a contestant: one update in float32 in which all rate all, and the
    published trust.

    Args:
        name: Name of the contestant.
        model: Trust model. If it takes peers, rater i is provider i, and peers do not rate
            themselves.
        size: Size of the game.
        library: `NumPy` or `COMPILED`.
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
    taken = compiled(update) if library == COMPILED else update
    with warnings.catch_warnings(action="ignore"):  # on caches that torch.compile looks through
        taken(state, ratings)
    return Contestant(name, lambda: taken(state, ratings), math.prod(size))
