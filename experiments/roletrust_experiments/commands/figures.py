"""`roletrust figures`: Figures 3 and 4 of Su and Saint-Jore (EWSN 2023), from real ratings."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from roletrust_env.storage.files import prepare_folder
from roletrust_experiments.commands.console import (
    console,
    plain_table,
    progress_bar,
    stages,
    tell,
)
from roletrust_experiments.commands.options import Out, Seed, SettingsOption, further_arguments
from roletrust_experiments.paper.claims import VERDICTS, Claim
from roletrust_experiments.paper.figures import PaperScenario
from roletrust_experiments.paper.figures import figures as measure_figures


def figures(
    scenario: Annotated[
        PaperScenario,
        typer.Argument(help="People detection in camera frames, or plain numbers."),
    ] = "paper-3x3-hog",
    settings: SettingsOption = None,
    seed: Seed = 0,
    out: Out = Path("results/figures"),
) -> None:
    """Reproduce [bold]Figures 3 and 4[/] of the paper, and compare the measurements with its
    claims.

    Three raters rate three cameras every half second. The figures differ in the attacker only. In
    Figure 3, provider 3 alternates between bad and good service (on-off, 50-90 s). In Figure 4,
    rater 3 rates 0.5 whatever it sees (bad-mouthing, 20-45 s).

    Written: [green]figure3.csv figure3.png figure4.csv figure4.png results.json[/]. The state after
    round r, counted from 0, is at time (r + 1) x 0.5 s.

    With --set frames=PATH, all three cameras see the same picture: 120 s of video, or 240 images,
    one for each round; fewer with --set playback=loop. Claims that only hold for the rendered scene
    then say n/a, and all do if no person is in clear view.

    [bold]Examples[/]

    [dim]# with OpenCV's people detector, in about a minute[/]
    [cyan]roletrust figures[/]

    [dim]# with your own video of two minutes[/]
    [cyan]roletrust figures --set frames=walk.mp4 --out results/walk[/]

    [dim]# with a shorter video, repeated[/]
    [cyan]roletrust figures --set frames=walk.mp4 --set playback=loop --out results/walk[/]

    [dim]# for fewer rounds: 40 rounds need 20 s of video, or 40 images[/]
    [cyan]roletrust play paper-3x3-hog --set frames=walk.mp4 --set max_cycles=40[/]

    [dim]# without a camera, in a second[/]
    [cyan]roletrust figures paper-3x3 --seed 7[/]
    """
    from roletrust_experiments.plots.paper import write_figures

    changes = further_arguments(settings, measure_figures)
    prepare_folder(out)
    with progress_bar(counted=False) as progress:
        found = measure_figures(scenario, seed=seed, advance=stages(progress), **changes)
    service = {"hog": "OpenCV's HOG people detector", "synthetic": "a synthetic service"}
    title = f"Su and Saint-Jore (2023), seen through {service[found.game.scenario.service]}"
    console.print(claims_table(title, found.claims))
    for note in found.notes():
        tell(note, "dim")
    tell(f"Written to {out}: {', '.join(write_figures(found, out))}")


def claims_table(title: str, checked: Sequence[Claim]) -> Table:
    """Return the table of the paper's claims: the claim, the criterion and the measured value."""
    table = plain_table(title)
    for heading in ("fig", "what", "the paper", "needed", "measured", ""):
        table.add_column(
            heading, justify="right" if heading == "measured" else "left", overflow="fold"
        )
    for claim, following in zip(checked, [*checked[1:], None], strict=True):
        colour = {True: "green", False: "bold red", None: "dim"}[claim.ok]
        verdict = f"[{colour}]{VERDICTS[claim.ok]}[/]"
        ends = following is not None and following.figure != claim.figure
        table.add_row(
            str(claim.figure),
            claim.what,
            claim.paper,
            claim.needed,
            claim.measured,
            verdict,
            end_section=ends,
        )
    return table
