"""The command line of a study."""

import sys
from collections.abc import Callable

import typer
from rich.markup import escape

from roletrust_experiments.commands.console import errors


def run(study: Callable[..., None]) -> None:
    """Run a study with the arguments of the command line. Bad input is one red message, with exit code 2."""
    app = typer.Typer(rich_markup_mode="rich", context_settings={"help_option_names": ["-h", "--help"]})
    app.command()(study)
    try:
        app(prog_name=f"python -m {study.__module__}", standalone_mode=True)
    except (ValueError, OSError, MemoryError) as error:
        errors.print(f"[bold red]Error:[/] {escape(str(error) or 'out of memory')}", soft_wrap=True)
        sys.exit(2)
