"""The command line, `roletrust`."""

import os
import sys
from collections.abc import Callable
from inspect import cleandoc
from typing import Annotated, Any

import typer
from rich.markup import escape
from typer.core import TyperGroup

from roletrust_env import __version__
from roletrust_experiments.commands.benchmark import benchmark
from roletrust_experiments.commands.console import console, errors
from roletrust_experiments.commands.figures import figures
from roletrust_experiments.commands.listing import list_command
from roletrust_experiments.commands.live.app import live
from roletrust_experiments.commands.play import play
from roletrust_experiments.commands.rate import rate
from roletrust_experiments.commands.real import real
from roletrust_experiments.commands.replay import replay
from roletrust_experiments.commands.report import report
from roletrust_experiments.commands.serve import serve
from roletrust_experiments.commands.submit import submit, verify
from roletrust_experiments.commands.train import train
from roletrust_experiments.commands.zoo import zoo

_EXAMPLES = "[bold]Examples[/]"


def _plain_flags(parameters: Any) -> Any:
    """Return the parameters of a command; the help of a flag shows no type."""
    for parameter in parameters:
        if getattr(parameter, "is_flag", False):
            parameter.metavar = ""
    return parameters


class _Group(TyperGroup):
    """A group of commands that reports bad input and unwritable files in one red message, with exit code 2."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except BrokenPipeError:  # the reader has stopped, as `head` does
            sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - Python writes to it once more when it ends
            raise typer.Exit(141) from None
        except (ValueError, OSError, MemoryError) as error:
            errors.print(f"[bold red]Error:[/] {escape(str(error) or 'out of memory')}", soft_wrap=True)
            raise typer.Exit(2) from None

    def get_params(self, ctx: Any) -> Any:
        """Return the options of the group."""
        return _plain_flags(super().get_params(ctx))

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command by name."""
        command: Any = super().get_command(ctx, cmd_name)
        if command is not None:
            _plain_flags(command.get_params(ctx))
            about, examples, rest = cleandoc(command.help or "").partition(_EXAMPLES)
            paragraphs = [" ".join(paragraph.split("\n")) for paragraph in about.split("\n\n")]
            command.help = "\n\n".join(paragraphs) + examples + rest  # typer breaks lines where the docstring does
        return command


app = typer.Typer(
    cls=_Group,
    rich_markup_mode="rich",
    no_args_is_help=True,
    pretty_exceptions_show_locals=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        console.print(f"roletrust {__version__}")
        raise typer.Exit


@app.callback()
def roletrust(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Attack and measure [bold]role-based trust models[/]: raters rate providers, and a model decides whom to believe.

    [bold]Examples[/]

    [dim]# the paper's two figures, from camera frames[/]
    [cyan]roletrust figures[/]

    [dim]# an attack in the paper's scenario[/]
    [cyan]roletrust play --attack sp_2=on-off:start=100[/]

    [dim]# what can be played[/]
    [cyan]roletrust list[/]

    [dim]# the options of a command[/]
    [cyan]roletrust play --help[/]
    """


_COMMANDS: dict[str, Callable[..., None]] = {
    "figures": figures,
    "play": play,
    "list": list_command,
    "train": train,
    "zoo": zoo,
    "benchmark": benchmark,
    "report": report,
    "replay": replay,
    "serve": serve,
    "submit": submit,
    "verify": verify,
    "rate": rate,
    "real": real,
}
for _name, _command in _COMMANDS.items():
    app.command(_name)(_command)
app.add_typer(live, name="live", cls=_Group)


def main() -> None:
    """Run the command line."""
    app(prog_name="roletrust")
