"""The part of `python -m studies.costs` on ratings as a list of edges."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.markup import escape

from roletrust_env.evaluation.resources import in_bytes
from roletrust_env.storage.files import replacing, write_csv
from roletrust_env.storage.markdown import markdown_table
from roletrust_experiments.commands.console import console, number_table
from studies.timing.contestants import Spread, Timing
from studies.timing.edge_costs import EdgeCell, EdgeCosts
from studies.timing.edges import EACH, PLAIN, bytes_per_s

_TITLE = "What the trust models cost on lists of ratings"
_HEADINGS = ("model", "ratings", "ms a round", "M ratings/s", "least - greatest", "memory")


def show_lists(found: EdgeCosts, copying: Timing, machine: str, out: Path | None) -> None:
    """Print the table of the rounds, and write it."""
    caption = (
        f"One round in float64 in which all pairs rate again, {EACH} ratings for each rater and each provider, the "
        f"median of the repeats; {PLAIN}: the round of role-trust by hand; memory: peak from nothing to the end of a "
        f"round, with the ratings. Copying an array moves {bytes_per_s(copying) / 1e9:.1f} GB/s."
    )
    lines = _lines(found)
    table = number_table(_TITLE, caption, *_HEADINGS[1:])
    for name, *numbers in lines:
        table.add_row(escape(name), *numbers)
    console.print(table)
    reasons = [f"{name} on {size:,} ratings: {cell.left_out}" for (name, size), cell in found.items() if cell.left_out]
    for reason in reasons:
        console.print(f"[dark_orange3]left out:[/] {escape(reason)}", soft_wrap=True)
    if out is None:
        return
    write_csv(out / "edge-costs.csv", *_cells(found))
    with replacing(out / "edge-costs.md") as path:
        path.write_text(_page(found, caption, reasons, machine), encoding="utf-8")
    console.print(f"Written to {out}: edge-costs.csv, edge-costs.md", soft_wrap=True)


def _lines(found: EdgeCosts) -> list[list[str]]:
    return [[name, f"{size:,}", *_numbers(cell)] for (name, size), cell in found.items()]


def _numbers(cell: EdgeCell) -> tuple[str, str, str, str]:
    """Return milliseconds of a round, millions of ratings per second and their range, and the memory."""
    if cell.timing is None:
        return "-", "-", "-", "-"
    rate = Spread.of(1e-6 / s for s in _each(cell.timing))
    time = f"{1e3 * Spread.of(cell.timing.seconds).median:,.1f}"
    return time, f"{rate.median:.2f}", f"{rate.low:.2f} - {rate.high:.2f}", in_bytes(cell.memory)


def _each(timing: Timing) -> list[float]:
    """Return the seconds for a rating in each repeat."""
    return [seconds / timing.contestant.ratings for seconds in timing.seconds]


def _cells(found: EdgeCosts) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """Return the header and the rows of the CSV file."""
    header: tuple[str, ...] = ("model", "ratings_asked", "ratings", "ns_per_rating", "ns_per_rating_least")
    header += ("ns_per_rating_greatest", "peak_bytes", "left_out")
    rows: list[tuple[Any, ...]] = []
    for (name, size), cell in found.items():
        if cell.timing is None:
            rows.append((name, size, None, None, None, None, None, cell.left_out))
            continue
        each = Spread.of(1e9 * s for s in _each(cell.timing))
        rows.append((name, size, cell.timing.contestant.ratings, *each, cell.memory, None))
    return header, rows


def _page(found: EdgeCosts, caption: str, reasons: Sequence[str], machine: str) -> str:
    """Return the tables as a page of Markdown, one for each number of ratings."""
    parts = [f"# {_TITLE}", caption]
    for size in dict.fromkeys(size for _, size in found):
        headings, *lines = _by_model(found, size)
        parts += [f"## {size:,} ratings", markdown_table(headings, lines, names=1)]
    if reasons:
        parts.append("\n".join(f"- Left out: {reason}." for reason in reasons))
    parts.append(f"Written by `python -m studies.costs --ratings` on {machine}; `make edge-costs` measures again.")
    return "\n\n".join(parts) + "\n"


def _by_model(found: EdgeCosts, size: int) -> Iterator[list[str]]:
    """Yield the headings of a table, and a row for each model; a dash is what is left out."""
    yield ["model", "ms a round", "M ratings/s", "memory"]
    for (name, of), cell in found.items():
        if of == size:
            time, rate, spread, memory = _numbers(cell)
            yield [name, time, rate if rate == "-" else f"{rate} ({spread})", memory]
