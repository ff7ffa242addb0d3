"""`roletrust submit` and `roletrust verify`: a benchmark's numbers as one file, and whether they
are true.
"""

import secrets
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from random import Random
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from roletrust_env.benchmarking.pool import LocalPool
from roletrust_env.benchmarking.schema import AnyCell
from roletrust_env.benchmarking.store import ResultStore, StoredCell
from roletrust_env.benchmarking.submission import (
    CellClaim,
    Submission,
    make_entries,
    make_submission,
)
from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.verification import (
    LONGEST_S,
    Check,
    check_bias,
    check_cell,
    check_claims,
    check_fresh,
    check_installed_names,
    check_scores,
    is_same_platform,
    read_submission,
    sample_claims,
)
from roletrust_env.storage.files import write_json
from roletrust_experiments.commands.console import (
    ALLOW_CODE,
    console,
    number_table,
    progress_bar,
    tell,
)
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.leaderboard import read_run
from roletrust_experiments.commands.options import NAMED, Workers


def submit(
    results: Annotated[
        Path, typer.Argument(help="Results of `roletrust benchmark`, a file results.sqlite.")
    ],
    out: Annotated[Path, typer.Option(help="File to write.", metavar="FILE.json")],
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar=NAMED,
            help="Trust model of the run to submit; repeat for more; all if left out.",
        ),
    ] = None,
    attacks: Annotated[
        bool,
        typer.Option(
            "--attacks", help="Write the worst attacks instead, for `roletrust benchmark --known`."
        ),
    ] = False,
    finder: Annotated[
        str,
        typer.Option(help="Name of the finder of the attacks, for tables; only with --attacks."),
    ] = "",
    allow_code: Annotated[bool, typer.Option("--allow-code", help=ALLOW_CODE)] = False,
) -> None:
    """Write [bold]the benchmark results of your trust model[/] to one file that others can check.

    The file holds the scores with their intervals, the whole suite, the versions of the software,
    hashes of the source of each trust model and attack, and the means of each attack in each cell,
    which `roletrust verify` measures again. The run must be complete, without failed cells:
    otherwise a model could avoid an attack by failing under it.

    With --attacks, the file holds attacks instead: the worst one on each trust model in each
    condition. Each is a scripted attack with its parameters, or the network of a coalition, so that
    anybody can play it without a search and without your code.

    [bold]Examples[/]

    [dim]# submit a model of your own[/]
    [cyan]roletrust benchmark --suite standard --model mypackage.mymodel:MyModel
    --out results/mine[/]
    [cyan]roletrust submit results/mine/results.sqlite --model mypackage.mymodel:MyModel
    --out mymodel.json[/]

    [dim]# submit attacks, here a script of yours and what searches find, against one trust model[/]
    [cyan]roletrust benchmark --suite standard --attack rank-lies:bend=2 --model beta
    --out results/lies[/]
    [cyan]roletrust submit results/lies/results.sqlite --attacks --finder "A. Author"
    --out lies.json[/]
    """
    require("a submission", "train", "scipy", "cma")  # as the benchmark whose suite it reads
    if finder and not attacks:
        raise ValueError("--finder is for --attacks")
    if attacks:
        suite, stored = read_run(results)
        if not allow_code:
            check_installed_names(suite)
        entries, lost = make_entries(suite, stored, model or (), finder)
        write_json(out, entries.model_dump(mode="json"))
        for line in lost:
            tell(f"{line} cannot be recorded, and is left out.", "yellow")
        tell(f"Written: {out}, {len(entries.attacks):,} attacks")
        return
    with ResultStore(results) as store:
        submission = make_submission(store, model or (), allow_code=allow_code)
    write_json(out, submission.model_dump(mode="json"))
    table = number_table(
        f"Submission, suite {escape(str(submission.suite['name']))}",
        "± half the 95% interval",
        "worst",
    )
    for name, standing in submission.standings.items():
        table.add_row(escape(name), standing.worst.text)
    console.print(table)
    tell(f"Written: {out}, {len(submission.cells):,} cells")


