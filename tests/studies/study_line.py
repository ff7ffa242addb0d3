"""Studies as one command line, for tests."""

import typer
from typer.testing import CliRunner

from roletrust_experiments.commands.group import CommandGroup
from studies.defend import defend

app = typer.Typer(cls=CommandGroup)
for study in (defend,):
    app.command(study.__name__)(study)


def run(*arguments):
    return CliRunner().invoke(app, list(arguments))
