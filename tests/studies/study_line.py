"""Studies as one command line, for tests."""

import typer
from typer.testing import CliRunner

from roletrust_experiments.commands.group import CommandGroup
from studies.costs import costs
from studies.defend import defend
from studies.equilibrium import equilibrium
from studies.findings.__main__ import findings
from studies.ladder.__main__ import ladder
from studies.models import models
from studies.reruns import reruns
from studies.scale import scale
from studies.speed import speed

app = typer.Typer(cls=CommandGroup)
for study in (costs, defend, equilibrium, findings, ladder, models, reruns, scale, speed):
    app.command(study.__name__)(study)


def run(*arguments):
    return CliRunner().invoke(app, list(arguments))
