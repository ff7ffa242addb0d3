"""`roletrust benchmark`: how robust trust models are, by the worst of all attacks; and which
learner attacks best.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from roletrust_env.benchmarking import benchmark as benchmark_models
from roletrust_env.benchmarking import cost
from roletrust_env.benchmarking.leaderboard import Leaderboard
from roletrust_env.benchmarking.learner_board import LearnerBoard
from roletrust_env.benchmarking.learners.suite import LearnersSuite
from roletrust_env.benchmarking.pool import cores
from roletrust_env.benchmarking.run import (
    benchmark_learners,
    check_suite_installed,
    selected_suite,
)
from roletrust_env.benchmarking.suite import Suite, with_search
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_env.evaluation.attackers import Attacker
from roletrust_env.evaluation.resources import in_time
from roletrust_env.evaluation.specs import parse_parameters
from roletrust_experiments.commands.console import (
    ALLOW_CODE,
    console,
    number_table,
    tell,
)
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import NAMED, OWN, Out, Workers
from roletrust_experiments.plots.figure_files import write_figure


def benchmark(
    name: Annotated[
        list[str] | None,
        typer.Argument(
            metavar=f"[{NAMED}]...",
            help=(
                "Trust models; `all` means those of the suite. Without one the published "
                f"leaderboard is shown. {OWN} A program is exec:COMMAND, a service its URL. Of a "
                "suite for learners, its learners; without one all."
            ),
        ),
    ] = None,
    suite: Annotated[
        str,
        typer.Option(
            help=(
                "Suite to play: standard, quick (to try things), learners, learners-quick, or the "
                "path of a .toml file."
            )
        ),
    ] = "standard",
    search: Annotated[
        bool, typer.Option("--search", help="Also search for attacks: hours instead of minutes.")
    ] = False,
    attack: Annotated[
        list[str] | None,
        typer.Option(
            metavar=NAMED,
            help=(
                "Attack instead of those of the suite; repeat for more. "
                f"learned:path=DIR is a coalition that `roletrust train` has trained. {OWN}"
            ),
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Random seed of other worlds than the published ones.")
    ] = None,
    workers: Workers = None,
    allow_code: Annotated[bool, typer.Option("--allow-code", help=ALLOW_CODE)] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only estimate the time.")] = False,
    out: Out = Path("results/benchmark"),
) -> None:
    r"""Find out [bold]where your trust model stands[/] when some raters and providers lie.

    Consumers choose a provider in each round by the trust of the model, receive its service, and
    report on it. The [bold]skill score[/] is 1 if they always get the best honest provider, 0 for
    chance. Each model is attacked in several settings (compromised roles, their share, who may
    report). The worst attack of a setting is chosen in some worlds and measured in others. By
    default all scripted attacks of the suite are played, in some minutes, and your model is shown
    next to the published ones. [bold]--search[/] adds a search for attacks, which lowers scores.

    A suite for [bold]learners[/] combines tasks, learners, budgets of rounds and seeds. The share
    of a learner on a task is 0 for honest play, and 1 for the optimum or the best known attack.
    Written: [green]learners.csv learners.md learners.png[/].

    The result of each cell is saved in [green]results.sqlite[/] as soon as it is complete, so that
    an interrupted command continues when it is given again. Written at the end:
    [green]leaderboard.csv leaderboard.md worst_cases.csv[/]; `roletrust report` makes a page of the
    results. If a cell fails, the others count, and the exit code is 1.

    [bold]Examples[/]

    [dim]# the published leaderboard, at once[/]
    [cyan]roletrust benchmark[/]

    [dim]# your own model next to the published ones, in some minutes[/]
    [cyan]roletrust benchmark mypackage.mymodel:MyModel[/]

    [dim]# the time that the whole leaderboard takes[/]
    [cyan]roletrust benchmark all --search --dry-run[/]

    [dim]# your own learner beside PPO, in one or two minutes[/]
    [cyan]roletrust benchmark --suite learners-quick mypackage.mine:MyLearner PPO[/]
    """
    loaded = load_suite(suite, seed)
    if name or isinstance(loaded, LearnersSuite):
        require("the benchmark", "train", "scipy", "cma", "torch", "stable_baselines3")
        if not allow_code:
            check_suite_installed(loaded)
    if isinstance(loaded, LearnersSuite):
        if attack or search:
            raise ValueError(f"suite {loaded.name} is for learners, which are the attacks")
        if dry_run:
            names = loaded.learners if not name or "all" in name else name
            rounds = cost.learner_rounds(loaded)
            tell(f"{', '.join(names)}: at the most {rounds:,} rounds each, over all games")
        else:
            _end(benchmark_learners(name, loaded, workers=workers, out=out), out)
        return
    models = [part for each in name or [] for part in (loaded.models if each == "all" else [each])]
    scripts, trained = _attackers(attack or ())
    if dry_run:
        asked = with_search(loaded) if search else loaded
        _show_cost(selected_suite(asked, models, scripts, trained), workers)
        return
    board = benchmark_models(
        models or None,
        loaded,
        attacks=scripts or None,
        attackers=trained,
        search=search,
        workers=workers,
        out=out if models else None,
    )
    console.print(escape(repr(board)), soft_wrap=True)
    searched = "These attacks are not searched. A search (--search) may lower the scores."
    tell(board.convergence if search else searched)
    if models:
        _end(board, out)


def _end(board: Leaderboard | LearnerBoard, out: Path) -> None:
    """Print what was written; with exit code 1 if a cell failed."""
    if isinstance(board, LearnerBoard):
        from roletrust_experiments.plots.learners import learners_figure

        figure = learners_figure(board.suite.title, board.results, board.scales)
        write_figure(out / "learners.png", figure, colours=256)
        (rounds, heading, *tasks), rows = board.table()
        table = number_table(board.suite.title, escape(board.legend), *tasks, rounds, name=heading)
        for count, learner, *shares in rows:
            table.add_row(escape(learner), *shares, count)
        console.print(table)
        for key, why in board.unsuitable.items():
            tell(f"{key}: {why}", "dim")
        written = "learners.csv, learners.md, learners.png"
    else:
        written = "leaderboard.csv, leaderboard.md, worst_cases.csv"
    tell(f"Written to {out}: results.sqlite, {written}")
    if board.failed:
        raise typer.Exit(1)


def _attackers(names: Sequence[str]) -> tuple[list[str], dict[str, Attacker]]:
    """Return the scripted attacks among attacks, and the trained coalitions by name."""
    scripts, trained = list[str](), dict[str, Attacker]()
    for text in dict.fromkeys(names):
        if text.startswith("learned:"):
            from roletrust_agents.learned import coalition_of

            parameters = parse_parameters(text)[1]
            if parameters.keys() != {"path"}:
                raise ValueError(f"--attack is {text}; a trained attacker is learned:path=DIR")
            trained[text] = coalition_of(str(parameters["path"]))
        else:
            scripts.append(text)
    return scripts, trained


def _show_cost(suite: Suite, workers: int | None) -> None:
    """Print the estimated time of each trust model."""
    cells = suite.cells()
    seconds = cost.estimate_seconds(suite, cells)
    caption = "time of one core, estimated from a short trial, too long on a busy machine"
    table = number_table(f"{suite.name}, estimated", caption, "cells", "time")
    for model in suite.model_names:
        keys = [cell.key for cell in cells if cell.model == model]
        table.add_row(escape(model), f"{len(keys):,}", in_time(sum(seconds[key] for key in keys)))
    console.print(table)
    total, number = sum(seconds.values()), workers or cores()
    tell(f"In all about {in_time(total)} of one core, {in_time(total / number)} on {number}.")