def verify(
    file: Annotated[Path, typer.Argument(help="Submission that `roletrust submit` has written.")],
    number: Annotated[
        int | None,
        typer.Option(
            "--cells",
            min=0,
            help="Number of cells to play again, drawn at random; all if left out.",
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="Random seed of the choice of cells; one of chance if left out."),
    ] = None,
    fresh: Annotated[
        bool,
        typer.Option(
            help="Play cells with a new seed, too: a model may know the games of a public one."
        ),
    ] = True,
    own_suite: Annotated[
        bool, typer.Option("--own-suite", help="Accept a suite that is not one of this package.")
    ] = False,
    workers: Workers = None,
    allow_code: Annotated[bool, typer.Option("--allow-code", help=ALLOW_CODE)] = False,
) -> None:
    """Check [bold]a submission[/]: its hashes, the consistency of its numbers, and its cells.

    If what needs no game is true, all cells are played again, or a sample of them. On the same
    software and processor, each must give the same numbers to the last bit. Elsewhere, the
    attackers in the file play instead of new searches; then each mean must lie within its interval,
    and utilities must not be too high on the whole. The same cells are also searched and played
    with a new seed, and the claims must not be much higher than these results.

    Trust models of other packages run in processes of their own, which get ratings and nothing else
    of a game. Some games are played again alone, and trust in them must be the same. The suite has
    to be one of this package, recognised by its hash. The file may only name what is installed,
    unless --allow-code is given. The exit code is 1 if a check fails, and 2 if the file cannot be
    read.

    [bold]Examples[/]

    [dim]# all cells, before the entry is ranked[/]
    [cyan]roletrust verify mymodel.json[/]

    [dim]# ten cells, drawn at random, for a first look; --seed draws them again[/]
    [cyan]roletrust verify mymodel.json --cells 10 --seed 7[/]
    """
    require("verifying", "train", "scipy", "cma", "torch", "stable_baselines3")
    submission, suite = read_submission(file)
    if not allow_code:
        check_installed_names(suite)
    checks = check_claims(submission, suite, own_suite=own_suite)
    seed = secrets.randbelow(2**32) if seed is None else seed
    claims = None
    if all(check.ok for check in checks):  # otherwise games take minutes, and change no verdict
        claims = sample_claims(
            submission, len(submission.cells) if number is None else number, seed
        )
        checks += _check_games(submission, suite, claims, seed if fresh else None, workers)
    console.print(_table(file, checks))
    if claims is None:
        console.print("No cell was played again: what is not ok above needs no game.")
    else:
        console.print(
            f"{len(claims)} of {len(submission.cells):,} cells played again; "
            f"--seed {seed} chooses the same ones"
        )
        if len(claims) < len(submission.cells):
            console.print(
                "[yellow]An entry is ranked only once all its cells have been played: leave out "
                "--cells.[/]"
            )
    if not all(check.ok for check in checks):
        raise typer.Exit(1)


def _check_games(
    submission: Submission,
    suite: Suite,
    claims: Sequence[CellClaim],
    fresh: int | None,
    workers: int | None,
) -> list[Check]:
    """Play the claims again, and return the verdict on each.

    Args:
        submission: Submission.
        suite: Suite of the submission.
        claims: Cells to play.
        fresh: Random seed of the choice of new games, which the claims are played in, too; None for
            none.
        workers: Number of processes.
    """
    checks, asked, replayed, same = [], [], [], is_same_platform(submission)
    # Rounding decides what a search finds, so elsewhere the attackers of the claims play.
    records: dict[AnyCell, str] = {} if same else {claim.cell: claim.record for claim in claims}
    for claim, again in _played(suite, claims, workers, records=records):
        replayed.append(again)
        asked.append(claim)
        checks.append(check_cell(claim, again.result, same))
    if replayed:
        checks += check_bias(asked, [again.result for again in replayed])
    if fresh is not None and claims:
        above = (
            max(suite.seeds) + 1 + Random(fresh).getrandbits(31)
        )  # seeds that are none of the suite
        done = list(_played(suite, claims, workers, above))
        checks += check_fresh([claim for claim, _ in done], [again.result for _, again in done])
    if len(replayed) == len(submission.cells) and not any(
        again.result.failed for again in replayed
    ):
        checks += check_scores(submission, suite, replayed, same)
    return checks


def _table(file: Path, checks: Sequence[Check]) -> Table:
    """Return the verdict on each claim of a file."""
    table = Table(
        title=f"Is {escape(str(file))} true?", title_justify="left", box=None, pad_edge=False
    )
    for heading in ("", "what", "found"):
        table.add_column(heading, overflow="fold")
    for check in checks:
        verdict = "[green]ok[/]" if check.ok else "[bold red]not ok[/]"
        table.add_row(verdict, escape(check.subject), escape(check.message))
    return table


def _played(
    suite: Suite,
    claims: Sequence[CellClaim],
    workers: int | None,
    above: int = 0,
    records: Mapping[AnyCell, str] | None = None,
) -> Iterator[tuple[CellClaim, StoredCell]]:
    """Iterate over claims, each with the result of its cell here, played with its seed and `above`
    added to that.

    Attackers with a record play in place of a search.
    """
    of_cell = {claim.cell._replace(seed=claim.seed + above): claim for claim in claims}
    limited = suite.model_copy(update={"limit_s": min(suite.limit_s, LONGEST_S)})
    pool = LocalPool(workers, records=records, isolated=True)
    with progress_bar() as progress, closing(pool.play(limited, list(of_cell))) as playing:
        job = progress.add_task("Playing again", total=len(of_cell))
        for cell, done in playing:
            progress.advance(job)
            yield of_cell[cell], StoredCell(cell, done)
