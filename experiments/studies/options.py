"""Options that several studies share, each with one spelling and one help text."""

from typing import Annotated

import typer

from roletrust_experiments.commands import completion
from roletrust_experiments.commands.options import NAMED, OWN

NamedAttacks = Annotated[
    list[str] | None,
    typer.Option(
        metavar=NAMED,
        help="Attack to try and to search, with the given parameters fixed; repeat for a mixture. By default on-off "
        f"for providers and bad-mouthing for raters. {OWN}",
        autocompletion=completion.named_attacks,
        show_default=False,
    ),
]
ConditionSuite = Annotated[
    str,
    typer.Option(
        help="Suite with the scenario and the track: its name, or the path of a .toml file.",
        autocompletion=completion.suites,
    ),
]
Searches = Annotated[int, typer.Option("--runs", min=1, help="Number of searches, with this seed and those after it.")]
Again = Annotated[bool, typer.Option("--force", help="Begin again, and overwrite the runs in --out.")]
