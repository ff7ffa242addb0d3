"""`roletrust entry`: the results of a trust model as one file, and whether they are true."""

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from roletrust_env.errors import counted
from roletrust_experiments.commands.console import ALLOW_CODE, console, plain_table, tell
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.group import command_group
from roletrust_experiments.commands.options import Workers

_HERE = "roletrust_experiments.commands.entry"


@command_group({"pack": f"{_HERE}:pack", "check": f"{_HERE}:check"}, add_completion=False)
def entry() -> None:
    """Make or check [bold]an entry of the leaderboard[/].

    [bold]Examples[/]

    [dim]# play, write the entry, and check it as others would[/]
    [cyan]roletrust benchmark mypackage.mymodel:MyModel --search --out results/mine[/]
    [cyan]roletrust entry pack results/mine/results.sqlite mypackage.mymodel:MyModel mymodel.json[/]
    [cyan]roletrust entry check mymodel.json --cells 4[/]
    """


def pack(
    results: Annotated[
        Path, typer.Argument(help="Results of `roletrust benchmark`, a file results.sqlite.")
    ],
    model: Annotated[str, typer.Argument(help="Trust model of the run.")],
    file: Annotated[Path, typer.Argument(help="File to write.")],
) -> None:
    """Write [bold]the results of a trust model[/] to one file that others can check.

    The file has the scores in each world, the worst attacks as records that play without a search,
    the hashes of the suite and of the model's source, and the versions of the software. The run
    must be complete: otherwise a model could avoid an attack by failing under it.

    [bold]Examples[/]

    [cyan]roletrust entry pack results/mine/results.sqlite mypackage.mymodel:MyModel mymodel.json[/]
    """
    require("an entry", "train", "scipy", "cma")
    from roletrust_env.benchmarking.entries import pack_entry

    if file.resolve() == results.resolve():
        raise ValueError(f"{file} would replace the results")
    packed = pack_entry(results, model)
    packed.write(file)
    tell(f"Written: {file}, {counted(len(packed.cells), 'cell')}")


def check(
    file: Annotated[Path, typer.Argument(help="Entry that `roletrust entry pack` has written.")],
    cells: Annotated[
        int | None,
        typer.Option(min=0, help="Number of cells to play again, drawn at random; default: all."),
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

    [dim]# all cells, before the entry is ranked; or four, for a first look[/]
    [cyan]roletrust entry check mymodel.json[/]
    [cyan]roletrust entry check mymodel.json --cells 4[/]
    """
    require("checking", "train", "scipy", "cma")
    from roletrust_env.benchmarking.entry_check import check_entry

    checked = check_entry(
        file, suite, cells=cells, seed=seed, workers=workers, allow_code=allow_code
    )
    table = plain_table(f"Is {escape(str(file))} true?")
    for heading in ("", "what", "result"):
        table.add_column(heading, overflow="fold")
    for one in checked.checks:
        verdict = "[green]ok[/]" if one.ok else "[bold red]not ok[/]"
        table.add_row(verdict, escape(one.subject), escape(one.message))
    console.print(table)
    tell(
        f"{checked.played} of {len(checked.entry.cells)} cells were played again; --seed "
        f"{checked.seed} plays the same."
    )
    if not checked.ok:
        raise typer.Exit(1)
