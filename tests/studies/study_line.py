"""All studies as one command line, for tests."""

import typer
from typer.testing import CliRunner

from roletrust_experiments.cli import _Group
from studies.budget import budget
from studies.costs import costs
from studies.defend import defend
from studies.equilibrium import equilibrium
from studies.findings.__main__ import findings
from studies.ladder.__main__ import ladder
from studies.models import models
from studies.reruns import reruns
from studies.scale import scale
from studies.speed import speed
from studies.strategic.__main__ import strategic
from studies.transfer import transfer

app = typer.Typer(cls=_Group)
STUDIES = budget, costs, defend, equilibrium, findings, ladder, models, reruns, scale, speed, strategic, transfer
for study in STUDIES:
    app.command(study.__name__)(study)


def run(*arguments):
    return CliRunner().invoke(app, list(arguments))
