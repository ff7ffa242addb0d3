"""The subcommands of `roletrust robots`."""

from roletrust_experiments.commands.group import command_group

_HERE = "roletrust_experiments.commands.robots"


@command_group(
    {
        "demo": f"{_HERE}.demo:demo",
        **{
            name: f"{_HERE}.nodes:{name}" for name in ("view", "agent", "manager", "keys", "record")
        },
    },
    add_completion=False,
)
def robots() -> None:
    """Run [bold]cameras, raters and a trust manager[/] as processes that ROS 2 sees as nodes.

    [bold]Examples[/]

    [dim]# the paper's three robots on this machine[/]
    [cyan]roletrust robots demo[/]

    [dim]# the same, with each node in its own terminal[/]
    [cyan]roletrust robots manager team.journal[/]
    [cyan]roletrust robots agent sp_0[/]
    [cyan]roletrust robots agent sr_0[/]
    """
