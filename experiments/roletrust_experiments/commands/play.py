"""`roletrust play`: any scenario, under any trust models, with any attackers."""

import re
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from roletrust_env.evaluation.games import play as play_games
from roletrust_env.storage.files import prepare_folder
from roletrust_experiments.commands.console import (
    console,
    errors,
    number_table,
    print_json,
    progress_bar,
    stages,
    tell,
)
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import (
    NAMED,
    OWN,
    Seed,
    SettingsOption,
    further_arguments,
)
from roletrust_experiments.plots.curves import curve_figure
from roletrust_experiments.plots.figure_files import write_figure


def play(
    scenario: Annotated[
        str, typer.Argument(help="Name of a scenario, or path of a .toml or .yaml file.")
    ] = "paper-3x3",
    model: Annotated[
        list[str],
        typer.Option(
            metavar=NAMED, help="Trust model; repeat to compare several under one attack. " + OWN
        ),
    ] = ["role-trust"],  # noqa: B006 (typer copies it)
    attack: Annotated[
        list[str] | None,
        typer.Option(
            metavar=f"AGENT={NAMED}",
            help=f"Attack; repeat for more. AGENT may be like 'sr_*'. {OWN}",
        ),
    ] = None,
    settings: SettingsOption = None,
    games: Annotated[int, typer.Option(min=1, help="Number of games, played as one batch.")] = 1,
    seed: Seed = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder for the results; a new one in results/play if left out."
        ),
    ] = None,
    video: Annotated[
        bool,
        typer.Option(
            "--video", help="Also save a video of one game, play.mp4, and its last round, play.png."
        ),
    ] = False,
    as_json: Annotated[
        bool,
        typer.Option(
            "--json",
            help="Print results.json and nothing else, and write files only with --out or --video.",
        ),
    ] = False,
) -> None:
    r"""Play [bold]any scenario[/] with any attackers and trust models, and save the results.

    Written: [green]curves.png curves.csv results.json[/], and with --video [green]play.mp4
    play.png[/]. With several games every mean comes with its 95% confidence interval.

    Trust and reward are means over the agents of a group that are present; [bold]at end[/]: agents
    present in the last round / all agents. With an attack, the same games are played again with all
    agents honest. [bold]Damage[/]: mean trust of the honest agents there, minus that under the
    attack; an agent that has left counts with its last trust. [bold]AUC[/]: probability that an
    attacker has less trust than an honest agent of its role, by mean trust during the attack (left)
    and by final trust. [bold]False alarms[/]: share of rounds and honest agents in which trust is
    below 0.5. [bold]Utility[/]: quality of the most trusted provider, as a share of the best
    quality in the round; a provider that serves nobody in a round delivers nothing.
    [bold]Recovery[/]: rounds after the attack until the mean trust of the honest agents is within
    0.05 of that without the attack.

    Values are written as in TOML: 3, 0.5, true, \[0, 1], {kind = "choice"}.

    [bold]Examples[/]

    [dim]# a provider that alternates between good and bad service from round 100 on[/]
    [cyan]roletrust play --attack sp_2=on-off:start=100,period=4[/]

    [dim]# a third of a crowd lies; the damage over 20 games[/]
    [cyan]roletrust play crowd-10x10 --attack 'sr_\[0-2]=bad-mouthing' --games 20[/]

    [dim]# two trust models under one attack, aimed at a single provider[/]
    [cyan]roletrust play --model role-trust --model mean --attack sr_1=bad-mouthing:targets=sp_0[/]

    [dim]# a worse lie, and a video[/]
    [cyan]roletrust play --attack sr_1=bad-mouthing:level=0 --video[/]

    [dim]# for scripts: the damage under each model[/]
    [cyan]roletrust play --attack sr_1=bad-mouthing --json | jq '.measured | map_values(.damage)'[/]

    [dim]# a seller that leaves when it is distrusted and returns as a newcomer, up to three
    times[/]
    [cyan]roletrust play
    --set 'agents=\[{role="SR",count=9},{role="SP",count=5},{role="SP",reserve=3}]'
    --attack sp_5=whitewashing:reserve=3[/]

    [dim]# your own scenario, with some fields changed[/]
    [cyan]roletrust play mine.toml --set lam=0.7 --set 'admission={threshold=0.3}'[/]
    """
    if video:
        require("--video", "video", "imageio", "imageio_ffmpeg")
    changes = further_arguments(settings, play_games)
    if out is not None:
        prepare_folder(out)
    aside = errors if as_json else console
    with progress_bar(aside, counted=False) as progress:
        results = play_games(
            scenario,
            model=model,
            attacks=attack or [],
            games=games,
            seed=seed,
            advance=stages(progress),
            **changes,
        )
        written = []
        if out is None and (video or not as_json):
            out = Path("results/play") / _slug(results.title)
        if out is not None:
            written = results.write(out)
            for each in results.played:
                suffix = "" if len(results.played) == 1 else f"-{_slug(each.model)}"
                game, attackers = each.joint_policy.game, results.attackers
                marked = game.roster.with_reserves(attackers)
                figure = curve_figure(results.title, game, each.curves, marked)
                write_figure(out / f"curves{suffix}.png", figure)
                written.append(f"curves{suffix}.png")
                if video:
                    from roletrust_experiments.plots.video import write_video

                    write_video(out / f"play{suffix}.mp4", each.joint_policy, seed, progress)
                    written += [f"play{suffix}.mp4", f"play{suffix}.png"]
    if as_json:
        print_json(results.data())
    else:
        (name, *headings), rows = results.table()
        wrapped = [heading.replace(" ", "\n", 1) for heading in headings]
        table = number_table(escape(results.title), "", *wrapped, name=name)
        for row in rows:
            table.add_row(*map(escape, row))
        console.print(table)
        for note in results.notes():
            tell(note)
    if written:
        tell(f"Written to {out}: {', '.join(written)}", where=aside)


def _slug(text: str) -> str:
    return re.sub(r"[^\w.]+", "-", text).strip("-")
