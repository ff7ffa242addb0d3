"""`roletrust live record`, `replay`, `recover` and `scenario`: recordings and their use."""

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from roletrust_env import make_scenario
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.files import replacing
from roletrust_env.storage.scenario_files import printable
from roletrust_env.world.roster import Roster
from roletrust_experiments.commands.console import console, number_table
from roletrust_experiments.commands.live.options import Keys, Network, Scenario, Speed, period_ns, require_live

NewFolder = Annotated[Path, typer.Argument(help="New folder.")]


def record(
    folder: NewFolder,
    images: Annotated[bool, typer.Option("--images/--no-images", help="Whether to record the pictures.")] = True,
    network: Network = False,
) -> None:
    """Record [bold]all messages[/] until Ctrl-C, as MCAP in the format of `ros2 bag`.

    [bold]Examples[/]

    [cyan]roletrust live record results/bag[/]
    """
    require_live()
    from roletrust_env.live.nodes.recorder_node import run_recorder_node

    count = run_recorder_node(folder, images=images, network=network)
    console.print(f"Recorded {count} messages in {folder}", soft_wrap=True)


def replay(
    recording: Annotated[Path, typer.Argument(help="Folder of a recording.")],
    journal: Annotated[Path, typer.Argument(help="New journal file for the rounds.")],
    scenario: Scenario = "paper-3x3",
    trust_model: Annotated[
        str, typer.Option("--model", metavar="NAME[:key=value,...]", help="Trust model; see `roletrust list`.")
    ] = "role-trust",
    keys: Keys = None,
    speed: Speed = 1.0,
) -> None:
    """Replay a recording [bold]through the manager[/], with the same trust model or another.

    With the same model and keys, the trust is the same to the last bit.

    [bold]Examples[/]

    [dim]# the trust that TRAVOS would have published[/]
    [cyan]roletrust live replay results/bag results/travos.jsonl --model travos[/]
    """
    require_live()
    from roletrust_env.live.manager import Manager
    from roletrust_env.live.nodes import manager_node
    from roletrust_env.live.rounds import RoundTiming
    from roletrust_env.live.trust_tracker import Team
    from roletrust_env.live.wire.keys import PublicKeys
    from roletrust_env.live.wire.recording import read_recording

    if journal.exists():
        raise ValueError(f"{journal} exists already; a replay needs a new file")
    rules = make_scenario(scenario)
    roster, period = Roster.of(rules), period_ns(rules.period_s, speed)
    keyring = None if keys is None else PublicKeys(keys)
    team = Team(roster.rater_names, roster.provider_names)
    model = parse_trust_model(trust_model, rules)
    with replacing(journal) as path:
        manager = Manager(model, path, timing=RoundTiming(period), team=team, keyring=keyring)
        entries = list(manager_node.replay_recording(read_recording(recording), manager, period))
        manager.close()
    counts = manager.validator.refusals.items()
    refusals = ", ".join(f"{printable(rater) or 'unknown'} {reason}: {n}" for (rater, reason), n in counts)
    summary = f"{len(entries)} rounds, written to {journal}; refused: {refusals or 'nothing'}"
    console.print(summary, markup=False, soft_wrap=True)


def recover(damaged: Annotated[Path, typer.Argument(help="Folder or file of a recording.")], folder: NewFolder) -> None:
    """Recover the readable messages of a [bold]damaged recording[/], such as that of a killed process.

    [bold]Examples[/]

    [cyan]roletrust live recover results/bag results/bag-recovered[/]
    """
    require_live()
    from roletrust_env.live.wire import recording

    count = recording.recover_recording(damaged, folder)
    console.print(f"Recovered {count} messages in {folder}", soft_wrap=True)


def scenario(
    recording: Annotated[Path, typer.Argument(help="Folder of a recording.")],
    out: Annotated[Path, typer.Option(help="New .toml file.")] = Path("scenario.toml"),
    keys: Keys = None,
) -> None:
    """Make a [bold]scenario[/] from a recording, to train attackers against the recorded team.

    The scenario has the rounds in which each agent was present, the share of lost ratings, the disturbances of all
    services, the ability of each provider, and the bias and noise of each rater. A scenario cannot express everything,
    and the command reports the rest: a rating that arrived too late counts as lost, and an agent that was absent for
    a while is present throughout. Attackers are treated like other agents; an attack in less than a third of the
    rounds hardly changes the estimates.

    [bold]Examples[/]

    [cyan]roletrust live scenario results/live/recording --out team.toml[/]
    [cyan]roletrust play team.toml --attack sr_0=bad-mouthing[/]
    [cyan]roletrust train RaterAttack --scenario team.toml[/]
    """
    require_live()
    from roletrust_env.live.recorded_team import infer_scenario, observe_team
    from roletrust_env.live.wire.keys import PublicKeys
    from roletrust_env.live.wire.recording import read_recording
    from roletrust_env.storage.scenario_files import write_scenario

    if out.suffix != ".toml":
        raise ValueError(f"{out}: the name of the scenario must end in .toml")
    if out.exists():
        raise ValueError(f"{out} exists already; a scenario needs a new file")
    inferred = infer_scenario(
        observe_team(read_recording(recording), None if keys is None else PublicKeys(keys)), out.stem
    )
    write_scenario(out, inferred.scenario, inferred.names)
    table = number_table(
        escape(f"{recording.name}, {inferred.scenario.max_cycles} rounds"), "with 95% intervals", "value", "from", "to"
    )
    table.add_row("ratings that did not count", *_numbers(inferred.lost))
    for names, kind, values in (
        (inferred.raters, "bias", inferred.perception.bias),
        (inferred.raters, "noise", inferred.perception.noise),
        (inferred.providers, "ability", inferred.perception.ability),
    ):
        for name, value in zip(names, values, strict=True):
            table.add_row(escape(f"{kind} of {printable(name)}"), *_numbers(value))
    console.print(table)
    if inferred.late:
        console.print(f"[dim]{inferred.late:.1%} of the ratings arrived too late[/]", soft_wrap=True)
    if inferred.away:
        away = escape(", ".join(map(printable, inferred.away)))
        console.print(f"[dim]absent for a while, but present throughout the scenario: {away}[/]", soft_wrap=True)
    console.print(f"Written to {out}", soft_wrap=True)


def _numbers(interval: Interval) -> list[str]:
    return ["-" if value != value else f"{value:.3g}" for value in interval]
