"""The command line, `roletrust`."""

import os
import sys
from typing import Annotated, Any

import typer
from rich.markup import escape
from typer.core import TyperGroup

from roletrust_env import __version__
from roletrust_experiments.commands.benchmark import benchmark
from roletrust_experiments.commands.console import console, errors
from roletrust_experiments.commands.costs import costs
from roletrust_experiments.commands.figures import figures
from roletrust_experiments.commands.findings import findings
from roletrust_experiments.commands.ladder import ladder
from roletrust_experiments.commands.listing import list_command
from roletrust_experiments.commands.live.app import live
from roletrust_experiments.commands.models import models
from roletrust_experiments.commands.play import play
from roletrust_experiments.commands.report import report
from roletrust_experiments.commands.speed import speed
from roletrust_experiments.commands.submit import submit, verify
from roletrust_experiments.commands.train import train
from roletrust_experiments.commands.zoo import zoo


class _CleanErrors(TyperGroup):
    """Commands whose bad input and unwritable files get one red message and exit code 2, not a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command that was asked for."""
        try:
            return super().invoke(ctx)
        except BrokenPipeError:  # whoever reads has enough, as `head` does
            sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - Python writes to it once more when it ends
            raise typer.Exit(141) from None
        except (ValueError, OSError, MemoryError) as error:
            errors.print(f"[bold red]Error:[/] {escape(str(error) or 'out of memory')}", soft_wrap=True)
            raise typer.Exit(2) from None


app = typer.Typer(
    cls=_CleanErrors,
    rich_markup_mode="rich",
    no_args_is_help=True,
    pretty_exceptions_show_locals=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(asked: bool) -> None:
    if asked:
        console.print(f"roletrust {__version__}")
        raise typer.Exit


@app.callback()
def roletrust(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    """Attack and measure [bold]role-based trust models[/]: who rates, who serves, and whom to believe.

    [bold]Examples[/]

    [dim]# the paper's two figures, from camera frames[/]
    [cyan]roletrust figures[/]

    [dim]# an attack on the paper's scenario[/]
    [cyan]roletrust play --attack sp_2=on-off:start=100[/]

    [dim]# what each command can do[/]
    [cyan]roletrust play --help[/]
    """


app.command("figures")(figures)
app.command("play")(play)
app.command("benchmark")(benchmark)
app.command("findings")(findings)
app.command("ladder")(ladder)
app.command("list")(list_command)
app.command("report")(report)
app.command("speed")(speed)
app.command("costs")(costs)
app.command("models")(models)
app.add_typer(live, name="live")
app.command("submit")(submit)
app.command("train")(train)
app.command("verify")(verify)
app.command("zoo")(zoo)


def main() -> None:
    """Run the command line."""
    app(prog_name="roletrust")
