"""`roletrust robots agent`, `manager`, `view`, `record` and `keys`: single nodes and their keys."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from roletrust_experiments.commands.console import tell
from roletrust_experiments.commands.extras import require_robots
from roletrust_experiments.commands.options import NAMED, keyword_option, parse_keywords

_TEAM = {
    "scenario": "name or file of a scenario, which sets agents, rounds and disturbances",
    "speed": "speed relative to the scenario's clock, from 0.1 to 20",
    "network": "true to communicate with other machines, too",
}
_AGENT = {**_TEAM, "seed": "random seed of the noise in pictures or on links"}
_VIEW = {**_TEAM, "port": "port of the page, by default 5006; another one if it is taken"}
_RECORD = {"images": "false to leave out pictures", "network": _TEAM["network"]}

Keys = Annotated[
    Path | None, typer.Option(help="Folder with keys, made by `roletrust robots keys`.")
]
Settings = list[str] | None


def agent(
    name: Annotated[
        str, typer.Argument(help="Name of an agent of the scenario, such as sp_0 or sr_0.")
    ],
    role: Annotated[
        Literal["rater", "provider"] | None,
        typer.Option(help="Role to play; needed for an agent that has both."),
    ] = None,
    attack: Annotated[
        str | None,
        typer.Option(
            metavar=NAMED, help="Attack to play instead of honest play; see `roletrust list`."
        ),
    ] = None,
    frames: Annotated[
        str | None,
        typer.Option(
            metavar="PATH_OR_NUMBER",
            help="Video, image folder or number of a camera for the pictures of a provider.",
        ),
    ] = None,
    keys: Keys = None,
    settings: Annotated[Settings, keyword_option("--set", _AGENT)] = None,
) -> None:
    """Run an [bold]agent[/] of a team until Ctrl-C: a camera for a provider, and an assessor of
    pictures for a rater.

    A provider is the node [green]/NAME/cam[/], which publishes one picture a round on
    [green]/NAME/image_raw/compressed[/]. A rater is the node [green]/NAME/assess[/], which looks
    for a person in every picture: its rating of a camera, on [green]/NAME/ratings[/], is the
    probability that the picture shows one.

    The disturbances of the scenario come once. A video or a folder of images starts again at its
    end. With --keys, pictures and ratings are signed, and agents that have keys ignore unsigned
    messages. A rater publishes its refusals on [green]/diagnostics[/].

    [bold]Examples[/]

    [dim]# the first camera of the paper, on the rendered scene, and an honest rater[/]
    [cyan]roletrust robots agent sp_0 --keys keys[/]
    [cyan]roletrust robots agent sr_0 --keys keys[/]

    [dim]# a real camera, on the whole network[/]
    [cyan]roletrust robots agent sp_1 --frames 0 --set network=true[/]

    [dim]# a camera with ten rounds of good pictures and ten of bad ones, in turn; a rater that
    always rates 0.2; a trained attacker[/]
    [cyan]roletrust robots agent sp_2 --attack on-off:period=20[/]
    [cyan]roletrust robots agent sr_2 --attack bad-mouthing:level=0.2[/]
    [cyan]roletrust robots agent sr_2 --attack learned:path=universal-raters[/]
    """
    require_robots()
    from roletrust_manager.robots.agent import run_agent

    given = parse_keywords(settings, "--set", _AGENT)
    run_agent(name, role=role, attack=attack, frames=frames, keys=keys, **given)


def manager(
    journal: Annotated[
        Path, typer.Argument(help="Journal file for the rounds; an existing journal is continued.")
    ],
    model: Annotated[
        str, typer.Option(metavar=NAMED, help="Trust model; see `roletrust list`.")
    ] = "role-trust",
    keys: Keys = None,
    settings: Annotated[Settings, keyword_option("--set", _TEAM)] = None,
) -> None:
    """Run the [bold]manager[/], which matches ratings and publishes [green]/trust, /NAME/tor,
    /NAME/top[/].

    It expects the agents of the scenario from the start, and others from their first message on.
    With --keys, a rating counts only if the rater that it names has signed it, and all agents with
    a key may join. Without keys, only a few may join that the scenario does not name. Refusals are
    published on [green]/diagnostics[/].

    [bold]Examples[/]

    [dim]# stopped and started again, it continues with the next round[/]
    [cyan]roletrust robots manager results/team.journal --keys keys[/]

    [dim]# another trust model[/]
    [cyan]roletrust robots manager results/travos.journal --model travos[/]
    """
    require_robots()
    from roletrust_manager.robots.manager import run_manager

    given = parse_keywords(settings, "--set", _TEAM)
    run_manager(journal, model=model, keys=keys, **given)


def view(
    keys: Keys = None, settings: Annotated[Settings, keyword_option("--set", _VIEW)] = None
) -> None:
    """Show a running team [bold]in the browser[/] until Ctrl-C: trust, missing raters, refused
    ratings and the cameras' pictures.

    With --keys, the page shows only signed messages, and counts its refusals. It can be opened on
    this machine only.

    [bold]Examples[/]

    [dim]# next to nodes in other terminals[/]
    [cyan]roletrust robots view --keys keys[/]
    """
    require_robots()
    from roletrust_manager.robots.view import run_view

    run_view(keys=keys, **parse_keywords(settings, "--set", _VIEW))


def record(
    folder: Annotated[Path, typer.Argument(help="New folder.")],
    settings: Annotated[Settings, keyword_option("--set", _RECORD)] = None,
) -> None:
    """Record [bold]all messages[/] until Ctrl-C, as MCAP in the format of `ros2 bag`.

    [bold]Examples[/]

    [cyan]roletrust robots record results/bag[/]
    """
    require_robots()
    from roletrust_manager.dds.nodes.recorder_node import run_recorder_node

    count = run_recorder_node(folder, **parse_keywords(settings, "--set", _RECORD))
    tell(f"Recorded {count} messages in {folder}")


def keys(
    folder: Annotated[Path, typer.Argument(help="Folder for the keys.")],
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="Names of agents, or manager.", show_default="manager and the agents of the paper"
        ),
    ] = None,
    replace: Annotated[
        bool,
        typer.Option(
            "--replace", help="Replace public keys that are there without their private keys."
        ),
    ] = False,
) -> None:
    """Make [bold]keys[/]: NAME.key, readable by its owner only, and NAME.pub for all others.

    The manager and each agent need their own private key and all public keys. Existing private keys
    are not changed.

    [bold]Examples[/]

    [cyan]roletrust robots keys keys[/]

    [dim]# of a team of your own[/]
    [cyan]roletrust robots keys keys manager sr_0 sr_1 sp_0[/]
    """
    require_robots()
    from roletrust_manager.admission.keys import make_keys

    names = names or ["manager", *(f"{role}_{k}" for role in ("sr", "sp") for k in range(3))]
    new = make_keys(folder, names, replace=replace)
    old = [name for name in names if name not in new]
    tell(f"Made in {folder}: {', '.join(new) or 'none'}. Unchanged: {', '.join(old) or 'none'}")
