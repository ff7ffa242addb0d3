"""`python -m studies.speed`: the speed of the games, beside mpe2 and VMAS in the same run."""

import importlib.util
import math
import os
import platform
from collections.abc import Callable, Sequence
from functools import partial
from importlib.metadata import distributions
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table

from roletrust_env import Game, make_scenario
from roletrust_env.storage.files import prepare_folder, write_csv, write_json
from roletrust_env.storage.provenance import provenance
from roletrust_experiments.commands.console import console, number_table, option, print_next, progress_bar
from roletrust_experiments.commands.options import OptionalOut, Seed, Threads
from studies.running import run
from studies.speed_edges import Lists, edge_targets, edges_table, measure_edges
from studies.timing import contestants as timing
from studies.timing.contestants import Contestant, Spread, Timing, measure
from studies.timing.models import Size, trust_update
from studies.timing.targets import Target
from studies.timing.threads import torch_threads

_PEERS = ("array-api-compat", "torch", "mpe2", "vmas")
_EXTRAS = {"torch": "torch", "mpe2": "peers", "vmas": "peers"}


class Plan(NamedTuple):
    """Sizes and repeats of a measurement.

    Attributes:
        batches: Sizes of the batches for NumPy, torch and VMAS.
        compiled: Sizes of the batches for compiled torch.
        sides: Numbers of raters, and of as many providers, for the time per rating.
        repeats: Number of turns of each contestant.
        slice_s: Approximate length of a turn, in seconds.
        edges: Numbers of ratings of a round as a list of edges.
        stream: Number of raters, and of as many providers, of a stream.
    """

    batches: tuple[int, ...]
    compiled: tuple[int, ...]
    sides: tuple[int, ...]
    repeats: int
    slice_s: float
    edges: tuple[int, ...]
    stream: int


