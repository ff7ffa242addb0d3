"""`roletrust live demo`: the paper's three robots on this machine."""

import statistics
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from experiments.commands.console import claims_table, console, progress_bar
from experiments.commands.live.options import Speed, period_ns, require_live
from experiments.commands.live.processes import Processes
from experiments.results.files import cast_list, described, prepare_folder, write_json
from experiments.results.journals import curves_of, latencies_ms
from experiments.results.papers import Paper, papers
from roletrust_env import Policy, Scenario, make_scenario
from roletrust_env.live.journal import Entry, read_journal
from roletrust_env.live.standing import Team
from roletrust_env.trust import make_trust_model
from roletrust_env.world.roster import Roster

_MEET_S = 4.0  # in which nodes find each other, also on a busy machine
_LOOK_S = 0.25
_AFTER = 4  # periods in which the last rounds come in


def demo(
    attack: Annotated[
        Literal["on-off", "bad-mouthing"], typer.Option(help="Of the paper's Figure 3, or of its Figure 4.")
    ] = "bad-mouthing",
    speed: Speed = 1.0,
    out: Annotated[Path, typer.Option(help="Folder for the results; it is made if need be.")] = Path("results/live"),
    signed: Annotated[bool, typer.Option("--signed/--unsigned", help="Whether raters have keys.")] = True,
    seed: Annotated[int, typer.Option(min=0, help="Of the noise in pictures and on links.")] = 0,
) -> None:
    """Run the paper's [bold]three robots[/]: three cameras, three raters and the manager, seven processes on DDS.

    It takes two minutes, or fewer with --speed, and ends with the paper's figure as it was measured, and with what the
    paper says of it. Any ROS 2 on this machine sees the nodes, the topics and the types meanwhile.

    Written: [green]journal.jsonl figure.csv figure.png results.json[/], and [green]keys[/].

    [bold]Examples[/]

    [dim]# the paper's Figure 4, in two minutes[/]
    [cyan]roletrust live demo --attack bad-mouthing[/]

    [dim]# Figure 3, three times as fast[/]
    [cyan]roletrust live demo --attack on-off --speed 3[/]
    """
    require_live()
    scenario = make_scenario("paper-3x3")
    paper = papers(scenario.period_s)[0 if attack == "on-off" else 1]
    prepare_folder(out)
    journal, period = out / "journal.jsonl", period_ns(scenario.period_s, speed)
    journal.unlink(missing_ok=True)
    start = _run(scenario, paper.policies, journal, out / "keys" if signed else None, period, seed)
    entries = list(read_journal(journal))
    _tell(out, paper, scenario, entries, start, period, {"speed": speed, "signed": signed, "seed": seed})


def _run(
    scenario: Scenario, policies: Mapping[str, Policy], journal: Path, keys: Path | None, period: int, seed: int
) -> int:
    """Run the team to the scenario's end, and return when its round 0 began."""
    from roletrust_env.live.nodes.assess import run_assess
    from roletrust_env.live.nodes.cam import run_cam
    from roletrust_env.live.nodes.manage import run_manager
    from roletrust_env.live.nodes.running import SECOND, Timeline
    from roletrust_env.live.wire.keys import make_keys

    roster = Roster.of(scenario)
    team = Team(roster.rater_names, roster.provider_names)
    model = make_trust_model("role-trust", lam=scenario.lam, initial=scenario.initial_trust)
    if keys is not None:
        make_keys(keys, team.raters)
    with Processes() as nodes, progress_bar() as progress:
        task = progress.add_task("Starting seven nodes", total=None)
        nodes.start("manager", run_manager, model=model, journal=journal, period=period, team=team, keys=keys)
        for name in team.raters:
            policy = policies.get(name)
            nodes.start(name, run_assess, name=name, scenario=scenario, policy=policy, keys=keys, seed=seed)
        for name in team.providers:
            nodes.start(name, run_cam, name=name, scenario=scenario, policy=policies.get(name), seed=seed)
        nodes.begin("manager")
        start = time.time_ns() + round(_MEET_S * SECOND)
        nodes.begin(*team.raters, *team.providers, timeline=Timeline(start, period))
        progress.update(task, description="Rounds", total=scenario.max_cycles)
        while nodes.running(*team.providers):
            nodes.check()
            progress.update(task, completed=_rounds(journal))
            time.sleep(_LOOK_S)
        time.sleep(_AFTER * period / SECOND)
        nodes.check()
    return start


def _rounds(journal: Path) -> int:
    """How many rounds there are so far."""
    return sum(1 for _ in read_journal(journal)) if journal.exists() and journal.stat().st_size else 0


def _tell(
    out: Path, paper: Paper, scenario: Scenario, entries: list[Entry], start: int, period: int, options: dict[str, Any]
) -> None:
    """Write and print what was measured."""
    from experiments.plots.paper import write_paper

    curves = curves_of(entries, start, period, scenario.period_s)
    found = paper.check(curves, scenario, paper.attack)
    partial, delays = sum(bool(entry.missing) for entry in entries), latencies_ms(entries)
    note = f"measured on DDS: {len(entries)} rounds, {partial} of them without somebody"
    written = ["journal.jsonl", *write_paper(out, "figure", paper, curves, scenario, note), "results.json"]
    delay = statistics.median(delays)
    results = {
        "command": "roletrust live demo",
        **options,
        "trust_model": described(make_trust_model("role-trust", lam=scenario.lam, initial=scenario.initial_trust)),
        "attackers": cast_list(paper.policies),
        "rounds": len(entries),
        "partial_rounds": partial,
        "image_to_trust_ms": {"median": delay, "largest": max(delays)},
        "claims": [claim._asdict() for claim in found],
        "files": written,
    }
    write_json(out / "results.json", results)
    console.print(claims_table("Su and Saint-Jore (2023), on DDS, seen through OpenCV's HOG people detector", found))
    console.print(f"[dim]{note}; image to trust {delay:.0f} ms at the median[/]", soft_wrap=True)
    console.print(f"Written to {out}: {', '.join(written)}", soft_wrap=True)
