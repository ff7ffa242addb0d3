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
from roletrust_env.storage.provenance import describe_policies, described
from roletrust_experiments.commands.console import claims_table, console, progress_bar
from roletrust_experiments.commands.live.options import Browser, Port, Speed, require_live
from roletrust_experiments.commands.live.team import Lived, Plan, run_team
from roletrust_experiments.commands.live.view import address, require_view
from roletrust_experiments.identification.journals import curves_of, latencies_ms
from roletrust_experiments.paper.figures import Attack
from roletrust_experiments.playing.tracked import track_curves

_YIELDS = 19  # of the simulation to the robots, as `nice` has it


def demo(
    attack: Annotated[Attack, typer.Option(help="Of the paper's Figure 3, or of its Figure 4.")] = "bad-mouthing",
    seconds: Annotated[
        float, typer.Option(help="When it ends, by the paper's clock; from 20 s after the attack's start on.")
    ] = 120.0,
    speed: Speed = 1.0,
    out: Annotated[Path, typer.Option(help="Folder for the results; it is made if need be.")] = Path("results/live"),
    signed: Annotated[bool, typer.Option("--signed/--unsigned", help="Whether raters have keys.")] = True,
    view: Annotated[bool, typer.Option("--view/--no-view", help="Whether there is a page to watch it on.")] = True,
    port: Port = 5006,
    browser: Browser = True,
    seed: Annotated[int, typer.Option(min=0, help="Of the noise in pictures and on links.")] = 0,
) -> None:
    """Run the paper's [bold]three robots[/]: three cameras, three raters and the manager, seven processes on DDS.

    It takes two minutes, or fewer with --speed. Meanwhile a page in the browser shows the curves, the cameras' pictures
    and who is missing, and any ROS 2 on this machine sees the nodes, the topics and the types. It ends with the paper's
    figure as it was measured, beside the same run simulated, and with what the paper says of it.

    Written: [green]figure.png figure.csv figure-simulated.csv results.json[/]; [green]journal.jsonl[/], by the manager;
    [green]recording[/], all that was said but the pictures; and [green]keys[/].

    [bold]Examples[/]

    [dim]# the paper's Figure 4, in two minutes[/]
    [cyan]roletrust live demo --attack bad-mouthing[/]

    [dim]# Figure 3, three times as fast, and no page[/]
    [cyan]roletrust live demo --attack on-off --speed 3 --no-view[/]
    """
    (require_view if view else require_live)()
    plan = Plan(attack, seconds, speed, signed, seed)
    if view:
        from roletrust_experiments.view.server import check_port

        check_port(port)
    prepare_folder(out)
    with multiprocessing.get_context("spawn").Pool(1, os.nice, (_YIELDS,)) as aside, progress_bar() as progress:
        simulation = aside.apply_async(_simulated, (plan,))
        if view:
            console.print(f"Watch it on {address(port)}", soft_wrap=True)
        if view and browser:
            webbrowser.open(address(port))
        lived = run_team(plan, out, port if view else None, progress)
        progress.add_task("Waiting for the simulation", total=None)
        simulated = simulation.get()
    _tell(plan, lived, simulated, out)


def _simulated(plan: Plan) -> Curves:
    """The same run without robots."""
    with progress_bar() as progress:
        progress.disable = True
        return track_curves(JointPolicy(Game(plan.scenario), plan.paper.policies), plan.seed, progress, "")


def _tell(plan: Plan, lived: Lived, simulated: Curves, out: Path) -> None:
    """Write and print what was measured."""
    from roletrust_experiments.plots.paper import write_paper

    paper, scenario, entries = plan.paper, plan.scenario, lived.entries
    curves = curves_of([entry.published for entry in entries], lived.start, plan.period, scenario.period_s)
    found, expected = (paper.check(run, scenario, paper.attack) for run in (curves, simulated))
    partial, delays = sum(bool(entry.missing) for entry in entries), latencies_ms(entries)
    delay = statistics.median(delays) if delays else None
    note = f"measured on DDS: {len(entries)} rounds, {partial} of them without somebody"
    written = write_paper(out, "figure", paper, {"measured": curves, "simulated": simulated}, scenario, note)
    written += ["results.json", "journal.jsonl", "recording"]
    results = {
        "command": "roletrust live demo",
        "attack": plan.attack,
        "seconds": plan.seconds,
        "speed": plan.speed,
        "signed": plan.signed,
        "seed": plan.seed,
        "trust_model": described(plan.model),
        "attackers": describe_policies(paper.policies),
        "rounds": len(entries),
        "partial_rounds": partial,
        "image_to_trust_ms": {"median": delay, "largest": max(delays, default=None)},
        "claims": [claim._asdict() for claim in found],
        "claims_simulated": [claim._asdict() for claim in expected],
        "files": written,
    }
    write_json(out / "results.json", results)
    console.print(claims_table("Su and Saint-Jore (2023), on DDS, seen through OpenCV's HOG people detector", found))
    console.print("[dim]simulated: " + "; ".join(f"{claim.what} {claim.measured}" for claim in expected) + "[/]")
    console.print(f"[dim]{note}; image to trust {delay or float('nan'):.0f} ms at the median[/]", soft_wrap=True)
    console.print(f"Written to {out}: {', '.join(written)}", soft_wrap=True)
