"""Every way to attack a task, from honest play to the optimum, in one table and one picture."""

from collections.abc import Sequence
from functools import partial
from math import ceil
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.markup import escape
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn

from roletrust_baselines.search import CmaEs, GridSearch, PaperAttacks, RandomSearch
from roletrust_env import make_scenario
from roletrust_env.envs.attack_env import TASKS
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.measurement import TaskArguments, exact_task, task_memory
from roletrust_env.evaluation.resources import check_memory
from roletrust_env.evaluation.scripts import Scripts
from roletrust_env.evaluation.search import Budget, HonestPlay, MeasuredSearch, SearchMethod, UnsuitableError, find
from roletrust_env.evaluation.specs import parse_kinds, parse_settings, parse_trust_model
from roletrust_env.storage.files import prepare_folder, write_csv, write_json
from roletrust_env.storage.provenance import provenance
from roletrust_experiments.commands.console import (
    FittedTable,
    console,
    number_table,
    option,
    print_next,
    progress_bar,
)
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import (
    Compromised,
    ModelOption,
    Out,
    ScenarioOption,
    Seed,
    SettingsOption,
    StealthTolerance,
    StealthWeight,
    Task,
    find_task,
    task_options,
)
from roletrust_experiments.plots.figure_files import write_figure
from studies.ladder.rows import HEADER, Row, compared, lines, ranked, summary, top, wins
from studies.ladder.trajectory import Trajectory, watch
from studies.options import NamedAttacks
from studies.running import run


def ladder(
    task: Task,
    scenario: ScenarioOption = None,
    settings: SettingsOption = None,
    model: ModelOption = "role-trust",
    compromised: Compromised = None,
    attack: NamedAttacks = None,
    stealth_weight: StealthWeight = 0.0,
    stealth_tolerance: StealthTolerance = 0.1,
    budget: Annotated[
        int, typer.Option(min=1, help="Rounds x games that each search method and the planner may play.")
    ] = 2_000_000,
    games: Annotated[int, typer.Option(min=2, help="Number of held-out games that measure each attack.")] = 100,
    seed: Seed = 0,
    runs: Annotated[int, typer.Option(min=1, help="Number of runs, with this seed and the seeds after it.")] = 1,
    learned: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="DIR",
            help="Folder written by `roletrust train`, with as many runs and the same seeds; repeat for more.",
            show_default=False,
        ),
    ] = None,
    out: Out = Path("results/ladder"),
) -> None:
    r"""Compare [bold]every way to attack a task[/], from honest play to the optimum.

    Each rung of the ladder looks for an attack with the same budget of game rounds. All attacks are then measured in
    the same held-out games. The score is the mean reward per round with its 95% confidence interval, over the runs or,
    for a single run, over its games. The [bold]share[/] is 0 for honest play. It is 1 for the exact optimum, for a
    proven bound, or for the best attack found where neither is known.

    scripted: on-off and bad-mouthing, as in the paper and as the best of a grid, or the attacks of --attack.

    random search, CMA-ES: over the parameters that the scripted attacks declare.

    universal, evolution: coalitions as one mind, ready ones of the project, and one that evolves for this task.

    white-box planner: follows the gradient through the game. learned: the attackers of --learned.

    exact: dynamic programming, for one provider (exploit, no stealth) in a game without randomness.

    best known: planned lies, for raters (damage) in a game without randomness; for one rater with a bound that no
    attack exceeds.

    Written: [green]ladder.png ladder.csv ladder.json[/], and [green]trajectories.csv[/] of the best attack and the best
    scripted attack.

    [bold]Examples[/]

    [dim]# a known optimum: a provider that sells bad service while it is trusted[/]
    [cyan]python -m studies.ladder ProviderAttack --set noise=0 --set 'perturbations=\[]' --set max_cycles=200[/]

    [dim]# a rater that must not be detected[/]
    [cyan]python -m studies.ladder RaterAttack --stealth-weight 2 --set noise=0 --set 'perturbations=\[]'[/]

    [dim]# the best of three lies and its parameters[/]
    [cyan]python -m studies.ladder RaterAttack --attack bad-mouthing --attack flip-flop --attack rep-trap[/]

    [dim]# three colluders in a crowd, with learned attackers, in five runs[/]
    [cyan]roletrust train CollusionAttack --stealth-weight 2 --runs 5 --out results/colluders[/]
    [cyan]python -m studies.ladder CollusionAttack --stealth-weight 2 --runs 5 --learned results/colluders[/]
    """
    require("the ladder", "train", "torch", "scipy", "cma", "safetensors")
    from roletrust_agents.learned.methods import learned_methods
    from roletrust_agents.planning.optimum import BestKnown, Exact
    from roletrust_agents.planning.planner import Planner
    from roletrust_agents.training.coalition_methods import EvolutionSearch
    from roletrust_agents.training.universal import Universal

    task_id = find_task(task)
    defaults = TASKS[task_id].defaults
    rules = make_scenario(scenario or defaults["scenario"])
    if changes := parse_settings(settings or []):
        rules = rules.change(**changes)
    arguments = {
        **defaults,
        "scenario": rules,
        "trust_model": parse_trust_model(model, rules),
        "compromised": tuple(compromised or defaults["compromised"]),
        "stealth": {"weight": stealth_weight, "tolerance": stealth_tolerance},
    }
    kinds = parse_kinds(attack, rules) if attack else None
    Scripts.of(exact_task(arguments), kinds)  # an attack that does not fit is refused before the games
    scripted: list[SearchMethod] = [rung(attacks=kinds) for rung in (PaperAttacks, GridSearch, RandomSearch, CmaEs)]
    searches: list[SearchMethod] = [HonestPlay(), *scripted, Universal(), EvolutionSearch(), Planner()]
    paths = learned or []
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
        "command": "python -m studies.ladder",
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
    shared = task_options(scenario, settings, model, compromised, stealth_weight, stealth_tolerance)
    if learned:
        print_next("benchmark", option("--model", model))
    else:
        print_next(
            "train", task, shared, option("--seed", seed, 0), option("--runs", runs, 1), "--out", f"{out}-learned"
        )


