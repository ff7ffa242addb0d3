"""Options that several studies share, each with one spelling and one help text."""

from typing import Annotated

import typer

from roletrust_experiments.commands import completion

ConditionSuite = Annotated[
    str,
    typer.Option(
        help="Suite with the scenario and the track: its name, or the path of a .toml file.",
        autocompletion=completion.suites,
    ),
]
Again = Annotated[bool, typer.Option("--force", help="Begin again, and overwrite the runs in --out.")]
