"""What the commands of `roletrust live` share: their options, and what they need."""

from pathlib import Path
from typing import Annotated

import typer

from roletrust_experiments.commands.extras import require

PERIOD_NS = 1_000_000_000  # of a second

Scenario = Annotated[
    str, typer.Option(help="Name or file of a scenario: who is in it, how long it lasts, when the target moves fast.")
]
Speed = Annotated[float, typer.Option(min=0.1, max=20, help="How much faster than the scenario's clock it runs.")]
Start = Annotated[
    int | None,
    typer.Option(
        help="When round 0 begins, nanoseconds since 1970; the next whole period if left out. Attacks count from it.",
        show_default=False,
    ),
]
Keys = Annotated[
    Path | None, typer.Option(help="Folder of keys, as `roletrust live keys` makes it.", show_default=False)
]
Network = Annotated[
    bool, typer.Option("--network", help="Speak to other machines; without it, this machine only hears itself.")
]
Port = Annotated[int, typer.Option(min=1024, max=65535, help="Of the page, on this machine only.")]
Browser = Annotated[bool, typer.Option("--browser/--no-browser", help="Whether to open the page.")]


def require_live() -> None:
    """See before the work whether all is there that live nodes need."""
    require("roletrust live", "live", "cyclonedds", "rosbags", "cryptography", "cv2")


def period_ns(period_s: float, speed: float) -> int:
    """Between rounds, nanoseconds."""
    return round(period_s * PERIOD_NS / speed)
