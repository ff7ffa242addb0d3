"""`roletrust benchmark`: how robust trust models are, by the worst of all attacks; and which learner attacks best."""

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from roletrust_env.benchmark.cells import attacks, cells, models
from roletrust_env.benchmark.command_line import command
from roletrust_env.benchmark.cost_estimate import estimate_cost
from roletrust_env.benchmark.learners.suite import LearnersSuite
from roletrust_env.benchmark.pool import LocalPool, Pool, cores
from roletrust_env.benchmark.result import Leaderboard
from roletrust_env.benchmark.run import play_suite, with_names
from roletrust_env.benchmark.schema import CellResult
from roletrust_env.benchmark.store import StoredCell
from roletrust_env.benchmark.suite import Suite, load_suite
from roletrust_env.benchmark.suite_types import AnySuite
from roletrust_env.evaluation.resources import in_time
from roletrust_env.evaluation.specs import check_installed
from roletrust_env.game.policy_registry import registry as attackers
from roletrust_env.storage.files import write_text
from roletrust_env.trust.model import registry as trust_models
from roletrust_experiments.commands.console import ALLOW_CODE, console, errors, number_table, progress_bar
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.leaderboard import leaderboard_markdown, leaderboard_table
from roletrust_experiments.commands.learners import asked_learners, tell_learners, tell_learners_cost


def benchmark(
    suite: Annotated[
        str, typer.Option(help="quick, standard, full, learners, learners-quick, or the path of a .toml file.")
    ] = "quick",
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[:key=value,...]",
            help="Trust model instead of the suite's; repeat for more, `all` are those that are installed. NAME may be "
            "your own package.module:Class.",
            show_default=False,
        ),
    ] = None,
    attack: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[:key=value,...]",
            help="Scripted attack instead of the suite's; repeat for more, `all` are those that are installed.",
            show_default=False,
        ),
    ] = None,
    learner: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[:key=value,...]",
            help="In a suite for learners: a learner instead of the suite's; repeat for more, `all` are the suite's. "
            "NAME may be your own package.module:Class.",
            show_default=False,
        ),
    ] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; by default one for each core.")] = None,
    ray: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Play on a Ray cluster instead, such as 10.0.0.1:6379, or auto for one on this machine; the results "
            "are the same.",
            show_default=False,
        ),
    ] = None,
    allow_code: Annotated[bool, typer.Option("--allow-code", help=ALLOW_CODE)] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what it would take.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Begin anew, whatever --out holds.")] = False,
    out: Annotated[Path, typer.Option(help="Folder for the results; it is made if need be.")] = Path(
        "results/benchmark"
    ),
) -> None:
    r"""Attack [bold]every trust model with everything[/], and rank them by the worst case.

    A suite is models x scenarios x tracks x shares of compromised agents x ways to attack x seeds: all scripted
    attacks, searches over their parameters, PPO, and a planner that knows all and is told apart from them.
    [bold]Utility[/] is the quality that a consumer gets who always goes to the most trusted provider, over the best
    that there is. The [bold]worst case[/] of a condition is chosen in some games and measured in others; it is never
    less than choosing blindly brings. Models are ranked by its mean over all conditions.

    A suite for [bold]learners[/] is tasks x learners x budgets of rounds x seeds. A learner's share of a task is 0 for
    honest play and 1 for the optimum, a bound that is proven, or else the best that any of them found; all that count
    is what it plays in games that it has not seen. Written: [green]learners.csv learners.png[/].

    Results are kept as they come, in [green]results.sqlite[/]; killed at any moment, the same command goes on.
    Written at the end: [green]leaderboard.csv leaderboard.md[/]; `roletrust report` makes pages to look at. Where a
    cell failed, the others count, and the exit code is 1.

    [bold]Examples[/]

    [dim]# some minutes: all models, all scripts and a small search, in a small market[/]
    [cyan]roletrust benchmark[/]

    [dim]# what would the standard suite take?[/]
    [cyan]roletrust benchmark --suite standard --dry-run[/]

    [dim]# your own model beside two others[/]
    [cyan]roletrust benchmark --model mypackage.mymodel:MyModel --model role-trust --model median[/]

    [dim]# your own learner beside PPO, in a minute or two[/]
    [cyan]roletrust benchmark --suite learners-quick --learner mypackage.mine:MyLearner --learner PPO[/]
    """
    require("the benchmark", "train", "scipy", "cma", "torch", "stable_baselines3")
    if ray is not None:
        require("--ray", "ray", "ray")
    asked = _asked(load_suite(suite), model, attack, learner, allow_code)
    if dry_run:
        _tell_cost(asked, workers)
        return
    try:
        with _pool(workers, ray) as pool:
            kept = _play(asked, pool, force, out)
    except KeyboardInterrupt:
        errors.print("Stopped; what is played is kept, and the same command goes on (without --force)", soft_wrap=True)
        raise typer.Exit(130) from None
    if isinstance(asked, LearnersSuite):
        tell_learners(asked, kept, out)
    else:
        _show(asked, kept, out)
    if any(done.failed for _, done in kept):
        raise typer.Exit(1)


