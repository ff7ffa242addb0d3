"""Timing: contestants that take turns, in this process, so that other work on the machine affects
all alike.
"""

import os
import platform
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.provenance import software

COMPILED = "compiled torch"
"""Name of the library in which a step is one graph."""


class Contestant(NamedTuple):
    """A step to time.

    Attributes:
        name: Name in tables.
        step: Function that takes one step.
        amount: Number of actions of agents in a step.
    """

    name: str
    step: Callable[[], Any]
    amount: int


class Timing(NamedTuple):
    """Time of one step of a contestant in each repeat, in seconds."""

    contestant: Contestant
    seconds: tuple[float, ...]

    def rate(self) -> Interval:
        """Return the millions of actions per second: the median of the repeats, with the least and
        the greatest.
        """
        rates = self.contestant.amount / np.array(self.seconds) / 1e6
        return Interval(*map(float, np.percentile(rates, (50, 0, 100))))

    def ratio(self, peer: "Timing") -> float:
        """Return how many times faster than a peer this is: the lower quartile over the repeats."""
        own, other = (
            np.asarray(timing.seconds) / timing.contestant.amount for timing in (self, peer)
        )
        return float(np.quantile(other / own, 0.25))


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
