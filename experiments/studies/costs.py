"""`python -m studies.costs`: the time that every trust model takes, by the size of the game, and its growth."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from roletrust_env import make_scenario
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.storage.files import prepare_folder, replacing, write_csv
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust import Traits, TrustModel, trust_models
from roletrust_env.trust.edge_state import edge_model, runs_on_edges
from roletrust_experiments.commands.console import console, number_table, option, print_next, progress_bar
from roletrust_experiments.commands.options import ModelsOption, OptionalOut, Seed, Threads
from studies.costs_edges import show_lists
from studies.running import run
from studies.timing.contestants import Spread, machine, measure
from studies.timing.edge_costs import measure_lists
from studies.timing.edges import copying
from studies.timing.models import LIBRARIES, LIMITS, Cell, Found, Size, growth, measure_models, sizes
from studies.timing.threads import torch_threads

_SIDES = 3, 30, 300
_POWERS = {"NumPy": ("S^", "P^")}
"""Libraries whose table shows the growth, with its headings."""

_CAPTION = (
    "One update in float32 in which all raters rate all providers, the median of the repeats. S^ and P^ are the powers "
    "of the numbers of raters and of providers that its time grows by on NumPy, from {small:,} to {large:,} of one "
    "with {large:,} of the other; fixed costs make them less than the model's own."
)


def costs(
    model: ModelsOption = None,
    compiled: Annotated[
        bool,
        typer.Option("--compiled", help="Also measure models compiled by torch, up to some minutes for each size."),
    ] = False,
    compile_limit: Annotated[
        float, typer.Option(min=1, help="Seconds that compiling one model for one size may take; longer is left out.")
    ] = LIMITS.compiling,
    side: Annotated[
        list[int] | None,
        typer.Option(
            min=1,
            help="Number of raters, and of providers; two or more of them; 3, 30 and 300 if left out.",
            show_default=False,
        ),
    ] = None,
    ratings: Annotated[
        list[int] | None,
        typer.Option(
            min=1,
            help="Measure central models on a list of so many ratings in place of all pairs; repeat for more.",
            show_default=False,
        ),
    ] = None,
    threads: Threads = 1,
    seed: Seed = 0,
    out: OptionalOut = None,
) -> None:
    """Measure [bold]what the trust models cost[/]: time per rating by size, and its growth with raters and providers.

    The models take turns, so that other work on the machine affects all alike. A size at which an update is expected
    to take more than 5 seconds or 3 GB is left out, and a line says so.

    All models are compiled before a compiled one is timed, two at a time. Compiled code stays in torch's cache on disk,
    so that an interrupted run continues where it stopped, and a second run is quick.

    Written with --out: [green]model-costs.csv model-costs.md[/], and with --ratings in place of these
    [green]edge-costs.csv edge-costs.md[/].

    [bold]Examples[/]

    [dim]# all models on NumPy[/]
    [cyan]python -m studies.costs[/]

    [dim]# the table in docs/[/]
    [cyan]python -m studies.costs --compiled --out results/costs[/]

    [dim]# central models on lists of ratings, beside plain NumPy and the bandwidth of the memory[/]
    [cyan]python -m studies.costs --ratings 1000000 --ratings 10000000[/]
    """
    if ratings:
        if side or compiled:
            raise ValueError("--ratings is measured without --side and --compiled")
        _costs_of_lists(model, ratings, threads, seed, out)
        return
    sides = sorted(set(side or _SIDES))
    if len(sides) < 2:
        raise ValueError(f"--side {sides[0]} is the only size; growth needs at least two")
    if out is not None:
        prepare_folder(out)
    scenario, names = make_scenario("paper-3x3"), model or list(trust_models())
    models = {name: parse_trust_model(name, scenario) for name in names}
    libraries = LIBRARIES if compiled else LIBRARIES[:1]
    with progress_bar() as progress, torch_threads(threads):
        steps = sum(len(sizes(sides, library)) for library in libraries) + compiled * len(sides)
        task = progress.add_task("", total=len(models) * steps)
        found = measure_models(
            models,
            sides,
            libraries,
            limits=LIMITS._replace(compiling=compile_limit),
            threads=threads,
            seed=seed,
            advance=lambda what: progress.update(task, description=what, advance=1),
        )
    caption = _CAPTION.format(small=sides[-2], large=sides[-1])
    tables = {library: _lines(models, found, sides, library) for library in libraries}
    for library, (headings, *rows) in tables.items():
        table = number_table(f"Nanoseconds per rating, {library}", "", *headings[1:])
        for name, *numbers in rows:
            table.add_row(escape(name), *numbers)
        console.print(table)
    console.print(caption)
    reasons = _left_out(found)
    for reason in reasons:
        console.print(f"[dark_orange3]left out:[/] {escape(reason)}", soft_wrap=True)
    if out is not None:
        write_csv(out / "model-costs.csv", *_cells(models, found))
        with replacing(out / "model-costs.md") as path:
            path.write_text(_page(tables, caption, reasons, threads), encoding="utf-8")
        console.print(f"Written to {out}: model-costs.csv, model-costs.md", soft_wrap=True)
    print_next("speed", "--quick", option("--threads", threads, 1))


def _costs_of_lists(names: list[str] | None, sizes: Sequence[int], threads: int, seed: int, out: Path | None) -> None:
    """Measure central models on lists of ratings."""
    if out is not None:
        prepare_folder(out)
    scenario = make_scenario("paper-3x3")
    models = {name: parse_trust_model(name, scenario) for name in names or trust_models()}
    if names is None:
        models = {name: model for name, model in models.items() if runs_on_edges(model)}
    chosen = {name: edge_model(model) for name, model in models.items()}
    with progress_bar() as progress:
        task = progress.add_task("", total=len(chosen) * len(set(sizes)))
        (copied,) = measure([copying()], 5, 0.1)
        found = measure_lists(
            chosen,
            sorted(set(sizes)),
            seed=seed,
            advance=lambda what: progress.update(task, description=what, advance=1),
        )
    show_lists(found, copied, machine(threads), out)


def _lines(models: Mapping[str, TrustModel[Any]], found: Found, sides: Sequence[int], library: str) -> list[list[str]]:
    """Return the table of a library: its headings, and a row for each model."""
    squares = [Size(side, side) for side in sides]
    lines = [["model", "grows as", *(f"{side}x{side}" for side in sides), *_POWERS.get(library, ())]]
    for name, model in models.items():
        cells = [_nanoseconds(found[name, library, size]) for size in squares]
        powers = ["-" if math.isnan(power) else f"{power:.2f}" for power in growth(found, name)]
        lines.append([name, Traits.of(model).cost, *cells, *(powers if library in _POWERS else ())])
    return lines


def _nanoseconds(cell: Cell) -> str:
    if cell.timing is None:
        return "-"
    value = 1e9 * cell.timing.per_rating().median
    return f"{value:,.{int(value < 100)}f}"


def _left_out(found: Found) -> list[str]:
    """Return what was not measured, and why."""
    cells = ((*where, cell.left_out) for where, cell in found.items() if cell.left_out)
    return [f"{name} on {library}, {size}: {reason}" for name, library, size, reason in cells]


def _cells(models: Mapping[str, TrustModel[Any]], found: Found) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """Return the header and the rows of the CSV file, with a row for each model, library and size."""
    header: tuple[str, ...] = ("model", "family", "grows_as", "library", "raters", "providers")
    header += ("ns_per_rating", "ns_per_rating_least", "ns_per_rating_greatest", "left_out")
    rows = []
    for (name, library, size), cell in found.items():
        traits = Traits.of(models[name])
        each = Spread.of(1e9 * s for s in cell.timing.per_rating()) if cell.timing else (None, None, None)
        rows.append((name, traits.family, traits.cost, library, *size, *each, cell.left_out or None))
    return header, rows


def _page(tables: Mapping[str, list[list[str]]], caption: str, reasons: Sequence[str], threads: int) -> str:
    """Return the tables as a page of Markdown."""
    parts = ["# What the trust models cost", caption]
    for library, (headings, *rows) in tables.items():
        parts += [f"## Nanoseconds per rating, {library}", markdown_table(headings, rows, names=2)]
    if reasons:
        parts.append("\n".join(f"- Left out: {reason}." for reason in reasons))
    parts.append(f"Written by `python -m studies.costs` on {machine(threads)}; `make costs` measures again.")
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    run(costs)
