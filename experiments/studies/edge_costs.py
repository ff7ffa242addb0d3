"""What central trust models cost on lists of ratings: the time of a round, and its memory, by the
number of ratings.

Beside the models stands a round of role-trust in plain NumPy. Then role-trust is timed in a stream
of small batches, and `roletrust rate` on a file beside a plain mean. On a quiet machine a quarter
of an hour.
"""

import subprocess
import sys
import tempfile
import tracemalloc
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from time import process_time
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env import make_scenario
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.logs import TrustStream
from roletrust_env.memory import in_bytes
from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trees import map_kinds
from roletrust_env.trust import Ratings, TrustModel, trust_models
from roletrust_env.trust.edges import edge_model, runs_on_edges, start_on_edges
from roletrust_env.trust.models.central.role_trust import RoleTrust
from studies.study import Recipe, Study
from studies.timing import Contestant, Timing, machine, measure, spread, times_figure

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


class Options(NamedTuple):
    """Specs of central models, all installed ones if left out; numbers of ratings, of agents of
    streams, of rows.
    """

    model: tuple[str, ...] = ()
    ratings: tuple[int, ...] = (1_000_000, 10_000_000)
    agents: tuple[int, ...] = (10_000, 1_000_000)
    rows: int = 1_000_000


RECIPES = {
    "edge-costs": Recipe(
        Options(), {name: name for name in ("edge-costs.md", "edge-costs.csv", "edge-costs.png")}
    )
}

PLAIN = "plain NumPy"
"""Name of the round of role-trust that is written by hand."""

EACH = 10
"""Ratings of each rater, and of each provider, on average."""

_HEADER = (
    *(
        "model",
        "ratings_asked",
        "ratings",
        "ns_per_rating",
        "ns_per_rating_least",
        "ns_per_rating_greatest",
    ),
    "peak_bytes",
)
_REPEATS, _SLICE_S = 3, 0.05  # turns of each model, and their approximate length in seconds
_BATCH, _BATCHES = 1000, 1000  # ratings of a batch of a stream, and batches
_RUNS = 5  # of a command
_RATE = "from roletrust_experiments import main; main()"
_MEAN = """
import sys
from pyarrow import csv
table = csv.read_csv(sys.argv[1]).group_by("ratee").aggregate([("rating", "mean"), ("rating", "count")])
csv.write_csv(table.sort_by([("rating_mean", "descending")]), sys.argv[2])
"""  # noqa: E501


