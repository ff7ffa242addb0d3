"""The subcommands of `roletrust live`."""

from roletrust_experiments.commands.group import command_group

_HERE = "roletrust_experiments.commands.live"


@command_group(
    {
        "demo": f"{_HERE}.demo:demo",
        "view": f"{_HERE}.view:view",
        "cam": f"{_HERE}.nodes:cam",
        "assess": f"{_HERE}.nodes:assess",
        "manager": f"{_HERE}.nodes:manager",
        "keys": f"{_HERE}.nodes:keys",
        "record": f"{_HERE}.recordings:record",
        "replay": f"{_HERE}.recordings:replay",
        "recover": f"{_HERE}.recordings:recover",
        "scenario": f"{_HERE}.recordings:scenario",
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
    [cyan]roletrust live cam sp_0[/]
    [cyan]roletrust live assess sr_0[/]
    """