def _play(suite: AnySuite, pool: Pool, force: bool, out: Path) -> list[StoredCell]:
    """Play the suite with a progress bar that begins with the cells that are stored already."""
    with progress_bar() as progress:
        job = progress.add_task(f"Playing {suite.name}")

        def begin(stored: int, total: int) -> None:
            progress.update(job, total=total, completed=stored)
            if stored:
                progress.console.print(f"[dim]{stored:,} of {total:,} cells are there already.[/]")

        def show(cell: Any, result: CellResult) -> None:
            progress.advance(job)
            if result.failed:
                progress.console.print(f"[red]{escape(cell.key)}: {escape(result.failed)}[/]", soft_wrap=True)

        return play_suite(suite, pool, out=out, force=force, on_start=begin, on_cell=show)


def _show(suite: Suite, cells: Sequence[StoredCell], out: Path) -> None:
    """Write and print the leaderboard."""
    leaderboard = Leaderboard.of(suite, cells)
    leaderboard.to_csv(out / "leaderboard.csv")
    write_text(out / "leaderboard.md", leaderboard_markdown(leaderboard, command(suite, out / "results.sqlite")))
    console.print(leaderboard_table(leaderboard))
    for line in leaderboard.caveats:
        console.print(f"[dim]{escape(line)}[/]", soft_wrap=True)
    console.print(f"Written to {out}: results.sqlite, leaderboard.csv, leaderboard.md", soft_wrap=True)


@contextmanager
def _pool(workers: int | None, ray: str | None) -> Iterator[Pool]:
    """Who plays the cells; a cluster is left at the end."""
    if ray is None:
        yield LocalPool(workers)
        return
    from roletrust_env.benchmark.cluster import Cluster

    with closing(Cluster(ray)) as cluster:
        yield cluster


def _asked(
    suite: AnySuite,
    model: Sequence[str] | None,
    attack: Sequence[str] | None,
    learner: Sequence[str] | None,
    allow_code: bool,
) -> AnySuite:
    """The suite with what was asked for by name, all of which can be made.

    Raises:
        ValueError: a name is unknown, what it names cannot be made or is not for such a suite, or a file names what is
            not installed.
    """
    wrong = {"--model": model, "--attack": attack} if isinstance(suite, LearnersSuite) else {"--learner": learner}
    for option, names in wrong.items():
        if names:
            raise ValueError(f"{option} is not for the suite {suite.name}, which is one for {suite.kind}")
    if isinstance(suite, LearnersSuite):
        return asked_learners(suite, learner, allow_code)
    if not allow_code:
        check_installed(trust_models, suite.models)
        check_installed(attackers, suite.attacks)
    everything = suite.model_copy(update={"models": "all", "attacks": "all"})
    return with_names(suite, _expanded(model, models(everything)), _expanded(attack, attacks(everything)))


def _expanded(names: Sequence[str] | None, everything: Sequence[str]) -> list[str]:
    return [part for name in names or [] for part in (everything if name == "all" else [name])]


def _tell_cost(suite: AnySuite, workers: int | None) -> None:
    if isinstance(suite, LearnersSuite):
        tell_learners_cost(suite)
        return
    found = estimate_cost(suite, cells(suite))
    table = number_table(
        f"{suite.name}, at the most", "time of one core, from a short trial", "cells", "rounds", "time"
    )
    for name, cost in found.items():
        table.add_row(name, f"{cost.cells:,}", f"{cost.env_steps:,}", in_time(cost.seconds))
    total = sum(cost.seconds for cost in found.values())
    number = workers or cores()
    console.print(table)
    console.print(f"In all about {in_time(total)} of one core, {in_time(total / number)} on {number}.")
