"""`roletrust live record`, `replay`, `recover` and `scenario`: what was said, kept, and what it tells."""

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from roletrust_env import make_scenario
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.files import replacing
from roletrust_env.world.roster import Roster
from roletrust_experiments.commands.console import console, number_table
from roletrust_experiments.commands.live.options import Keys, Network, Scenario, Speed, period_ns, require_live
from roletrust_experiments.identification.scenario_files import readable

New = Annotated[Path, typer.Argument(help="A new folder.")]


def record(
    folder: New,
    images: Annotated[bool, typer.Option("--images/--no-images", help="Whether to keep the pictures.")] = True,
    network: Network = False,
) -> None:
    """Record [bold]all that is said[/], until Ctrl-C, as MCAP in the format of `ros2 bag`, which rosbags reads.

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
        str, typer.Option("--model", metavar="NAME[:key=value,...]", help="Any trust model; see `roletrust list`.")
    ] = "role-trust",
    keys: Keys = None,
    speed: Speed = 1.0,
) -> None:
    """Play a recording [bold]through the manager[/] again, with the same trust model or another.

    With the same model and keys, trust is what it was, to the last bit.

    [bold]Examples[/]

    [dim]# what TRAVOS would have made of it[/]
    [cyan]roletrust live replay results/bag results/travos.jsonl --model travos[/]
    """
    require_live()
    from roletrust_env.live.manager import Manager
    from roletrust_env.live.nodes import manage
    from roletrust_env.live.rounds import Patience
    from roletrust_env.live.trust_tracker import Team
    from roletrust_env.live.wire.keys import PublicKeys
    from roletrust_env.live.wire.recording import read_recording

    if journal.exists():
        raise ValueError(f"{journal} is there already; a replay needs a new file")
    rules = make_scenario(scenario)
    roster, period = Roster.of(rules), period_ns(rules.period_s, speed)
    keyring = None if keys is None else PublicKeys(keys)
    team = Team(roster.rater_names, roster.provider_names)
    model = parse_trust_model(trust_model, rules)
    with replacing(journal) as path:
        manager = Manager(model, path, patience=Patience(period), team=team, keyring=keyring)
        entries = list(manage.replay(read_recording(recording), manager, period))
        manager.close()
    counts = manager.gate.refused.items()
    refused = ", ".join(f"{readable(rater) or 'unknown'} {reason}: {n}" for (rater, reason), n in counts)
    told = f"{len(entries)} rounds, written to {journal}; refused: {refused or 'nothing'}"
    console.print(told, markup=False, soft_wrap=True)


def recover(damaged: Annotated[Path, typer.Argument(help="Folder or file of a recording.")], folder: New) -> None:
    """Save what can be read of a recording [bold]whose process was killed[/].

    [bold]Examples[/]

    [cyan]roletrust live recover results/bag results/bag-recovered[/]
    """
    require_live()
    from roletrust_env.live.wire import recording

    count = recording.recover(damaged, folder)
    console.print(f"Recovered {count} messages in {folder}", soft_wrap=True)


def scenario(
    recording: Annotated[Path, typer.Argument(help="Folder of a recording.")],
    out: Annotated[Path, typer.Option(help="A new .toml file.")] = Path("scenario.toml"),
    keys: Keys = None,
) -> None:
    """Make a [bold]scenario[/] of a recording, so that attackers are trained against the team as it was.

    It has who was there when, how many ratings did not count, when all services were disturbed, how well each provider
    served, and the bias and the noise of each rater. What no scenario can say is told: a rating that came too late does
    not count on the wire, and is lost here; who was away for a while stays. Attackers are not told apart from the
    others: an attack in less than a third of the rounds leaves the estimates nearly as they are.

    [bold]Examples[/]

    [cyan]roletrust live scenario results/live/recording --out team.toml[/]
    [cyan]roletrust play team.toml --attack sr_0=bad-mouthing[/]
    [cyan]roletrust train RaterAttack --scenario team.toml[/]
    """
    require_live()
    from roletrust_env.live.wire.keys import PublicKeys
    from roletrust_env.live.wire.recording import read_recording
    from roletrust_experiments.identification.inferred import infer
    from roletrust_experiments.identification.observed import observe
    from roletrust_experiments.identification.scenario_files import write_scenario

    if out.suffix != ".toml":
        raise ValueError(f"{out}: the name of the scenario must end in .toml")
    if out.exists():
        raise ValueError(f"{out} is there already; a scenario needs a new file")
    found = infer(observe(read_recording(recording), None if keys is None else PublicKeys(keys)), out.stem)
    write_scenario(out, found.scenario, found.names)
    table = number_table(
        escape(f"{recording.name}, {found.scenario.max_cycles} rounds"), "in 95% intervals", "value", "from", "to"
    )
    table.add_row("ratings that did not count", *_numbers(found.lost))
    for who, kind, values in (
        (found.raters, "bias", found.seen.bias),
        (found.raters, "noise", found.seen.noise),
        (found.providers, "ability", found.seen.ability),
    ):
        for name, value in zip(who, values, strict=True):
            table.add_row(escape(f"{kind} of {readable(name)}"), *_numbers(value))
    console.print(table)
    if found.late:
        console.print(f"[dim]{found.late:.1%} of the ratings came too late[/]", soft_wrap=True)
    if found.away:
        away = escape(", ".join(map(readable, found.away)))
        console.print(f"[dim]away for a while, and there in the scenario: {away}[/]", soft_wrap=True)
    console.print(f"Written to {out}", soft_wrap=True)


def _numbers(found: Interval) -> list[str]:
    return ["-" if value != value else f"{value:.3g}" for value in found]
