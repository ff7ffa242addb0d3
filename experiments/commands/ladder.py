"""`roletrust ladder`: every way to attack a task, from honest play to the optimum, in one table and one picture."""

from collections.abc import Sequence
from math import ceil
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from agents.ladder.known import HonestPlay, Learned
from agents.ladder.rungs import Arguments, Finding, Rung, UnsuitableError, exact_task, find
from baselines.search import CmaEs, Grid, PaperAttacks, RandomSearch
from experiments.commands.attacks import parse_settings, parse_trust_model
from experiments.commands.console import console
from experiments.commands.extras import require
from experiments.commands.task_options import (
    ScenarioOption,
    SettingsOption,
    StealthTolerance,
    StealthWeight,
    TrustModelOption,
    find_task,
)
from experiments.plots.trajectory import Trajectory, watch
from experiments.results.files import prepare_folder, provenance, write_csv, write_figure, write_json
from experiments.results.ladder import HEADER, Row, cells, compared, plain, ranked
from roletrust_env import make_scenario
from roletrust_env.envs.tasks import TASKS


def ladder(
    task: Annotated[str, typer.Argument(help="ProviderAttack, RaterAttack, DualAttack or CollusionAttack.")],
    scenario: ScenarioOption = None,
    settings: SettingsOption = None,
    trust_model: TrustModelOption = "role-trust",
    compromised: Annotated[
        list[str] | None, typer.Option(metavar="AGENT", help="Who is controlled; repeat for more.", show_default=False)
    ] = None,
    stealth_weight: StealthWeight = 0.0,
    stealth_tolerance: StealthTolerance = 0.1,
    budget: Annotated[
        int, typer.Option(min=1, help="Rounds x games that each searcher and the planner may play.")
    ] = 2_000_000,
    seeds: Annotated[int, typer.Option(min=2, help="Held-out games in which each attack is measured.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Of all luck; the same seed gives the same scores.")] = 0,
    learned: Annotated[
        list[Path] | None,
        typer.Option(metavar="DIR", help="A folder of `roletrust train`; repeat for more.", show_default=False),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the results; it is made if need be.")] = Path("results/ladder"),
) -> None:
    r"""Climb from [bold]honest play to the best possible attack[/] on a task, and see what it does.

    Each rung looks for an attack with the same budget of game rounds; then all are measured in the same
    held-out games. The score is the mean reward per round, with its 95% confidence interval.
    Its [bold]share[/] is 0 for honest play and 1 for the exact optimum, or the best found where none is known.

    scripted: on-off and bad-mouthing, as in the paper and the best of a grid.
    random search, CMA-ES: over the scripted attackers' parameters.
    white-box planner: follows the gradient through the game. learned: --learned.
    exact: dynamic programming, for one provider (exploit, no stealth) or raters with one lie
    for all providers (damage), and only where nothing is left to chance.

    Written: [green]ladder.png ladder.csv ladder.json[/], and [green]trajectories.csv[/] of the best attack and
    the scripted one.

    [bold]Examples[/]

    [dim]# where the optimum is known: a provider that sells bad service on good trust[/]
    [cyan]roletrust ladder ProviderAttack --set noise=0 --set 'perturbations=\[]' --set max_cycles=200[/]

    [dim]# a rater that must not be told apart[/]
    [cyan]roletrust ladder RaterAttack --stealth-weight 2 --set noise=0 --set 'perturbations=\[]'[/]

    [dim]# three colluders in a crowd, and what a trained attacker reaches there[/]
    [cyan]roletrust ladder CollusionAttack --stealth-weight 2 --learned results/train[/]
    """
    require("the ladder", "train", "torch", "scipy", "cma", "safetensors")
    from agents.learned.saved import load_attacker
    from agents.planning.optimum import Exact
    from agents.planning.planner import Planner

    task_id = find_task(task)
    defaults = TASKS[task_id].defaults
    rules = make_scenario(scenario or defaults["scenario"])
    if changes := parse_settings(settings or []):
        rules = rules.change(**changes)
    arguments = {
        **defaults,
        "scenario": rules,
        "trust_model": parse_trust_model(trust_model, rules),
        "compromised": tuple(compromised or defaults["compromised"]),
        "stealth": {"weight": stealth_weight, "tolerance": stealth_tolerance},
    }
    rungs: list[Rung] = [HonestPlay(), PaperAttacks(), Grid(), RandomSearch(), CmaEs(), Planner()]
    paths = learned or []
    for path in paths:
        load_attacker(path)  # what is broken is better known now than at the end
    rungs += [Learned(path, f"learned, {path.name}" if len(paths) > 1 else "learned") for path in paths]
    prepare_folder(out)
    found, missing = climb([*rungs, Exact()], arguments, budget, seed, seeds)
    rows = ranked(found)
    scripted, best = compared(rows)
    trajectories = [watch(arguments, row.finding, seed) for row in (scripted, best)]
    about = f"{task_id.removeprefix('RoleTrust/')}, {rules.name}, {defaults['objective']}"
    if stealth_weight:
        about += f" less {stealth_weight:g} x gap over {stealth_tolerance:g}"
    game = exact_task(arguments).game
    results = {
        "command": "roletrust ladder",
        "task": task_id,
        **provenance(game, seed),
        "compromised": list(arguments["compromised"]),
        "objective": defaults["objective"],
        "stealth": arguments["stealth"],
        "budget": budget,
        "held_out_games": seeds,
        "rungs": [dict(zip(HEADER, plain(cells(row)), strict=True)) for row in rows],
        "not_applicable": missing,
    }
    _write(out, about, rows, trajectories, results)
    console.print(_table(about, rows))
    for row in rows:
        console.print(f"[dim]{escape(row.finding.name)}: {escape(row.finding.words)}[/]", soft_wrap=True)
    for name, why in missing.items():
        console.print(f"[dim]{escape(name)}: {escape(why)}[/]", soft_wrap=True)
    if any(row.finding.name == "exact" and row.share < best.share for row in rows):
        console.print("[dim]above 1: the exact optimum is that of one lie for all providers[/]", soft_wrap=True)
    console.print(f"Written to {out}: ladder.png, ladder.csv, ladder.json, trajectories.csv", soft_wrap=True)


def climb(
    rungs: Sequence[Rung], arguments: Arguments, budget: int, seed: int, seeds: int
) -> tuple[list[Finding], dict[str, str]]:
    """What the rungs find, and why some do not apply."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    found, missing = [], {}
    with Progress(*columns, console=console, transient=True) as progress:
        for rung in rungs:
            job = progress.add_task(rung.name, total=budget)
            try:
                tell = lambda rounds, job=job: progress.advance(job, rounds)  # noqa: E731
                found.append(find(rung, arguments, budget=budget, seed=seed, games=seeds, tell=tell))
            except UnsuitableError as error:
                missing[rung.name] = str(error)
            progress.update(job, completed=budget)
    return found, missing


def _write(
    out: Path, about: str, rows: Sequence[Row], trajectories: Sequence[Trajectory], results: dict[str, Any]
) -> None:
    from experiments.plots.ladder import ladder_figure

    write_csv(out / "ladder.csv", HEADER, [cells(row) for row in rows])
    write_csv(out / "trajectories.csv", Trajectory.header, [line for t in trajectories for line in t.lines()])
    write_figure(out / "ladder.png", ladder_figure(about, rows, trajectories))
    write_json(out / "ladder.json", results)


def _table(about: str, rows: Sequence[Row]) -> Table:
    top = "the exact optimum" if any(row.finding.name == "exact" for row in rows) else "the best that was found"
    table = Table(title=about, title_justify="left", title_style="bold", box=SIMPLE_HEAD, pad_edge=False)
    table.caption = f"share: 0 is honest play, 1 is {top}; ± half the 95% interval, rounded up"
    table.caption_justify = "left"
    table.add_column("rung", no_wrap=True)
    for name in ("score", "share", "rounds", "seconds"):
        table.add_column(name, justify="right", no_wrap=True)
    best = max(row.score for row in rows)
    for row in rows:
        score = f"{row.score:.4f}" + (f"±{ceil(row.half * 1e4) / 1e4:.4f}" if row.half > 0 else "")
        share = "" if np.isnan(row.share) else f"{row.share:.3f}"
        found = row.finding
        rounds = f"{found.rounds:,}" if found.rounds else "-"
        style = "bold dark_orange3" if row.score == best else None
        table.add_row(found.name, score, share, rounds, f"{found.seconds:.1f}", style=style)
    return table
