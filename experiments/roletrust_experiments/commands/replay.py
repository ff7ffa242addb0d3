"""`roletrust replay`: an attack of a benchmark once more, as a table, a figure and a video."""

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from roletrust_env.benchmarking.suite import Rule
from roletrust_env.storage.files import prepare_folder
from roletrust_experiments.commands.console import (
    ALLOW_CODE,
    console,
    number_table,
    progress_bar,
    tell,
)
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import NAMED, Out
from roletrust_experiments.plots.figure_files import write_figure


def replay(
    results: Annotated[
        Path, typer.Argument(help="Results of `roletrust benchmark`, a file results.sqlite.")
    ] = Path("results/benchmark/results.sqlite"),
    model: Annotated[
        str | None,
        typer.Option(metavar=NAMED, help="Trust model; by default the first one of the table."),
    ] = None,
    rule: Annotated[Rule, typer.Option(help="Choice rule of the consumers.")] = "common",
    setting: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="Setting of the suite; by default the one with the lowest skill."
        ),
    ] = None,
    video: Annotated[
        bool,
        typer.Option(
            "--video", help="Also save a video of the game with the lowest quality, game.mp4."
        ),
    ] = False,
    allow_code: Annotated[bool, typer.Option("--allow-code", help=ALLOW_CODE)] = False,
    out: Out = Path("results/replay"),
) -> None:
    """Play [bold]the worst attack on a trust model[/] again in one world, and show what it does.

    The games are those that measured the attack in this world, and the same ones while all agents
    are honest. A warning follows if the skill score differs from that of the file.

    Written: [green]replay.png[/], the quality that consumers receive, the share of services from
    compromised providers, and the trust in both sides, round by round; and with --video
    [green]game.mp4[/] and its last round, [green]game.png[/]. In the video, the compromised agents
    are marked.

    [bold]Examples[/]

    [dim]# the worst attack on a trust model, with a video[/]
    [cyan]roletrust replay results/quick/results.sqlite --model role-trust --video[/]

    [dim]# in another setting, with the choice rule of the model[/]
    [cyan]roletrust replay results/quick/results.sqlite --model block --rule own --setting raters[/]
    """
    require("a replay", "train", "scipy", "cma")  # as the benchmark whose suite it reads
    if video:
        require("--video", "video", "imageio", "imageio_ffmpeg")
    from roletrust_env.benchmarking.replay import replay as replay_attack
    from roletrust_experiments.plots.replay import replay_figure

    with console.status("Playing"):
        replayed = replay_attack(
            results, model=model, rule=rule, setting=setting, allow_code=allow_code
        )
    prepare_folder(out)
    case = replayed.case
    table = number_table(escape(replayed.title), escape(case.words), "attack", "all agents honest")
    for row in replayed.table():
        table.add_row(*row)
    console.print(table)
    if not replayed.agrees:
        tell(
            f"The skill score in world {replayed.world} is {replayed.attacked.skill:.6f}, but the "
            f"file has {case.scores['skill'][replayed.world]:.6f}. Possible causes: another "
            "version of the software, another processor, or a changed file.",
            "yellow",
        )
    write_figure(out / "replay.png", replay_figure(replayed))
    written = ["replay.png"]
    if video:
        from roletrust_experiments.plots.video import write_video_of_states

        task, game = replayed.task, int(replayed.attacked.received.mean(axis=0).argmin())
        with progress_bar() as progress:
            write_video_of_states(
                out / "game.mp4", task.game, replayed.states(game), task.identities, progress
            )
        written += ["game.mp4", "game.png"]
    tell(f"Written to {out}: {', '.join(written)}")
