"""The part of `python -m studies.speed` on ratings as a list of edges."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from rich.progress import Progress
from rich.table import Table

from roletrust_env.evaluation.resources import in_bytes
from roletrust_experiments.commands.console import number_table
from studies.timing import edges as timing
from studies.timing.contestants import Spread, Timing, measure
from studies.timing.targets import Target

_BATCHES = 100, 1000, 10_000
_LONG, _FEW = 2_000_000, 3  # ratings of a round from which on it has few turns, and their number

_CAPTION = (
    "{plain}: the same sums by hand; the orders of the ratings by agent are known; memory: peak, with the ratings; "
    "streams have {agents:,} agents and take numbers for names; copying an array moves {bandwidth:.1f} GB/s"
)


class Lists(NamedTuple):
    """What was measured.

    Attributes:
        rounds: Timings of rounds, by number of ratings that were asked for.
        memory: Peak memory of each of these in bytes, by the number and the name.
        streams: Timings of streams, in the order of the batches.
        copying: Timing of the copying of an array.
    """

    rounds: Mapping[int, Sequence[Timing]]
    memory: Mapping[tuple[int, str], int]
    streams: Sequence[Timing]
    copying: Timing

    @property
    def bytes_per_s(self) -> float:
        """Bytes that copying reads and writes in a second."""
        return timing.bytes_per_s(self.copying)

    @property
    def timings(self) -> list[Timing]:
        """All timings of ratings."""
        return [*(timing for some in self.rounds.values() for timing in some), *self.streams]


def measure_edges(
    sizes: Sequence[int], agents: int, repeats: int, slice_s: float, seed: int, progress: Progress
) -> Lists:
    """Time rounds of so many ratings, and streams with so many raters and as many providers.

    Args:
        sizes: Numbers of ratings of a round.
        agents: Number of raters of the streams.
        repeats: Number of turns of each contestant.
        slice_s: Approximate length of a turn, in seconds.
        seed: Random seed of the ratings.
        progress: Progress bar, which gets a task.
    """
    task = progress.add_task("Lists of ratings", total=len(sizes) + 2)
    rounds: dict[int, list[Timing]] = {}
    memory: dict[tuple[int, str], int] = {}
    for size in sizes:
        ready = timing.rounds(timing.Edges.of(size, seed))
        memory |= {(size, made.contestant.name): made.memory for made in ready}
        rounds[size] = measure([made.contestant for made in ready], _FEW if size > _LONG else repeats, slice_s)
        progress.advance(task)
    (copying,) = measure([timing.copying()], repeats, slice_s)
    progress.advance(task)
    streams = measure([timing.stream(batch, agents, seed) for batch in _BATCHES], repeats, slice_s)
    progress.advance(task)
    return Lists(rounds, memory, streams, copying)


def edges_table(lists: Lists) -> Table:
    """Return the table."""
    bandwidth = lists.bytes_per_s / 1e9
    agents = lists.streams[0].contestant.agents
    caption = _CAPTION.format(plain=timing.PLAIN, agents=agents, bandwidth=bandwidth)
    headings = "ratings", "M ratings/s", "least - greatest", f"/ {timing.PLAIN}", "memory"
    table = number_table("Ratings as a list", caption, *headings)
    for size, timings in lists.rounds.items():
        for t in timings:
            ratio = 1 / t.times_dearer(timings[0]).median
            table.add_row(*_rates(t), f"{ratio:.1f}", in_bytes(lists.memory[size, t.contestant.name]))
    for t in lists.streams:
        table.add_row(*_rates(t), "", "")
    return table


def edge_targets(lists: Lists) -> list[Target]:
    """Return the promised and the measured speeds."""
    million, ten = 1_000_000, 10_000_000
    found = {(size, t.contestant.name): _millions(t) for size, some in lists.rounds.items() for t in some}
    streams = {t.contestant.ratings: _millions(t) for t in lists.streams}
    memory = [lists.memory[ten, name] / 1e9 for size, name in lists.memory if size == ten]
    return [
        Target("M ratings/s of a list of 1,000,000", 10.0, True, found.get((million, timing.EDGES))),
        Target("GB of memory for a list of 10,000,000", 3.0, False, Spread.of([max(memory)]) if memory else None),
        Target("M ratings/s of a stream in batches of 10,000", 2.5, True, streams.get(10_000)),
    ]


def _millions(timing: Timing) -> Spread:
    """Return millions of ratings per second."""
    return Spread.of(timing.contestant.ratings / seconds / 1e6 for seconds in timing.seconds)


def _rates(timing: Timing) -> tuple[str, str, str, str]:
    rate = _millions(timing)
    size = f"{timing.contestant.ratings:,}"
    return timing.contestant.name, size, f"{rate.median:.2f}", f"{rate.low:.2f} - {rate.high:.2f}"
