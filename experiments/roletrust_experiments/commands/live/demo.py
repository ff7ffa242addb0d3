"""`roletrust live demo`: the paper's three robots on this machine."""

import multiprocessing
import os
import statistics
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from roletrust_env import Game, JointPolicy
from roletrust_env.evaluation.curves import Curves
from roletrust_env.storage.files import prepare_folder, write_json
from roletrust_env.storage.provenance import describe, describe_policies
from roletrust_experiments.commands.console import claims_table, console, progress_bar
from roletrust_experiments.commands.live.options import Browser, Port, Speed, require_live
from roletrust_experiments.commands.live.team import DemoPlan, DemoRun, run_team
from roletrust_experiments.commands.live.view import address, require_view
from roletrust_experiments.paper.figures import Attack
from roletrust_experiments.paper.live_curves import curves_from_rounds, latencies_ms
from roletrust_experiments.playing.tracked import track_curves

_NICENESS = 19  # the simulation gives way to the robots


def demo(
    attack: Annotated[Attack, typer.Option(help="Attack of the paper's Figure 3 or Figure 4.")] = "bad-mouthing",
    seconds: Annotated[
        float,
        typer.Option(help="End of the run, in seconds of the paper's clock; at least 20 s after the attack starts."),
    ] = 120.0,
    speed: Speed = 1.0,
    out: Annotated[Path, typer.Option(help="Folder for the results; it is created if it does not exist.")] = Path(
        "results/live"
    ),
    signed: Annotated[bool, typer.Option("--signed/--unsigned", help="Whether all nodes sign their messages.")] = True,
    view: Annotated[bool, typer.Option("--view/--no-view", help="Whether to serve a page that shows the run.")] = True,
    port: Port = 5006,
    browser: Browser = True,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of the noise in pictures and on links.")] = 0,
) -> None:
    """Run the paper's [bold]three robots[/] as seven processes on DDS: three cameras, three raters and the manager.

    The run takes two minutes, or less with --speed. Meanwhile, a page in the browser shows the curves, the pictures of
    the cameras and the missing raters, and ROS 2 on this machine sees the nodes, topics and types. At the end, the
    command draws the paper's figure from the measured trust beside a simulation of the same run, and checks the
    claims of the paper.

    Written: [green]figure.png figure.csv figure-simulated.csv results.json[/]; [green]journal.jsonl[/], the journal of
    the manager; [green]recording[/], all messages except pictures; and [green]keys[/].

    [bold]Examples[/]

    [dim]# the paper's Figure 4, in two minutes[/]
    [cyan]roletrust live demo --attack bad-mouthing[/]

    [dim]# Figure 3, three times as fast, without a page[/]
    [cyan]roletrust live demo --attack on-off --speed 3 --no-view[/]
    """
    (require_view if view else require_live)()
    plan = DemoPlan(attack, seconds, speed, signed, seed)
    if view:
        from roletrust_experiments.view.server import check_port

        check_port(port)
    prepare_folder(out)
    with multiprocessing.get_context("spawn").Pool(1, os.nice, (_NICENESS,)) as aside, progress_bar() as progress:
        simulation = aside.apply_async(_simulated, (plan,))
        if view:
            console.print(f"Watch it on {address(port)}", soft_wrap=True)
        if view and browser:
            webbrowser.open(address(port))
        run = run_team(plan, out, port if view else None, progress)
        progress.add_task("Waiting for the simulation", total=None)
        simulated = simulation.get()
    _report(plan, run, simulated, out)


def _simulated(plan: DemoPlan) -> Curves:
    """Simulate the same run without robots."""
    with progress_bar() as progress:
        progress.disable = True
        return track_curves(JointPolicy(Game(plan.scenario), plan.paper.policies), plan.seed, progress, "")


def _report(plan: DemoPlan, run: DemoRun, simulated: Curves, out: Path) -> None:
    """Write and print the results."""
    from roletrust_experiments.plots.paper import write_paper

    paper, scenario, entries = plan.paper, plan.scenario, run.entries
    curves = curves_from_rounds([entry.published for entry in entries], run.start, plan.period, scenario.period_s)
    measured, expected = (paper.check(one, scenario, paper.attack) for one in (curves, simulated))
    partial, delays = sum(bool(entry.missing) for entry in entries), latencies_ms(entries)
    delay = statistics.median(delays) if delays else None
    caption = f"measured on DDS: {len(entries)} rounds, {partial} of them with a rater missing"
    written = write_paper(out, "figure", paper, {"measured": curves, "simulated": simulated}, scenario, caption)
    written += ["results.json", "journal.jsonl", "recording"]
    results = {
        "command": "roletrust live demo",
        "attack": plan.attack,
        "seconds": plan.seconds,
        "speed": plan.speed,
        "signed": plan.signed,
        "seed": plan.seed,
        "trust_model": describe(plan.model),
        "attackers": describe_policies(paper.policies),
        "rounds": len(entries),
        "partial_rounds": partial,
        "image_to_trust_ms": {"median": delay, "largest": max(delays, default=None)},
        "claims": [claim._asdict() for claim in measured],
        "claims_simulated": [claim._asdict() for claim in expected],
        "files": written,
    }
    write_json(out / "results.json", results)
    console.print(claims_table("Su and Saint-Jore (2023), on DDS, seen through OpenCV's HOG people detector", measured))
    console.print("[dim]simulated: " + "; ".join(f"{claim.what} {claim.measured}" for claim in expected) + "[/]")
    console.print(f"[dim]{caption}; image to trust {delay or float('nan'):.0f} ms at the median[/]", soft_wrap=True)
    console.print(f"Written to {out}: {', '.join(written)}", soft_wrap=True)
