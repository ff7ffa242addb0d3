"""`roletrust live record`, `replay` and `recover`: what was said, kept and played again."""

from pathlib import Path
from typing import Annotated

import typer

from experiments.commands.console import console
from experiments.commands.live.options import Keys, Network, Scenario, Speed, period_ns, require_live
from experiments.naming import parse_trust_model
from roletrust_env import make_scenario
from roletrust_env.world.roster import Roster

New = Annotated[Path, typer.Argument(help="A new folder.")]


def record(
    folder: New,
    images: Annotated[bool, typer.Option("--images/--no-images", help="Whether to keep the pictures.")] = True,
    network: Network = False,
) -> None:
    """Record [bold]all that is said[/], until Ctrl-C, as MCAP that `ros2 bag`, Foxglove and rosbags read.

    [bold]Examples[/]

    [cyan]roletrust live record results/bag[/]
    """
    require_live()
    from roletrust_env.live.nodes.record import run_record

    count = run_record(folder, images=images, network=network)
    console.print(f"Recorded {count} messages in {folder}", soft_wrap=True)


def replay(
    recording: Annotated[Path, typer.Argument(help="Folder of a recording.")],
    journal: Annotated[Path, typer.Argument(help="A new file for the rounds.")],
    scenario: Scenario = "paper-3x3",
    trust_model: Annotated[
        str, typer.Option(metavar="NAME:key=value,...", help="Any trust model; see `roletrust list`.")
    ] = "role-trust",
    keys: Keys = None,
    speed: Speed = 1.0,
) -> None:
    """Play a recording [bold]through the manager[/] again, with the same trust model or another.

    With the same model and keys, trust is what it was, to the last bit.

    [bold]Examples[/]

    [dim]# what TRAVOS would have made of it[/]
    [cyan]roletrust live replay results/bag results/travos.jsonl --trust-model travos[/]
    """
    require_live()
    from roletrust_env.live.manager import Manager
    from roletrust_env.live.nodes import manage
    from roletrust_env.live.rounds import Patience
    from roletrust_env.live.standing import Team
    from roletrust_env.live.wire.keys import PublicKeys
    from roletrust_env.live.wire.recording import read_recording

    if journal.exists():
        raise ValueError(f"{journal} is there already; a replay needs a new file")
    rules = make_scenario(scenario)
    roster, period = Roster.of(rules), period_ns(rules.period_s, speed)
    keyring = None if keys is None else PublicKeys(keys)
    team = Team(roster.rater_names, roster.provider_names)
    model = parse_trust_model(trust_model, rules)
    manager = Manager(model, journal, patience=Patience(period), team=team, keyring=keyring)
    entries = list(manage.replay(read_recording(recording), manager, period))
    manager.close()
    refused = ", ".join(f"{rater or 'unknown'} {reason}: {n}" for (rater, reason), n in manager.gate.refused.items())
    console.print(f"{len(entries)} rounds, written to {journal}; refused: {refused or 'nothing'}", soft_wrap=True)


def recover(damaged: Annotated[Path, typer.Argument(help="Folder or file of a recording.")], folder: New) -> None:
    """Save what can be read of a recording [bold]whose process was killed[/].

    [bold]Examples[/]

    [cyan]roletrust live recover results/bag results/bag-recovered[/]
    """
    require_live()
    from roletrust_env.live.wire import recording

    count = recording.recover(damaged, folder)
    console.print(f"Recovered {count} messages in {folder}", soft_wrap=True)