def climb(
    ladders: Sequence[Sequence[SearchMethod]], arguments: TaskArguments, budget: int, seed: int, games: int
) -> tuple[list[list[MeasuredSearch]], dict[str, str]]:
    """Run every rung.

    Args:
        ladders: The same rungs for each run.
        arguments: Arguments of the task.
        budget: Budget of each search.
        seed: Seed of the first run; each later run has the next one.
        games: Number of held-out games that measure each attack.

    Returns:
        The results of each rung in each run, and the reasons why some rungs do not apply.
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
    from studies.ladder.figure import ladder_figure

    write_csv(out / "ladder.csv", HEADER, lines(rows, seed))
    write_csv(out / "trajectories.csv", Trajectory.header, [line for t in trajectories for line in t.lines()])
    write_figure(out / "ladder.png", ladder_figure(about, rows, trajectories))
    write_json(out / "ladder.json", results)


def _run_name(row: Row, seed: int) -> str:
    """Return the name of the best run of a rung. The first run has the given seed."""
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


def _table(about: str, rows: Sequence[Row]) -> FittedTable:
    runs = len(rows[0].runs)
    score, what = top(rows)
    over = f"over {runs} runs" if runs > 1 else "over the held-out games"
    caption = f"share: 0 is honest play, 1 is {what}, {score:.4f}; ± half the 95% interval {over}, rounded up"
    table = number_table(about, caption, "score", "share", "rounds", "seconds")
    best = max(row.score for row in rows)
    for row in rows:
        mean = f"{row.score:.4f}" + (f"±{ceil(row.half * 1e4) / 1e4:.4f}" if row.half > 0 else "")
        share = "" if np.isnan(row.share) else f"{row.share:.3f}"
        rounds = max(run.rounds for run in row.runs)
        seconds = float(np.mean([run.seconds for run in row.runs]))
        style = "bold dark_orange3" if row.score == best else None
        table.add_row(escape(row.name), mean, share, f"{rounds:,}" if rounds else "-", f"{seconds:.1f}", style=style)
    return table


def _wins(rows: Sequence[Row]) -> FittedTable:
    """Return a table of the runs in which each rung scored more than each other rung."""
    title = f"Number of the {len(rows[0].runs)} runs, seed by seed, in which the row scored more than the column"
    table = number_table(title, "", *map(str, range(1, len(rows) + 1)))
    for number, (row, counts) in enumerate(zip(rows, wins(rows), strict=True), start=1):
        beaten = ["" if k + 1 == number else str(count) for k, count in enumerate(counts)]
        table.add_row(escape(f"{number} {row.name}"), *beaten)
    return table


if __name__ == "__main__":
    run(ladder)
