"""`roletrust robots demo`: the paper's three robots as processes on this machine."""

from pathlib import Path
from statistics import median
from typing import Annotated

import typer

from roletrust_env.storage.files import write_json
from roletrust_experiments.commands.console import console, progress_bar, stages, tell
from roletrust_experiments.commands.extras import require_robots
from roletrust_experiments.commands.figures import claims_table
from roletrust_experiments.commands.options import Out, keyword_option, parse_keywords
from roletrust_experiments.paper.figures import Attack, papers

_SETTINGS = {
    "speed": "speed relative to the paper's clock, from 0.1 to 20",
    "seed": "random seed of the noise in pictures and on links",
}


def demo(
    attack: Annotated[
        Attack, typer.Option(help="Attack of the paper's Figure 3 or Figure 4.")
    ] = "bad-mouthing",
    out: Out = Path("results/robots"),
    view: Annotated[
        bool, typer.Option("--view/--no-view", help="Whether the browser shows the run.")
    ] = True,
    settings: Annotated[list[str] | None, keyword_option("--set", _SETTINGS)] = None,
) -> None:
    """Run the paper's [bold]three robots[/] as seven processes on DDS: three cameras, three raters
    and the manager.

    The run takes two minutes, or less with a higher speed; on a slow machine, rounds are longer.
    Meanwhile, a page in the browser shows the curves, the pictures of the cameras and the missing
    raters, and ROS 2 on this machine sees the nodes, topics and types. At the end, the command
    draws the paper's figure from the measured trust next to a simulation of the same run, and
    checks the claims of the paper.

    Written: [green]figure.png figure.csv figure-simulated.csv results.json[/];
    [green]journal.jsonl[/], the journal of the manager; [green]recording[/], all messages except
    pictures; and [green]keys[/].

    [bold]Examples[/]

    [dim]# the paper's Figure 4, in two minutes[/]
    [cyan]roletrust robots demo --attack bad-mouthing[/]

    [dim]# Figure 3, three times as fast, without a page[/]
    [cyan]roletrust robots demo --attack on-off --set speed=3 --no-view[/]
    """
    require_robots()
    from roletrust_experiments.plots.paper import write_paper
    from roletrust_manager.robots.demo import SCENARIO, run_demo

    given = parse_keywords(settings, "--set", _SETTINGS)
    paper = papers(SCENARIO.period_s)[0 if attack == "on-off" else 1]
    with progress_bar(counted=False) as bar:
        result = run_demo(
            out, paper.policies, view=view, report=tell, progress=stages(bar), **given
        )
    curves = {"measured": result.measured, "simulated": result.simulated}
    claims = {run: paper.check(curves[run], SCENARIO, paper.attack) for run in curves}
    caption = f"{len(result.rounds)} rounds on DDS, {result.partial} of them with a rater missing"
    numbers = {
        "command": "roletrust robots demo",
        "attack": attack,
        **given,
        "speed": result.speed,
        "rounds": len(result.rounds),
        "partial_rounds": result.partial,
        "image_to_trust_ms": {"median": median(delays), "largest": max(delays)}
        if (delays := result.delays_ms)
        else None,
        "claims": {run: [claim._asdict() for claim in found] for run, found in claims.items()},
        "files": write_paper(out, "figure", paper, curves, SCENARIO, caption),
    }
    write_json(out / "results.json", numbers)
    for run, found in claims.items():
        console.print(claims_table(f"Su and Saint-Jore (2023), {run}", found))
    tell(f"{caption}; written to {out}: results.json and {', '.join(numbers['files'])}", "dim")
