"""Shared options and requirements of the commands of `roletrust live`."""

from pathlib import Path
from typing import Annotated

import typer

from roletrust_manager.dds.nodes.run_loop import SECOND

Scenario = Annotated[
    str,
    typer.Option(
        help="Name or file of a scenario, which sets the agents, the rounds and the disturbances."
    ),
]
SLOWEST = 0.1
Speed = Annotated[
    float, typer.Option(min=SLOWEST, max=20, help="Speed relative to the scenario's clock.")
]
Keys = Annotated[Path | None, typer.Option(help="Folder with keys, made by `roletrust live keys`.")]
Network = Annotated[
    bool,
    typer.Option(
        "--network", help="Communicate with other machines, too; by default with this machine only."
    ),
]
Port = Annotated[
    int, typer.Option(min=1024, max=65535, help="Port of the page, on this machine only.")
]
Browser = Annotated[bool, typer.Option("--browser/--no-browser", help="Whether to open the page.")]


def period_ns(period_s: float, speed: float) -> int:
    """Return the time between rounds, nanoseconds."""
    return round(period_s * SECOND / speed)
