"""The subcommands of `roletrust live`."""

import typer

from roletrust_experiments.commands.live.demo import demo
from roletrust_experiments.commands.live.nodes import assess, cam, keys, manager
from roletrust_experiments.commands.live.recordings import record, recover, replay, scenario
from roletrust_experiments.commands.live.view import view

live = typer.Typer(no_args_is_help=True, rich_markup_mode="rich")


@live.callback()
def roletrust_live() -> None:
    """Run [bold]cameras, raters and a trust manager[/] as processes that ROS 2 sees as nodes.

    [bold]Examples[/]

    [dim]# the paper's three robots on this machine[/]
    [cyan]roletrust live demo[/]

    [dim]# the same, with each node in its own terminal[/]
    [cyan]roletrust live manager team.jsonl[/]
    [cyan]roletrust live cam sp_0[/]
    [cyan]roletrust live assess sr_0[/]
    """


live.command("demo")(demo)
live.command("view")(view)
live.command("cam")(cam)
live.command("assess")(assess)
live.command("manager")(manager)
live.command("keys")(keys)
live.command("record")(record)
live.command("replay")(replay)
live.command("recover")(recover)
live.command("scenario")(scenario)
