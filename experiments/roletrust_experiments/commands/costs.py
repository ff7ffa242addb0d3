"""`roletrust costs`: what every trust model costs, by the size of the game, and how that grows."""

import math
import os
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any

import typer

from roletrust_env import make_scenario
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.storage.files import prepare_folder, replacing, write_csv
from roletrust_env.trust import Traits, TrustModel, trust_models
from roletrust_experiments.commands.console import console, number_table, progress_bar
from roletrust_experiments.timing.contestants import Spread
from roletrust_experiments.timing.models import LIBRARIES, LIMITS, Cell, Found, Size, growth, measure_models, sizes
from roletrust_experiments.timing.threads import torch_threads

_SIDES = 3, 30, 300
_POWERS = {"NumPy": ("S^", "P^")}
"""Where the growth is shown."""

_CAPTION = (
    "One update in float32 in which all raters rate all providers, the median of the repeats. S^ and P^ are the powers "
    "of the numbers of raters and of providers that its time grows by on NumPy, from {small:,} to {large:,} of one "
    "with {large:,} of the other; fixed costs make them less than the model's own."
)


def costs(
    trust_model: Annotated[
        list[str] | None,
        typer.Option(metavar="MODEL", help="NAME or NAME:key=value,...; may be repeated; all if left out."),
    ] = None,
    compiled: Annotated[
        bool, typer.Option("--compiled", help="Also compiled by torch, which takes up to some minutes a cell.")
    ] = False,
    compile_limit: Annotated[
        float, typer.Option(min=1, help="Seconds to compile a cell in; one that takes longer is left out.")
    ] = LIMITS.compiling,
    side: Annotated[
        list[int] | None,
        typer.Option(min=1, help="Raters, and as many providers; two of them or more; 3, 30 and 300 if left out."),
    ] = None,
    threads: Annotated[int, typer.Option(min=1, help="Threads of torch.")] = 1,
    seed: Annotated[int, typer.Option(min=0, help="Of the ratings.")] = 0,
    out: Annotated[
        Path | None, typer.Option(help="Folder for model-costs.csv and model-costs.md; it is made if need be.")
    ] = None,
) -> None:
    """Measure [bold]what the trust models cost[/]: time per rating by size, and its growth with raters and providers.

    Models are timed in turn, so that other work strikes all alike. A size at which an update would take more than 5
    seconds or 3 GB, as the smaller ones let expect, is left out, and the table says so.

    All is compiled before anything compiled is timed, two cells at a time. What is compiled stays in torch's cache on
    disk, so that a run that was broken off goes on where it was, and a second one is quick.

    [bold]Examples[/]

    [dim]# all of them on NumPy[/]
    [cyan]roletrust costs[/]

    [dim]# the table that is kept in docs/[/]
    [cyan]roletrust costs --compiled --out results/costs[/]
    """
    sides = sorted(set(side or _SIDES))
    if len(sides) < 2:
        raise ValueError(f"--side {sides[0]} is the only size; growth needs two at least")
    if out is not None:
        prepare_folder(out)
    scenario, names = make_scenario("paper-3x3"), trust_model or list(trust_models())
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
        for row in rows:
            table.add_row(*row)
        console.print(table)
    console.print(caption)
    reasons = _left_out(found)
    for reason in reasons:
        console.print(f"[dark_orange3]left out:[/] {reason}", soft_wrap=True)
    if out is not None:
        write_csv(out / "model-costs.csv", *_cells(models, found))
        with replacing(out / "model-costs.md") as path:
            path.write_text(_page(tables, caption, reasons, threads), encoding="utf-8")
        console.print(f"Written to {out}: model-costs.csv, model-costs.md", soft_wrap=True)


def _lines(models: Mapping[str, TrustModel[Any]], found: Found, sides: Sequence[int], library: str) -> list[list[str]]:
    """The table of a library for people: its headings, and a row for each model."""
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
    """What was not measured, and why."""
    kept = ((*where, cell.left_out) for where, cell in found.items() if cell.left_out)
    return [f"{name} on {library}, {size}: {reason}" for name, library, size, reason in kept]


def _cells(models: Mapping[str, TrustModel[Any]], found: Found) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """The table for machines, a row for each cell: its header and its rows."""
    header: tuple[str, ...] = ("model", "family", "grows_as", "library", "raters", "providers")
    header += ("ns_per_rating", "ns_per_rating_least", "ns_per_rating_greatest", "left_out")
    rows = []
    for (name, library, size), cell in found.items():
        traits = Traits.of(models[name])
        each = Spread.of(1e9 * s for s in cell.timing.per_rating()) if cell.timing else (None, None, None)
        rows.append((name, traits.family, traits.cost, library, *size, *each, cell.left_out or None))
    return header, rows


def _page(tables: Mapping[str, list[list[str]]], caption: str, reasons: Sequence[str], threads: int) -> str:
    """The tables as a page of Markdown."""
    parts = ["# What the trust models cost", caption]
    for library, (headings, *rows) in tables.items():
        lines = [headings, ["---"] * 2 + ["---:"] * (len(headings) - 2), *rows]
        parts += [f"## Nanoseconds per rating, {library}", "\n".join(f"| {' | '.join(line)} |" for line in lines)]
    if reasons:
        parts.append("\n".join(f"- Left out: {reason}." for reason in reasons))
    parts.append(f"Written by `roletrust costs` on {_machine(threads)}; `make costs` measures again.")
    return "\n\n".join(parts) + "\n"


def _machine(threads: int) -> str:
    packages = [f"Python {platform.python_version()}"]
    for name in ("numpy", "torch"):
        try:
            packages.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    return f"{os.cpu_count()} cores of {platform.machine()}, {', '.join(packages)}, torch on {threads} of them"