class Edges(NamedTuple):
    """Pairs that rate in every round, sorted by provider, and two rounds of ratings.

    Attributes:
        raters: Place of the rater of each pair, shape (E,).
        providers: Place of the provider of each pair, shape (E,).
        values: Ratings of two rounds, shape (2, E).
        side: Number of raters, and of providers.
    """

    raters: Ints
    providers: Ints
    values: Floats
    side: int

    @classmethod
    def of(cls, ratings: int, seed: int) -> "Edges":
        """Return about so many random pairs."""
        rng, side = np.random.default_rng(seed), max(2, ratings // EACH)
        keys = np.unique(rng.integers(0, side**2, ratings))
        return cls(keys % side, keys // side, rng.random((2, len(keys))), side)


def main(study: Study[Options]) -> None:
    """Time all models on all lists, and write their costs."""
    sizes, scenario = sorted(study.options.ratings), make_scenario("paper-3x3")
    models = {
        name: parse_trust_model(name, scenario) for name in study.options.model or trust_models()
    }
    chosen = {
        name: edge_model(model)
        for name, model in models.items()
        if study.options.model or runs_on_edges(model)
    }
    parts = [
        "# What the trust models cost on lists of ratings",
        "![Nanoseconds per rating of each trust model, on lists of one and of ten million "
        "ratings](edge-costs.png)",
        f"One round in float64 in which all pairs rate again, {EACH} ratings for each rater and "
        "each provider, the "
        f"median of the repeats; {PLAIN}: the round of role-trust by hand; memory: peak from "
        "nothing to the end of "
        f"a round, with the ratings.",
    ]
    rows, pictured = [], dict[str, dict[str, Interval]]()
    for size in sizes:
        costs = measure_lists(chosen, Edges.of(size, study.seed))
        rows += [
            (name, size, timing.contestant.amount, *timing.each(), memory)
            for name, (timing, memory) in costs.items()
        ]
        pictured[f"{size:,} ratings"] = {name: timing.each() for name, (timing, _) in costs.items()}
        lines = [[name, *_cells(*cell)] for name, cell in costs.items()]
        parts += [
            f"## {size:,} ratings",
            markdown_table(["model", "ms a round", "M ratings/s", "memory"], lines, 1),
        ]
    lines = [
        [f"{agents:,}", *(f"{rate:.2f}" for rate in stream_rates(agents, study.seed))]
        for agents in study.options.agents
    ]
    parts += [
        "## Streams",
        f"role-trust in a `TrustStream`, by the time of the CPU: {_BATCHES:,} batches of "
        f"{_BATCH:,} ratings "
        "between random agents, and then the same pairs again.",
        markdown_table(["agents of each role", "M ratings/s, lower quartile", "median"], lines, 1),
        *file_costs(study.options.rows, study.seed),
    ]
    study.csv("edge-costs.csv", _HEADER, rows)
    study.figure("edge-costs.png", times_figure(pictured))
    study.page("edge-costs.md", *parts, f"Made by `{study.command}` on {machine()}.")


def measure_lists(
    models: Mapping[str, TrustModel[Any]], edges: Edges
) -> dict[str, tuple[Timing, int]]:
    """Time a round of every model on a list, one after the other, since all would not fit.

    Returns:
        The timing and the peak memory in bytes, from nothing to the end of a round. First stands
        the round of role-trust in plain NumPy, see `plain`.
    """
    costs = {PLAIN: _timed(PLAIN, edges, partial(plain, edges))}
    for name, model in models.items():
        costs[name] = _timed(name, edges, partial(on_edges, edges, model))
    return costs


def on_edges(edges: Edges, model: TrustModel[Any]) -> Callable[[], Any]:
    """Return a function that plays the third round of a central model, and returns the state after
    it.
    """
    shape = (edges.side, edges.side)
    state = map_kinds(
        lambda kind, leaf: np.zeros(len(edges.raters)) if kind in ("pair", "age") else leaf,
        start_on_edges(model, shape),
    )

    def after(state: Any, values: Floats) -> Any:
        return model.update(
            state, Ratings(values, raters=edges.raters, providers=edges.providers, shape=shape)
        )

    for values in edges.values:
        state = after(state, values)
    return lambda: after(state, edges.values[0])


def plain(edges: Edges) -> Callable[[], Any]:
    """Return a function that plays the third round of role-trust, written by hand for this one case
    in NumPy.
    """
    raters, providers, (first, second), side = edges
    model = RoleTrust()
    given, received = (
        np.maximum(np.bincount(agents, minlength=side), 1) for agents in (raters, providers)
    )
    rates, provides = (np.bincount(agents, minlength=side) > 0 for agents in (raters, providers))

    def after(
        tor: Floats, top: Floats, last: Floats | None, values: Floats
    ) -> tuple[Floats, Floats, Floats]:
        average = np.bincount(providers, values, side) / received
        gaps = np.sqrt(np.abs(values - average[providers]))
        quality = 1 - np.bincount(raters, gaps, side) / given
        tor = np.where(rates, tor + model.lam * (quality - tor), tor)
        rho = np.sinc(1 - values) if last is None else np.sinc(1 - values) * np.sinc(values - last)
        quality = np.bincount(providers, rho * tor[raters] * values, side) / received
        return tor, np.where(provides, top + model.lam * (quality - top), top), values.copy()

    start = np.full(side, model.initial)
    state = after(*after(start, start, None, first), second)
    return lambda: after(*state, first)


def stream_rates(agents: int, seed: int) -> tuple[float, float]:
    """Return how many millions of ratings a stream of role-trust takes per second: lower quartile,
    and median.
    """
    rng, stream, seconds = np.random.default_rng(seed), TrustStream(RoleTrust()), list[float]()
    batches = [(*rng.integers(0, agents, (2, _BATCH)), rng.random(_BATCH)) for _ in range(_BATCHES)]
    for batch in batches * 2:
        began = process_time()
        stream.update(*batch)
        seconds.append(process_time() - began)
    low, middle = np.percentile(_BATCH / np.array(seconds) / 1e6, (25, 50))
    return float(low), float(middle)


def file_costs(rows: int, seed: int) -> list[str]:
    """Return what `roletrust rate` and a plain mean in pyarrow take of the CPU for so many rows, in
    turn.
    """
    rng = np.random.default_rng(seed)
    raters, ratees = (
        rng.integers(0, max(2, rows // EACH), rows),
        rng.integers(0, max(2, rows // EACH**2), rows),
    )
    lines = (
        f"u{rater},i{other},{rating:.2f}\n"
        for rater, other, rating in zip(raters, ratees, rng.random(rows), strict=True)
    )
    with tempfile.TemporaryDirectory() as folder:
        path, rated, means = (
            str(Path(folder) / name) for name in ("log.csv", "rated", "means.csv")
        )
        Path(path).write_text("".join(["rater,ratee,rating\n", *lines]))
        ours, plainly = (
            (_RATE, "rate", path, "--model", "role-trust", "--out", rated),
            (_MEAN, path, means),
        )
        taken = np.array([[_cpu_s(ours), _cpu_s(plainly)] for _ in range(_RUNS)])
    (ours_s, plainly_s), ratio = (
        np.median(taken, axis=0),
        np.percentile(taken[:, 0] / taken[:, 1], 75),
    )
    return [
        "## A log in a file",
        f"`roletrust rate --model role-trust` takes {ours_s:.1f} s of the CPU for {rows:,} rows. A "
        "script of pyarrow "
        f"that reads it and writes plain means: {plainly_s:.1f} s. The upper quartile of their "
        f"ratio is {ratio:.1f}.",
    ]


def _cpu_s(arguments: Sequence[str]) -> float:
    """Run a text of Python with its arguments, and return the time that it took of the CPU."""
    before = getrusage(RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", *arguments], check=True, stdout=subprocess.DEVNULL)
    after = getrusage(RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _timed(name: str, edges: Edges, make: Callable[[], Callable[[], Any]]) -> tuple[Timing, int]:
    tracemalloc.start()
    step = make()
    step()
    memory = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    (taken,) = measure([Contestant(name, step, len(edges.raters))], _REPEATS, _SLICE_S)
    return taken, memory + edges.raters.nbytes + edges.providers.nbytes + edges.values.nbytes


def _cells(timing: Timing, memory: int) -> tuple[str, str, str]:
    """Return milliseconds of a round, millions of ratings per second with their range, and the
    memory.
    """
    rate = timing.rate()
    time = f"{1e3 * spread(timing.seconds).value:,.1f}"
    return time, f"{rate.value:.2f} ({rate.low:.2f} - {rate.high:.2f})", in_bytes(memory)
