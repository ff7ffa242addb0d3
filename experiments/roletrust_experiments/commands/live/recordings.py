"""`roletrust live record` and `scenario`: recordings of a team and their use."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.scenario_files import printable_name, write_scenario
from roletrust_experiments.commands.console import (
    console,
    errors,
    number_table,
    progress_bar,
    stage,
    tell,
    tracked,
)
from roletrust_experiments.commands.extras import require, require_live
from roletrust_experiments.commands.live.options import Keys, Network


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


def scenario(
    recording: Annotated[Path, typer.Argument(help="Folder of a recording, or a log of ratings.")],
    out: Annotated[Path, typer.Option(help="New .toml file.")] = Path("scenario.toml"),
    keys: Keys = None,
    every: Annotated[float, typer.Option(help="Length of a round of a log, seconds.")] = 60.0,
    scale: Annotated[
        tuple[float, float],
        typer.Option(help="Worst and best rating of a log.", metavar="WORST BEST"),
    ] = (0.0, 1.0),
) -> None:
    """Make a [bold]scenario[/] from a recording, to train attackers against the recorded team.

    The scenario has the rounds in which each agent was present, the share of lost ratings, the
    disturbances of all services, the ability of each provider, and the bias and noise of each
    rater. A scenario cannot express everything, and the command reports the rest: a rating that
    arrived too late counts as lost, and an agent that was absent for a while is present throughout.
    Attackers are treated like other agents; an attack in less than a third of the rounds hardly
    changes the estimates. A log, such as the export of a trust manager, is read as `roletrust rate
    --same-agents` reads it; raters that are silent in a round count as lost ratings.

    [bold]Examples[/]

    [cyan]roletrust live scenario results/live/recording --out team.toml[/]
    [cyan]roletrust play team.toml --attack sr_0=bad-mouthing[/]
    [cyan]roletrust train RaterAttack --scenario team.toml[/]

    [dim]# agents that are no robots[/]
    [cyan]roletrust live scenario ratings.csv --every 60 --out agents.toml[/]
    """
    require_live()
    from roletrust_manager.admission.keys import PublicKeys
    from roletrust_manager.dds.recorded_team import infer_scenario, observe_team
    from roletrust_manager.dds.wire.recording import read_recording

    if out.suffix != ".toml":
        raise ValueError(f"{out}: the name of the scenario must end in .toml")
    if out.exists():
        raise ValueError(f"{out} exists already; a scenario needs a new file")
    with progress_bar(errors) as progress:
        advance = stage(progress, f"Reading {recording.name}")
        if recording.is_file():
            require("roletrust live scenario of a log", "data", "pyarrow")
            from roletrust_env.logs.log import read
            from roletrust_manager.dds.log_team import observe_log

            log = read(recording, scale=scale, same_agents=True)
            for note in log.notes:
                tell(note)
            observation = observe_log(log, every)
        else:
            keyring = None if keys is None else PublicKeys(keys)
            again = partial(tracked, progress, "Matching ratings")
            observation = observe_team(read_recording(recording, advance), keyring, again)
        inferred = infer_scenario(observation, out.stem)
    write_scenario(out, inferred.scenario, inferred.names)
    table = number_table(
        escape(f"{recording.name}, {inferred.scenario.max_cycles} rounds"),
        "with 95% intervals",
        "value",
        "from",
        "to",
    )
    table.add_row("ratings that did not count", *_numbers(inferred.lost))
    for names, kind, values in (
        (inferred.raters, "bias", inferred.perception.bias),
        (inferred.raters, "noise", inferred.perception.noise),
        (inferred.providers, "ability", inferred.perception.ability),
    ):
        for name, value in zip(names, values, strict=True):
            table.add_row(escape(f"{kind} of {printable_name(name)}"), *_numbers(value))
    console.print(table)
    if inferred.late:
        tell(f"{inferred.late:.1%} of the ratings arrived too late", "dim")
    if inferred.away:
        away = ", ".join(map(printable_name, inferred.away))
        tell(f"absent for a while, but present throughout the scenario: {away}", "dim")
    tell(f"Written to {out}")


def _numbers(interval: Interval) -> list[str]:
    return ["-" if value != value else f"{value:.3g}" for value in interval]
