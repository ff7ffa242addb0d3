"""`roletrust ladder`: every way to attack a task, from honest play to the optimum, in one table and one picture."""

from collections.abc import Sequence
from functools import partial
from math import ceil
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table
from roletrust_baselines.search import CmaEs, Grid, PaperAttacks, RandomSearch

from roletrust_env import make_scenario
from roletrust_env.envs.tasks import TASKS
from roletrust_env.evaluation.attacked_games import TaskArguments, exact_task
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.resources import check_memory
from roletrust_env.evaluation.scripts import Scripts
from roletrust_env.evaluation.search import Budget, HonestPlay, MeasuredSearch, SearchMethod, UnsuitableError, find
from roletrust_env.evaluation.specs import parse_kinds, parse_settings, parse_trust_model
from roletrust_env.storage.files import prepare_folder, write_csv, write_json
from roletrust_env.storage.provenance import provenance
from roletrust_experiments.commands.console import console, progress_bar
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.task_options import (
    ScenarioOption,
    SettingsOption,
    StealthTolerance,
    StealthWeight,
    TrustModelOption,
    find_task,
)
from roletrust_experiments.ladder.rows import HEADER, Row, compared, lines, ranked, summary, top, wins
from roletrust_experiments.playing.games import task_memory
from roletrust_experiments.plots.figure_files import write_figure
from roletrust_experiments.plots.trajectory import Trajectory, watch


def ladder(
    task: Annotated[str, typer.Argument(help="ProviderAttack, RaterAttack, DualAttack or CollusionAttack.")],
    scenario: ScenarioOption = None,
    settings: SettingsOption = None,
    trust_model: TrustModelOption = "role-trust",
    compromised: Annotated[
        list[str] | None, typer.Option(metavar="AGENT", help="Who is controlled; repeat for more.", show_default=False)
    ] = None,
    attack: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[:key=value,...]",
            help="Which attack is tried and searched, those given by key=value aside; repeat for a mixture. "
            "By default on-off for providers and bad-mouthing for raters.",
            show_default=False,
        ),
    ] = None,
    stealth_weight: StealthWeight = 0.0,
    stealth_tolerance: StealthTolerance = 0.1,
    budget: Annotated[
        int, typer.Option(min=1, help="Rounds x games that each searcher and the planner may play.")
    ] = 2_000_000,
    games: Annotated[int, typer.Option(min=2, help="Held-out games in which each attack is measured.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Of all luck; the same seed gives the same scores.")] = 0,
    runs: Annotated[int, typer.Option(min=1, help="How often all is done, with this seed and the ones after it.")] = 1,
    learned: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="DIR",
            help="A folder of `roletrust train`, with as many runs and the same seeds; repeat for more.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the results; it is made if need be.")] = Path("results/ladder"),
) -> None:
    r"""Climb from [bold]honest play to the best possible attack[/] on a task, and see what it does.

    Each rung looks for an attack with the same budget of game rounds; then all are measured in the same
    held-out games. The score is the mean reward per round, with its 95% confidence interval: over the runs,
    or over the games of a single run. Its [bold]share[/] is 0 for honest play and 1 for the exact optimum,
    for a bound that is proven, or for the best found where neither is known.

    scripted: on-off and bad-mouthing, as in the paper and the best of a grid; or other attacks, --attack.
    random search, CMA-ES: over the parameters that the scripted attacks declare.
    white-box planner: follows the gradient through the game. learned: --learned.
    exact: dynamic programming, for one provider (exploit, no stealth), where nothing is left to chance.
    best known: lies that are planned, for raters (damage), where nothing is left to chance; for one rater
    with a bound that no attack exceeds.

    Written: [green]ladder.png ladder.csv ladder.json[/], and [green]trajectories.csv[/] of the best attack and
    the scripted one.

    [bold]Examples[/]

    [dim]# where the optimum is known: a provider that sells bad service on good trust[/]
    [cyan]roletrust ladder ProviderAttack --set noise=0 --set 'perturbations=\[]' --set max_cycles=200[/]

    [dim]# a rater that must not be told apart[/]
    [cyan]roletrust ladder RaterAttack --stealth-weight 2 --set noise=0 --set 'perturbations=\[]'[/]

    [dim]# which of three lies, and how?[/]
    [cyan]roletrust ladder RaterAttack --attack bad-mouthing --attack flip-flop --attack rep-trap[/]

    [dim]# three colluders in a crowd, and what learning reaches there, five times over[/]
    [cyan]roletrust train CollusionAttack --stealth-weight 2 --runs 5 --out results/colluders[/]
    [cyan]roletrust ladder CollusionAttack --stealth-weight 2 --runs 5 --learned results/colluders[/]
    """
    require("the ladder", "train", "torch", "scipy", "cma", "safetensors")
    from roletrust_agents.learned.methods import learned_methods
    from roletrust_agents.planning.optimum import BestKnown, Exact
    from roletrust_agents.planning.planner import Planner

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
    kinds = parse_kinds(attack, rules) if attack else None
    Scripts.of(exact_task(arguments), kinds)  # what does not fit is better known now
    scripted: list[SearchMethod] = [rung(attacks=kinds) for rung in (PaperAttacks, Grid, RandomSearch, CmaEs)]
    searches: list[SearchMethod] = [HonestPlay(), *scripted, Planner()]
    paths = learned or []
    # What is broken is better known now than at the end.
    trained = [
        learned_methods(path, range(seed, seed + runs), f"learned, {path.name}" if len(paths) > 1 else "learned")
        for path in paths
    ]
    prepare_folder(out)
    check_memory("--games", games, task_memory(exact_task(arguments), Scripted({})))
    ladders = [[*searches, *(rungs[run] for rungs in trained), Exact(), BestKnown()] for run in range(runs)]
    found, missing = climb(ladders, arguments, budget, seed, games)
    rows = ranked(found)
    trajectories = [
        watch(arguments, row.runs[row.best], seed + row.best, _run_name(row, seed)) for row in compared(rows)
    ]
    about = f"{task_id.removeprefix('RoleTrust/')}, {rules.name}, {defaults['objective']}"
    if stealth_weight:
        about += f" less {stealth_weight:g} x gap over {stealth_tolerance:g}"
    results = {
        "command": "roletrust ladder",
        "task": task_id,
        **provenance(exact_task(arguments).game, seed),
        "runs": runs,
        "compromised": list(arguments["compromised"]),
        "objective": defaults["objective"],
        "stealth": arguments["stealth"],
        "attacks": attack or [],
        "budget": budget,
        "held_out_games": games,
        "share_1": dict(zip(("score", "is"), top(rows), strict=True)),
        "rungs": summary(rows, seed),
        "not_applicable": missing,
    }
    _write(out, about, rows, seed, trajectories, results)
    _print(about, rows, seed, budget, missing)
    console.print(f"Written to {out}: ladder.png, ladder.csv, ladder.json, trajectories.csv", soft_wrap=True)


