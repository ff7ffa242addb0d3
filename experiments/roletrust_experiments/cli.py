"""The command line, `roletrust`."""

import os
import sys
from importlib.metadata import version as version_of
from io import TextIOWrapper
from typing import Annotated

import typer

from roletrust_experiments.commands.group import command_group


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"roletrust {version_of('roletrust-env')}")
        raise typer.Exit


_HERE = "roletrust_experiments.commands"


_MOVED = {
    "live": "robots",
    "mcp": "manager mcp",
    "serve": "manager serve; a model for other programs is `python -m roletrust_env.trust.remote`",
    "submit": "entry pack",
    "verify": "entry check",
}
"""New names of commands."""


@command_group(
    {
        "play": f"{_HERE}.play:play",
        "list": f"{_HERE}.listing:list_command",
        "train": f"{_HERE}.train:train",
        "benchmark": f"{_HERE}.benchmark:benchmark",
        "report": f"{_HERE}.report:report",
        "replay": f"{_HERE}.replay:replay",
        "entry": f"{_HERE}.entry:entry",
        "rate": f"{_HERE}.rate:rate",
        "compare": f"{_HERE}.compare:compare",
        "audit": f"{_HERE}.audit:audit",
        "manager": f"{_HERE}.manager:manager",
        "figures": f"{_HERE}.figures:figures",
        "robots": f"{_HERE}.robots.app:robots",
    },
    moved=_MOVED,
)
def app(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    """Attack and measure [bold]role-based trust models[/]: raters rate providers, and a model
    decides whom to believe.

    [bold]Examples[/]

    [dim]# one of three raters begins to lie: seconds[/]
    [cyan]roletrust play --attack sr_2=bad-mouthing:start=40[/]

    [dim]# what can be played[/]
    [cyan]roletrust list[/]

    [dim]# which agents to trust, from a file of ratings[/]
    [cyan]roletrust rate ratings.csv --scale 1 5[/]

    [dim]# the leaderboard of trust models; with a name, your own model beside them[/]
    [cyan]roletrust benchmark[/]

    [dim]# the options of a command[/]
    [cyan]roletrust play --help[/]
    """


def main() -> None:
    """Run the command line. Letters that the terminal does not have are shown by their number."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # and not closed
            stream.reconfigure(errors="backslashreplace")
    if os.environ.get("COLUMNS") == "0":  # an unknown width, with which Rich would show nothing
        del os.environ["COLUMNS"]
    app(prog_name="roletrust")
