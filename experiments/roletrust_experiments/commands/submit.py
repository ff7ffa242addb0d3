"""`roletrust submit` and `roletrust verify`: a benchmark's numbers as one file, and whether they are true."""

import secrets
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from roletrust_env.benchmark.pool import LocalPool
from roletrust_env.benchmark.store import Store, StoredCell
from roletrust_env.benchmark.submission import CellClaim, make_submission
from roletrust_env.benchmark.suite import Suite
from roletrust_env.benchmark.verification import (
    LONGEST_S,
    Check,
    check_cell,
    check_claims,
    check_names,
    check_scores,
    is_same_platform,
    read_submission,
    sample_claims,
)
from roletrust_env.storage.files import write_json
from roletrust_experiments.commands.console import ALLOW_CODE, console, number_table, progress_bar
from roletrust_experiments.commands.extras import require


def submit(
    results: Annotated[Path, typer.Argument(help="The file that `roletrust benchmark` keeps its results in.")],
    out: Annotated[Path, typer.Option(help="The file to write.", metavar="FILE.json")],
    model: Annotated[
        list[str] | None,
        typer.Option(help="Of the run's trust models, as the run names it; repeat for more. All, if none is given."),
    ] = None,
    allow_code: Annotated[bool, typer.Option("--allow-code", help=ALLOW_CODE)] = False,
) -> None:
    """Write [bold]what a benchmark found of your trust model[/] to one file, for others to check.

    It holds the scores with their intervals; the suite, whole; the versions of the software; hashes of the source of
    each trust model and attack; and what each attack did in each cell, in the mean, which `roletrust verify` measures
    again. The run must be over, and no cell failed: a model could else hide from an attack by breaking under it.

    [bold]Examples[/]

    [dim]# enter a model of your own[/]
    [cyan]roletrust benchmark --suite standard --model mypackage.mymodel:MyModel --out results/mine[/]
    [cyan]roletrust submit results/mine/results.sqlite --model mypackage.mymodel:MyModel --out mymodel.json[/]
    """
    require("a submission", "train", "scipy", "cma")  # as the benchmark whose suite it reads
    with Store(results) as store:
        found = make_submission(store, model or (), allow_code=allow_code)
    write_json(out, found.model_dump(mode="json"))
    table = number_table(f"Submission, suite {escape(str(found.suite['name']))}", "± half the 95% interval", "worst")
    for name, standing in found.standings.items():
        table.add_row(escape(name), standing.worst.text)
    console.print(table)
    console.print(f"Written: {out}, {len(found.cells):,} cells; look at it with roletrust verify {out}", soft_wrap=True)


def verify(
    file: Annotated[Path, typer.Argument(help="That `roletrust submit` has written, here or elsewhere.")],
    number: Annotated[
        int,
        typer.Option("--cells", min=0, help="Cells that are played again; if all, intervals are checked, too."),
    ] = 10,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Which cells; by default others each time, so that nobody can foresee it.")
    ] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; by default one for each core.")] = None,
    allow_code: Annotated[bool, typer.Option("--allow-code", help=ALLOW_CODE)] = False,
) -> None:
    """See [bold]whether a submission is true[/]: its hashes, what its numbers say of each other, and a sample of cells.

    On the same software and processor a cell must come to the same numbers to the last bit; elsewhere every mean must
    be within the interval. Where something is not as said, the exit code is 1; a file that cannot be read is refused
    with 2. A file may name only what is installed, unless you allow more.

    [bold]Examples[/]

    [dim]# ten cells, drawn at random[/]
    [cyan]roletrust verify mymodel.json[/]

    [dim]# the same cells again, and more of them[/]
    [cyan]roletrust verify mymodel.json --cells 50 --seed 7[/]
    """
    require("verifying", "train", "scipy", "cma", "torch", "stable_baselines3")
    found, suite = read_submission(file)
    if not allow_code:
        check_names(suite)
    checks = check_claims(found, suite)
    seed = secrets.randbelow(2**32) if seed is None else seed
    claims, same = sample_claims(found, number, seed), is_same_platform(found)
    kept = []
    for claim, again in _played(suite, claims, workers):
        kept.append(again)
        checks.append(check_cell(claim, again.result, same))
    if len(kept) == len(found.cells) and not any(again.result.failed for again in kept):
        checks += check_scores(found, suite, kept, same)
    console.print(_table(file, checks))
    console.print(f"{len(kept)} of {len(found.cells):,} cells played again; the same ones with --seed {seed}")
    if not all(check.ok for check in checks):
        raise typer.Exit(1)


def _played(suite: Suite, claims: Sequence[CellClaim], workers: int | None) -> Iterator[tuple[CellClaim, StoredCell]]:
    """Cells, each with what becomes of it here."""
    of_cell = {claim.cell: claim for claim in claims}
    limited = suite.model_copy(update={"limit_s": min(suite.limit_s, LONGEST_S)})
    with progress_bar() as progress, closing(LocalPool(workers).play(limited, list(of_cell))) as playing:
        job = progress.add_task("Playing again", total=len(of_cell))
        for cell, done in playing:
            progress.advance(job)
            yield of_cell[cell], StoredCell(cell, done)


def _table(file: Path, checks: Sequence[Check]) -> Table:
    table = Table(title=f"Is {escape(str(file))} true?", title_justify="left", box=None, pad_edge=False)
    for heading in ("", "what", "found"):
        table.add_column(heading, overflow="fold")
    for check in checks:
        table.add_row(
            "[green]ok[/]" if check.ok else "[bold red]not ok[/]", escape(check.subject), escape(check.message)
        )
    return table
