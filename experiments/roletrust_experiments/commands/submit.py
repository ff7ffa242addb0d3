"""`roletrust submit` and `roletrust verify`: the results of a trust model as one file, and whether
they are true.
"""

import random
import secrets
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from roletrust_env.benchmarking.entries import (
    Check,
    Entry,
    check_entry,
    check_fresh_worlds,
    read_entry,
    records_of,
    replay_entry,
)
from roletrust_env.benchmarking.pool import LocalPool
from roletrust_env.benchmarking.store import ResultStore
from roletrust_env.benchmarking.suite import Suite, with_models, with_search
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_env.evaluation.agreed import check_recorded
from roletrust_env.evaluation.specs import check_installed
from roletrust_env.storage.files import write_text
from roletrust_env.trust.model import registry as trust_models
from roletrust_experiments.commands.console import ALLOW_CODE, console, tell
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import Workers


def submit(
    results: Annotated[
        Path, typer.Argument(help="Results of `roletrust benchmark`, a file results.sqlite.")
    ],
    model: Annotated[
        str, typer.Argument(help="Trust model of the run; `all` writes a file for each model.")
    ],
    out: Annotated[Path, typer.Option(help="File to write; a folder for `all`.", metavar="PATH")],
    allow_code: Annotated[bool, typer.Option("--allow-code", help=ALLOW_CODE)] = False,
) -> None:
    """Write [bold]the results of a trust model[/] to one file that others can check.

    The file has the scores in each world, the worst attacks as records that play without a search,
    the hashes of the suite and of the model's source, and the versions of the software. The run
    must be complete: otherwise a model could avoid an attack by failing under it.

    [bold]Examples[/]

    [cyan]roletrust benchmark mypackage.mymodel:MyModel --search --out results/mine[/]
    [cyan]roletrust submit results/mine/results.sqlite mypackage.mymodel:MyModel
    --out mymodel.json[/]
    """
    require("a submission", "train", "scipy", "cma")
    with ResultStore(results) as store:
        models = getattr(store.suite, "model_names", []) if model == "all" else [model]
        if not allow_code:
            check_installed(trust_models, models)
        entries = [Entry.of(store, name) for name in models]
    for entry in entries:
        path = out / entry.file_name if model == "all" else out
        write_text(path, entry.text)
        tell(f"Written: {path}, {len(entry.cells):,} cells")


def verify(
    file: Annotated[Path, typer.Argument(help="Entry that `roletrust submit` has written.")],
    number: Annotated[
        int | None,
        typer.Option(
            "--cells", min=0, help="Number of cells to play again, drawn at random; default: all."
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            min=0, help="Random seed of this choice and of the other worlds; default: a random one."
        ),
    ] = None,
    suite: Annotated[
        str, typer.Option(help="Suite of the entry, or the path of its .toml file.")
    ] = "standard",
    workers: Workers = None,
    allow_code: Annotated[bool, typer.Option("--allow-code", help=ALLOW_CODE)] = False,
) -> None:
    """Check [bold]an entry of the leaderboard[/]: its hashes, its numbers, and its games.

    All scripts and the recorded attacks are played again. On the same software and processor the
    scores must be equal; elsewhere their difference must not be significant. Then all but the
    searches is played in other worlds, where the skill must not be significantly lower: a model
    could recognise the games of its entry. Trust models of other packages run in processes of their
    own, which get ratings and nothing else of a game. The exit code is 1 if a check fails, and 2 if
    the file cannot be read.

    [bold]Examples[/]

    [dim]# all cells, before the entry is ranked[/]
    [cyan]roletrust verify mymodel.json[/]

    [dim]# four cells for a first look[/]
    [cyan]roletrust verify mymodel.json --cells 4[/]
    """
    require("verifying", "train", "scipy", "cma")
    entry = read_entry(file)
    loaded = load_suite(suite)
    if not isinstance(loaded, Suite):
        raise ValueError(f"suite {loaded.name} is for {loaded.kind}; give one of trust models")
    if not allow_code:
        check_installed(trust_models, [entry.model])
        check_recorded(attack.record for cell in entry.cells for attack in cell.attacks)
        check_recorded(attack.record for attack in loaded.replayed)
    searched = any(cell.method == "search" for cell in entry.cells)
    asked = with_models(with_search(loaded) if searched else loaded, [entry.model])
    asked = asked.model_copy(update={"search": entry.search})
    checks = check_entry(entry, asked)
    if all(check.ok for check in checks):
        seed = secrets.randbelow(2**31) if seed is None else seed
        cells = [cell for cell, _ in entry.stored()]
        if number is not None:
            cells = random.Random(seed).sample(cells, min(number, len(cells)))
        pool = LocalPool(workers, records=records_of(entry), isolated=True)
        checks += replay_entry(entry, asked, cells, pool)
        if number != 0:
            pool = LocalPool(workers, isolated=True)
            worlds = asked.worlds.model_copy(update={"seed": 1 + seed})
            fresh = asked.model_copy(update={"worlds": worlds})
            checks.append(check_fresh_worlds(entry, fresh, pool))
        tell(f"Seed {seed}: --seed {seed} plays the same again.")
        if number is not None:
            tell(f"Played {len(cells)} of {len(entry.cells)} cells; leave out --cells for all.")
    else:
        tell("No cell was played again: what is not ok needs no game.")
    console.print(_table(file, checks))
    if not all(check.ok for check in checks):
        raise typer.Exit(1)


def _table(file: Path, checks: list[Check]) -> Table:
    """Return the checks as a table."""
    table = Table(
        title=f"Is {escape(str(file))} true?", title_justify="left", box=None, pad_edge=False
    )
    for heading in ("", "what", "result"):
        table.add_column(heading, overflow="fold")
    for check in checks:
        verdict = "[green]ok[/]" if check.ok else "[bold red]not ok[/]"
        table.add_row(verdict, escape(check.subject), escape(check.message))
    return table
