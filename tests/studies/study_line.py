"""Studies as one command line, for tests."""

import typer
from typer.testing import CliRunner

from roletrust_experiments.commands.group import CommandGroup
from studies.defend import defend
from studies.findings.__main__ import findings

app = typer.Typer(cls=CommandGroup)
for study in (defend, findings):
    app.command(study.__name__)(study)


def run(*arguments):
    return CliRunner().invoke(app, list(arguments))
