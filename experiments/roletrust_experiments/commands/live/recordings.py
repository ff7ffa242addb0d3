"""`roletrust live record`: a recording of a team."""

from pathlib import Path
from typing import Annotated

import typer

from roletrust_experiments.commands.console import tell
from roletrust_experiments.commands.extras import require_live
from roletrust_experiments.commands.live.options import Network


def record(
    folder: Annotated[Path, typer.Argument(help="New folder.")],
    images: Annotated[
        bool, typer.Option("--images/--no-images", help="Whether to record the pictures.")
    ] = True,
    network: Network = False,
    recover: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="Damaged recording whose readable messages are saved; no new ones are.",
        ),
    ] = None,
) -> None:
    """Record [bold]all messages[/] until Ctrl-C, as MCAP in the format of `ros2 bag`.

    A recording whose process was killed lacks its index, and ordinary readers refuse it. With
    --recover, its readable messages are written to a new folder.

    [bold]Examples[/]

    [cyan]roletrust live record results/bag[/]

    [dim]# the readable messages of a recording whose process was killed[/]
    [cyan]roletrust live record results/recovered --recover results/bag[/]
    """
    require_live()
    if recover is not None:
        from roletrust_manager.dds.wire.recording import recover_recording

        count, done = recover_recording(recover, folder), "Recovered"
    else:
        from roletrust_manager.dds.nodes.recorder_node import run_recorder_node

        count, done = run_recorder_node(folder, images=images, network=network), "Recorded"
    tell(f"{done} {count} messages in {folder}")
