"""What `roletrust live` can do."""

import typer

from experiments.commands.live.demo import demo
from experiments.commands.live.nodes import assess, cam, keys, manager
from experiments.commands.live.recordings import record, recover, replay

live = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="rich",
    help="Run [bold]cameras, raters and a trust manager[/] as processes that ROS 2 sees as its own nodes.",
)
live.command("demo")(demo)
live.command("cam")(cam)
live.command("assess")(assess)
live.command("manager")(manager)
live.command("keys")(keys)
live.command("record")(record)
live.command("replay")(replay)
live.command("recover")(recover)
