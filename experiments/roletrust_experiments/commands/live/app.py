"""The subcommands of `roletrust live`."""

from roletrust_experiments.commands.group import command_group

_HERE = "roletrust_experiments.commands.live"


@command_group(
    {
        "demo": f"{_HERE}.demo:demo",
        "view": f"{_HERE}.view:view",
        "agent": f"{_HERE}.nodes:agent",
        "manager": f"{_HERE}.nodes:manager",
        "keys": f"{_HERE}.nodes:keys",
        "record": f"{_HERE}.recordings:record",
    },
    add_completion=False,
)
def live() -> None:
    """Run [bold]cameras, raters and a trust manager[/] as processes that ROS 2 sees as nodes.

    [bold]Examples[/]

    [dim]# the paper's three robots on this machine[/]
    [cyan]roletrust live demo[/]

    [dim]# the same, with each node in its own terminal[/]
    [cyan]roletrust live manager team.jsonl[/]
    [cyan]roletrust live agent sp_0[/]
    [cyan]roletrust live agent sr_0[/]
    """
