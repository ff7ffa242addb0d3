"""`roletrust benchmark`: how robust trust models are, by the worst of all attacks; and which
learner attacks best.
"""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from roletrust_env.benchmarking.cost import estimate_seconds
from roletrust_env.benchmarking.learners.learner import is_search, make_search_method, registry
from roletrust_env.benchmarking.learners.results import (
    ALL_TASKS,
    HEADER,
    learner_results,
    ranking,
    table_rows,
)
from roletrust_env.benchmarking.learners.suite import LearnersSuite
from roletrust_env.benchmarking.pool import LocalPool, Pool, cores
from roletrust_env.benchmarking.run import placed, play_suite, selected_suite
from roletrust_env.benchmarking.schema import CellResult
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import Suite, with_search, without_models
from roletrust_env.benchmarking.suite_files import AnySuite, load_suite, reproduction_command
from roletrust_env.evaluation.agreed import check_recorded
from roletrust_env.evaluation.attackers import Attacker
from roletrust_env.evaluation.resources import in_time
from roletrust_env.evaluation.specs import check_installed, parse_parameters
from roletrust_env.game.policy import registry as attackers
from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.files import write_csv, write_text
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust.model import registry as trust_models
from roletrust_experiments.commands.console import (
    ALLOW_CODE,
    console,
    errors,
    number_table,
    progress_bar,
    tell,
)
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import NAMED, OWN, Out, Workers
from roletrust_experiments.plots.figure_files import write_figure