def climb(
    ladders: Sequence[Sequence[SearchMethod]], arguments: TaskArguments, budget: int, seed: int, games: int
) -> tuple[list[list[MeasuredSearch]], dict[str, str]]:
    """What the rungs find.

    Args:
        ladders: the same rungs for each run.
        arguments: of the task.
        budget: of each search.
        seed: of the first run; each run has the next one.
        games: held-out games in which each attack is measured.

    Returns:
        For each rung what it found in each run, and why some do not apply.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    found, missing = [], {}
    with progress_bar(columns=columns) as progress:
        for rungs in zip(*ladders, strict=True):
            job = progress.add_task(rungs[0].name, total=budget * len(rungs))
            try:
                found.append(
                    [
                        find(
                            rung,
                            arguments,
                            budget=Budget(budget, partial(progress.advance, job)),
                            seed=run,
                            games=games,
                        )
                        for run, rung in enumerate(rungs, start=seed)
                    ]
                )
            except UnsuitableError as error:
                missing[rungs[0].name] = str(error)
            progress.update(job, completed=budget * len(rungs))
    return found, missing


def _write(
    out: Path, about: str, rows: Sequence[Row], seed: int, trajectories: Sequence[Trajectory], results: dict[str, Any]
) -> None:
    from roletrust_experiments.plots.ladder import ladder_figure

    write_csv(out / "ladder.csv", HEADER, lines(rows, seed))
    write_csv(out / "trajectories.csv", Trajectory.header, [line for t in trajectories for line in t.lines()])
    write_figure(out / "ladder.png", ladder_figure(about, rows, trajectories))
    write_json(out / "ladder.json", results)


def _run_name(row: Row, seed: int) -> str:
    """What to call the best run of a rung, the first run having this seed."""
    return f"{row.name}, seed {seed + row.best}" if len(row.runs) > 1 and row.runs[0].rounds else row.name


def _print(about: str, rows: Sequence[Row], seed: int, budget: int, missing: dict[str, str]) -> None:
    runs = len(rows[0].runs)
    console.print(_table(about, rows))
    if runs > 1:
        console.print(_wins(rows))
    for row in rows:
        over = f"; more than the budget of {budget:,} rounds" if max(run.rounds for run in row.runs) > budget else ""
        console.print(
            f"[dim]{escape(_run_name(row, seed))}: {escape(row.runs[row.best].description)}{over}[/]", soft_wrap=True
        )
    for name, why in missing.items():
        console.print(f"[dim]{escape(name)}: {escape(why)}[/]", soft_wrap=True)


def _table(about: str, rows: Sequence[Row]) -> Table:
    runs = len(rows[0].runs)
    table = Table(title=about, title_justify="left", title_style="bold", box=SIMPLE_HEAD, pad_edge=False)
    score, what = top(rows)
    over = f"over {runs} runs" if runs > 1 else "over the held-out games"
    table.caption = f"share: 0 is honest play, 1 is {what}, {score:.4f}; ± half the 95% interval {over}, rounded up"
    table.caption_justify = "left"
    table.add_column("rung", no_wrap=True)
    for name in ("score", "share", "rounds", "seconds"):
        table.add_column(name, justify="right", no_wrap=True)
    best = max(row.score for row in rows)
    for row in rows:
        mean = f"{row.score:.4f}" + (f"±{ceil(row.half * 1e4) / 1e4:.4f}" if row.half > 0 else "")
        share = "" if np.isnan(row.share) else f"{row.share:.3f}"
        rounds = max(run.rounds for run in row.runs)
        seconds = float(np.mean([run.seconds for run in row.runs]))
        style = "bold dark_orange3" if row.score == best else None
        table.add_row(row.name, mean, share, f"{rounds:,}" if rounds else "-", f"{seconds:.1f}", style=style)
    return table


def _wins(rows: Sequence[Row]) -> Table:
    """Who beat whom."""
    title = f"In how many of {len(rows[0].runs)} runs, seed by seed, the row scored more than the column"
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("rung", no_wrap=True)
    for number in range(1, len(rows) + 1):
        table.add_column(str(number), justify="right")
    for number, (row, counts) in enumerate(zip(rows, wins(rows), strict=True), start=1):
        beaten = ["" if k + 1 == number else str(count) for k, count in enumerate(counts)]
        table.add_row(f"{number} {row.name}", *beaten)
    return table