_MILLION = 1_000_000
_SIDES = 3, 30, 300, 3000
FULL = Plan((1024, 8192, 65536), (1024, 8192, 65536), _SIDES, 11, 0.4, edges=(_MILLION, 10 * _MILLION), stream=_MILLION)
QUICK = Plan((1024, 8192), (8192,), _SIDES, 5, 0.1, edges=(_MILLION // 10,), stream=_MILLION // 10)


def speed(
    quick: Annotated[
        bool, typer.Option("--quick", help="Measure fewer sizes and repeats, in half a minute instead of five.")
    ] = False,
    threads: Threads = 1,
    seed: Seed = 0,
    out: OptionalOut = None,
) -> None:
    """Measure [bold]how fast the games run[/]: one environment, batches, and time per rating up to 3,000x3,000.

    Ratings as a list of edges, as `roletrust rate` reads them, are measured up to ten million beside the same sums in
    plain NumPy and the bandwidth of the memory, and streams of ratings with two million agents.

    mpe2 and VMAS are measured in the same run if they are installed; all contestants take turns. A step includes all
    that a learner needs: drawing noise, playing the round, and computing observations and rewards. The tables show the
    median of the repeats, the least and the greatest.

    Written with --out: [green]speed.csv speed.json[/].

    [bold]Examples[/]

    [dim]# the short run[/]
    [cyan]python -m studies.speed --quick[/]

    [dim]# the full run on two threads, with the results saved[/]
    [cyan]python -m studies.speed --threads 2 --out results/speed[/]
    """
    if out is not None:
        prepare_folder(out)
    plan = QUICK if quick else FULL
    with progress_bar() as progress, torch_threads(threads):
        steps, skipped = [], []
        for games, players in _players(plan, seed).items():
            found, missing = _race(players, plan, f"Steps of {games:,}", progress)
            steps += found
            skipped += missing
        ratings, _ = _race(_raters(plan, seed), plan, "Ratings", progress)
        lists = measure_edges(plan.edges, plan.stream, plan.repeats, plan.slice_s, seed, progress)
    targets = _targets(steps, ratings) + ([] if quick else [*edge_targets(lists), _learner(seed)])
    for table in (_steps_table(steps, threads), _ratings_table(ratings), edges_table(lists), _targets_table(targets)):
        console.print(table)
    for reason in dict.fromkeys(skipped):
        console.print(f"[dark_orange3]not measured:[/] {escape(reason)}", soft_wrap=True)
    if out is not None:
        about = {"command": "python -m studies.speed", "quick": quick, **_machine(threads), **_software(seed)}
        _write(out, about, steps, ratings, lists, targets)
        console.print(f"Written to {out}: speed.csv, speed.json", soft_wrap=True)
    print_next("costs", option("--threads", threads, 1))


class Entry(NamedTuple):
    """A contestant that is not made yet: the package that it needs, and a function that makes it."""

    package: str
    make: Callable[[], Contestant]


def _players(plan: Plan, seed: int) -> dict[int, list[Entry]]:
    """Return the contestants for steps per second by number of games, so that equal sizes are measured together."""
    one = [Entry("numpy", partial(timing.one_environment, seed)), Entry("mpe2", partial(timing.simple_adversary, seed))]
    players = {1: one}
    for games in sorted({*plan.batches, *plan.compiled}):
        entries = players[games] = []
        if games in plan.batches:
            entries.append(Entry("vmas", partial(timing.simple_spread, games, seed)))
            entries.append(Entry("numpy", partial(timing.batch, "NumPy", games, seed)))
            entries.append(Entry("torch", partial(timing.batch, "torch", games, seed)))
            entries.append(Entry("numpy", partial(timing.attack_tasks, games, seed)))
        if games in plan.compiled:
            entries.append(Entry("torch", partial(timing.batch, "compiled torch", games, seed)))
    return players


def _raters(plan: Plan, seed: int) -> list[Entry]:
    """Return the contestants for the time per rating."""
    model = Game(make_scenario("paper-3x3")).model
    entries = []
    for side in plan.sides:
        entries.append(Entry("numpy", partial(trust_update, "trust model", model, Size(side, side), "NumPy", seed)))
        entries.append(Entry("numpy", partial(timing.whole_round, side, seed)))
    return entries


def _race(entries: Sequence[Entry], plan: Plan, label: str, progress: Progress) -> tuple[list[Timing], list[str]]:
    """Make the contestants and time them. Return the timings, and the reasons why some could not be made."""
    task = progress.add_task(f"{label}: getting ready", total=len(entries))
    contestants, skipped = [], []
    for package, make in entries:
        if importlib.util.find_spec(package) is None:
            skipped.append(f"{package} is not installed: pip install 'roletrust-env[{_EXTRAS[package]}]'")
        else:
            try:
                contestants.append(make())
            except RuntimeError as error:  # such as torch.compile without a C++ compiler
                skipped.append(f"{package}: {str(error).strip().splitlines()[0]}")
        progress.advance(task)
    progress.update(task, description=label, completed=0, total=len(contestants) * plan.repeats)
    timings = measure(contestants, plan.repeats, plan.slice_s, lambda: progress.advance(task))
    return timings, skipped


def _targets(steps: Sequence[Timing], ratings: Sequence[Timing]) -> list[Target]:
    """Return the promised and the measured speeds."""
    played = {(t.contestant.name, t.contestant.games): t for t in steps}
    rated = {(t.contestant.name, t.contestant.agents // 2): t for t in ratings}

    def faster(ours: str, peer: str, games: int, bound: float) -> Target:
        a, b = played.get((ours, games)), played.get((peer, games))
        what = f"{ours}{f' of {games:,}' * (games > 1)} / {peer}"
        return Target(what, bound, True, a.times_faster(b) if a and b else None)

    def steady(name: str, side: int, bound: float) -> Target:
        a, b = rated.get((name, 3000)), rated.get((name, side))
        return Target(f"{name}, 3,000 x 3,000 / {side} x {side}", bound, False, a.times_dearer(b) if a and b else None)

    tasks = played.get(("attack task batch", 1024))
    million = Spread.of(rate / 1e6 for rate in tasks.env_steps()) if tasks else None

    return [
        Target("attack task batch of 1,024, million env-steps/s", 1.0, True, million),
        faster("one environment", "mpe2 simple_adversary", 1, 7.0),
        faster("NumPy batch", "VMAS simple_spread", 1024, 12.0),
        faster("compiled torch batch", "VMAS simple_spread", 8192, 20.0),
        steady("trust model", 300, 1.5),
        steady("whole round", 30, 2.0),
    ]


def _learner(seed: int) -> Target:
    """Return the promised and the measured cost of the environment for a learner."""
    what = "frames/s of PPO on 256 attack tasks / on no game"
    if importlib.util.find_spec("stable_baselines3") is None:
        return Target(what, 0.8, True, None)
    from studies.timing.ppo_speed import ppo_speed

    share = ppo_speed(seed=seed).share
    return Target(what, 0.8, True, Spread(share, share, share))


def _steps_table(steps: Sequence[Timing], threads: int) -> Table:
    caption = f"torch on {threads} thread{'s' * (threads > 1)}; an agent-step is one agent acting once"
    table = number_table("Steps per second", caption, "games", "env-steps/s", "agent-steps/s", "least - greatest")
    for t in steps:
        acts, style = t.agent_steps(), "dim" if t.contestant.name.startswith(("mpe2", "VMAS")) else None
        cells = [f"{t.contestant.games:,}", _rate(t.env_steps().median), _rate(acts.median)]
        table.add_row(t.contestant.name, *cells, f"{_rate(acts.low)} - {_rate(acts.high)}", style=style)
    return table


def _ratings_table(ratings: Sequence[Timing]) -> Table:
    caption = "a whole round draws noise, updates trust, plays the game and makes observations"
    headings = "SR x SP", "ns per rating", "least - greatest", "ms in all"
    table = number_table("Time per rating, one game on NumPy", caption, *headings)
    for t in ratings:
        side, each = t.contestant.agents // 2, Spread.of(1e9 * s for s in t.per_rating())
        cells = [f"{side:,} x {side:,}", f"{each.median:,.1f}", f"{each.low:,.1f} - {each.high:,.1f}"]
        table.add_row(t.contestant.name, *cells, f"{each.median * t.contestant.ratings / 1e6:,.3f}")
    return table


def _targets_table(targets: Sequence[Target]) -> Table:
    caption = "/: ratios of agent-steps/s, and of time per rating; the median decides"
    table = number_table("What was promised", caption, "promised", "found", "least - greatest", "")
    for target in targets:
        promised = f"{'at least' if target.at_least else 'at most'} {target.bound:g}"
        if target.found is None:
            table.add_row(target.what, promised, "not measured", "", "", style="dim")
            continue
        median, low, high = target.found
        verdict = "[green]ok[/]" if target.ok else "[bold red]not ok[/]"
        table.add_row(target.what, promised, f"{median:.2f}", f"{low:.2f} - {high:.2f}", verdict)
    return table


def _rate(value: float) -> str:
    """Return a rate with three digits."""
    for unit, size in (("M", 1e6), ("k", 1e3)):
        if value >= size:
            return f"{value / size:,.{max(0, 2 - int(math.log10(value / size)))}f} {unit}"
    return f"{value:.3g}"


def _write(
    out: Path,
    about: dict[str, Any],
    steps: Sequence[Timing],
    ratings: Sequence[Timing],
    lists: Lists,
    targets: Sequence[Target],
) -> None:
    header: tuple[str, ...] = ("name", "games", "agents", "ratings", "step_us", "step_us_least", "step_us_greatest")
    header += ("env_steps_per_s", "agent_steps_per_s", "ns_per_rating")
    rows: list[tuple[Any, ...]] = []
    for t in (*steps, *ratings, *lists.timings):
        who, per_rating = t.contestant, t.per_rating().median * 1e9 if t.contestant.ratings else None
        micros = (1e6 * s for s in Spread.of(t.seconds))
        rates = t.env_steps().median, t.agent_steps().median
        rows.append((who.name, who.games, who.agents, who.ratings or None, *micros, *rates, per_rating))
    write_csv(out / "speed.csv", header, rows)
    promises = [{**t._asdict(), "found": t.found and t.found._asdict(), "ok": t.ok} for t in targets]
    memory = [{"ratings": size, "name": name, "bytes": peak} for (size, name), peak in lists.memory.items()]
    found = {**about, "targets": promises, "peak_memory": memory, "copied_bytes_per_s": lists.bytes_per_s}
    write_json(out / "speed.json", found)


def _machine(threads: int) -> dict[str, Any]:
    machine = {"processor": platform.machine(), "system": platform.system(), "cores": os.cpu_count()}
    return {"machine": machine, "torch_threads": threads}


def _software(seed: int) -> dict[str, Any]:
    """Return the software that affects the numbers."""
    about = provenance(Game(make_scenario("paper-3x3")), seed)
    found = {d.metadata["Name"]: d.version for d in distributions()}
    about["packages"] |= {name: found[name] for name in _PEERS if name in found}
    return about


if __name__ == "__main__":
    run(speed)