def benchmark(
    model: Annotated[
        list[str] | None,
        typer.Argument(
            metavar=f"[{NAMED}]...",
            help=(
                "Trust models; `all` means those of the suite. Without one the published "
                f"leaderboard is shown. {OWN} A program is exec:COMMAND, a service its URL."
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
    learner: Annotated[
        list[str] | None,
        typer.Option(
            metavar=NAMED,
            help=f"Learner of a suite for learners; repeat for more; default: all. {OWN}",
        ),
    ] = None,
    workers: Workers = None,
    ray: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Ray cluster to play on: 10.0.0.1:6379, or auto for one on this machine.",
        ),
    ] = None,
    allow_code: Annotated[bool, typer.Option("--allow-code", help=ALLOW_CODE)] = False,
    worlds: Annotated[int | None, typer.Option(min=0, help="Random seed of other worlds.")] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only estimate the time.")] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Start again, and overwrite the results in --out.")
    ] = False,
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
    [cyan]roletrust benchmark --suite learners-quick --learner mypackage.mine:MyLearner
    --learner PPO[/]
    """
    loaded = load_suite(suite, worlds)
    if isinstance(loaded, Suite) and not model:
        _refuse(loaded, {"--learner": learner})
        if attack:
            raise ValueError(f"--attack is {attack[0]}; it requires a trust model to attack")
        _show(without_models(with_search(loaded) if search else loaded), [])
        return
    require("the benchmark", "train", "scipy", "cma", "torch", "stable_baselines3")
    if ray is not None:
        require("--ray", "ray", "ray")
    asked = _asked(loaded, model, attack, learner, search, allow_code)
    if dry_run:
        _show_cost(asked, workers)
        return
    with ExitStack() as stack:
        pool: Pool = LocalPool(workers)
        if ray is not None:
            from roletrust_env.benchmarking.cluster import Cluster

            pool = stack.enter_context(closing(Cluster(ray)))
        try:
            stored = _play(asked, pool, force, out)
        except KeyboardInterrupt:
            tell(
                "Stopped. Finished cells are saved; repeat the command without --force.",
                where=errors,
            )
            raise typer.Exit(130) from None
    if isinstance(asked, LearnersSuite):
        _show_learners(asked, stored, out)
    else:
        _show(asked, stored, out)
    if any(done.failed for _, done in stored):
        raise typer.Exit(1)


def _play(suite: AnySuite, pool: Pool, force: bool, out: Path) -> list[StoredCell]:
    """Play the suite with a progress bar that moves by the cost of the cells."""
    with progress_bar(counted=False) as progress:
        job, costs = progress.add_task(f"Playing {suite.name}"), dict[str, float]()
        done = number = 0

        def begin(remaining: Sequence[Any], total: int) -> None:
            nonlocal costs, done, number
            done, number = total - len(remaining), total
            if done:
                progress.console.print(f"[dim]{done:,} of {number:,} cells are there already.[/]")
            if isinstance(suite, Suite) and not progress.disable:
                costs = estimate_seconds(suite, remaining)
            else:
                costs = {cell.key: 1.0 for cell in remaining}
            progress.reset(job, total=sum(costs.values()))

        def show(cell: Any, result: CellResult) -> None:
            nonlocal done
            done += 1
            about = f"Playing {suite.name}, {done:,} of {number:,} cells"
            progress.update(job, advance=costs.get(cell.key, 0.0), description=about)
            if result.failed:
                tell(f"{cell.key}: {result.failed}", "red")

        return play_suite(suite, pool, out=out, force=force, on_start=begin, on_cell=show)


def _show(suite: Suite, cells: Sequence[StoredCell], out: Path | None = None) -> None:
    """Print the leaderboard with the published models, and write it to a folder."""
    board = placed(suite, cells)
    if all(row.missing for row in board.rows) and not cells:
        ways = ", ".join(suite.methods)
        raise ValueError(
            f"suite {suite.name} does not have models that are published with {ways}; name those "
            "to play"
        )
    console.print(escape(repr(board)), soft_wrap=True)
    if "search" not in suite.methods:
        tell("These attacks are not searched. A search (--search) may lower the scores.")
    elif board.convergence:
        tell(board.convergence)
    if out is None:
        return
    board.to_csv(out / "leaderboard.csv")
    board.cases_to_csv(out / "worst_cases.csv")
    command = reproduction_command(suite, out / "results.sqlite")
    about = f"Suite {suite.name}, version {suite.version}. Made by `{command}`."
    write_text(out / "leaderboard.md", f"{board.to_markdown()}\n\n{about}\n\n{board.legend}")
    tell(f"Written to {out}: results.sqlite, leaderboard.csv, leaderboard.md, worst_cases.csv")
    tell(f"Next: roletrust report {out / 'results.sqlite'}")


def _asked(
    suite: AnySuite,
    model: Sequence[str] | None,
    attack: Sequence[str] | None,
    learner: Sequence[str] | None,
    search: bool,
    allow_code: bool,
) -> AnySuite:
    """Return the suite with the models, attacks or learners that were named, once all of them can
    be made.

    Raises:
        ValueError: A name is unknown, what it names cannot be made or is not for such a suite, or a
            file names what is not installed.
    """
    if isinstance(suite, LearnersSuite):
        _refuse(suite, {"a model": model, "--attack": attack, "--search": search})
        return _asked_learners(suite, learner, allow_code)
    _refuse(suite, {"--learner": learner})
    if not allow_code:
        check_installed(trust_models, suite.models)
        check_installed(attackers, (*suite.attacks, *suite.usual.values()))
        check_recorded(replayed.record for replayed in suite.replayed)
    asked = with_search(suite) if search else suite
    scripts, trained = _attackers(attack or ())
    return selected_suite(asked, _expanded(model or (), suite.models), scripts, trained)


def _refuse(suite: AnySuite, options: Mapping[str, Any]) -> None:
    """Refuse options that are given and have no effect.

    Raises:
        ValueError: One is given.
    """
    for what, given in options.items():
        if given:
            raise ValueError(
                f"{what} is not for the suite {suite.name}, which is one for {suite.kind}"
            )


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


def _expanded(names: Sequence[str], everything: Sequence[str]) -> list[str]:
    return [part for name in names for part in (everything if name == "all" else [name])]


def _show_cost(suite: AnySuite, workers: int | None) -> None:
    """Print the number of rounds of a suite for learners, whose time is unknown, or the time of a
    suite for trust models.
    """
    if isinstance(suite, LearnersSuite):
        table = number_table(
            f"{suite.name}, at the most",
            "rounds of each learner, over all games",
            "trials",
            "rounds",
        )
        cycles = [task.arguments()["scenario"].max_cycles for task in suite.tasks.values()]
        trials, tests = len(cycles) * len(suite.seeds), len(suite.budgets) * suite.games
        rounds = trials * sum(suite.budgets) + tests * sum(cycles) * len(suite.seeds)
        for name in suite.learners:
            table.add_row(escape(name), f"{trials * len(suite.budgets):,}", f"{rounds:,}")
        console.print(table)
        return
    cells = suite.cells()
    seconds = estimate_seconds(suite, cells)
    caption = "time of one core, estimated from a short trial, too long on a busy machine"
    table = number_table(f"{suite.name}, estimated", caption, "cells", "time")
    for model in suite.model_names:
        keys = [cell.key for cell in cells if cell.model == model]
        table.add_row(escape(model), f"{len(keys):,}", in_time(sum(seconds[key] for key in keys)))
    console.print(table)
    total, number = sum(seconds.values()), workers or cores()
    console.print(
        f"In all about {in_time(total)} of one core, {in_time(total / number)} on {number}."
    )


# --- suites of learners ---

_INTERVALS = "interquartile mean of the runs, with its 95% interval by stratified bootstrap"


def _asked_learners(
    suite: LearnersSuite, named: Sequence[str] | None, allow_code: bool
) -> LearnersSuite:
    """Return the suite with the learners of the options, see `_asked`."""
    if not allow_code:
        check_installed(registry, [name for name in suite.learners if not is_search(name)])
    asked = dict.fromkeys(_expanded(named or ["all"], suite.learners))
    changed = suite.model_copy(update={"learners": tuple(asked)})
    for name in changed.learners:
        make_search_method(name, next(iter(suite.tasks.values())).id)
    return changed


def _show_learners(suite: LearnersSuite, stored: Sequence[StoredCell], out: Path) -> None:
    """Write the picture of a run and its shares with each budget, and print those with the largest
    one.
    """
    from roletrust_experiments.plots.learners import learners_figure

    scales, results = learner_results(suite, stored)
    write_csv(out / "learners.csv", HEADER, table_rows(results))
    write_figure(out / "learners.png", learners_figure(suite.title, results, scales), colours=256)
    names, largest = ranking(results), suite.budgets[-1]
    share_of = {(result.budget, result.learner, result.task): result.share for result in results}
    rows = {
        (budget, name): [
            _words(share_of.get((budget, name, task))) for task in (ALL_TASKS, *scales)
        ]
        for budget in suite.budgets
        for name in names
    }
    tops = [f"{task}: {scale.description}, {scale.top_score:.3f}" for task, scale in scales.items()]
    caption = (
        f"Share by the rounds of play: 0 is honest play; {_INTERVALS}. Share 1 is, on "
        f"{'; '.join(tops)}."
    )
    lines = [[f"{budget:,}", f"`{name}`", *shares] for (budget, name), shares in rows.items()]
    table = markdown_table(["rounds", "learner", ALL_TASKS, *scales], lines, names=2)
    command = reproduction_command(suite, out / "results.sqlite")
    write_text(out / "learners.md", f"{table}\n\n{caption} Made by `{command}`.\n")
    caption = f"share with {largest:,} rounds: 0 is honest play; {_INTERVALS}"
    shown = number_table(
        f"Learners, suite {suite.name}", caption, *map(escape, (ALL_TASKS, *scales))
    )
    for name in names:
        shown.add_row(*map(escape, (name, *rows[largest, name])))
    console.print(shown)
    for task, scale in scales.items():
        tell(f"{task}: 1 is {scale.description}, {scale.top_score:.4f}", "dim")
    for trial, done in stored:
        if why := done.failed or (done.unsuitable if trial.learner in suite.learners else ""):
            tell(f"{trial.key}: {why}", "dim")
    tell(f"Written to {out}: results.sqlite, learners.csv, learners.md, learners.png")


def _words(share: Interval | None) -> str:
    if share is None or share.value != share.value:
        return "-"
    interval = "" if share.low != share.low else f" [{share.low:.2f}, {share.high:.2f}]"
    return f"{share.value:.2f}{interval}"
