"""The subcommands of `roletrust manager`."""

from pathlib import Path
from typing import Annotated

import typer

from roletrust_experiments.commands.console import tell
from roletrust_experiments.commands.group import command_group

_HERE = "roletrust_experiments.commands.manager"
Journal = Annotated[
    Path, typer.Argument(metavar="JOURNAL", help="Journal of a manager, or its store, a file.")
]


@command_group({"backup": f"{_HERE}:backup"}, add_completion=False)
def manager() -> None:
    """Care for the journal of a trust manager.

    [bold]Examples[/]

    [dim]# copy the store of a manager that runs[/]
    [cyan]roletrust manager backup trust.sqlite backup.sqlite[/]
    """


def backup(
    journal: Journal, out: Annotated[Path, typer.Argument(metavar="FILE", help="New file.")]
) -> None:
    """Copy the [bold]journal of a manager[/], also while it runs.

    The copy has all that was acknowledged before the command. For a database of PostgreSQL use
    pg_dump.

    [bold]Examples[/]

    [cyan]roletrust manager backup trust.sqlite backup.sqlite[/]
    [cyan]roletrust manager backup team.jsonl backup.jsonl[/]
    """
    from roletrust_manager.journal.backup import back_up

    back_up(journal, out)
    tell(f"Copied {journal} to {out}")
