"""`roletrust benchmark`: how robust trust models are, by the worst of all attacks; and which
learner attacks best.
"""

from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from roletrust_env.benchmarking.closed_loop.board import ClosedLoopBoard
from roletrust_env.benchmarking.closed_loop.suite import ClosedLoopSuite, with_models
from roletrust_env.benchmarking.cost import cell_costs, estimate_cost
from roletrust_env.benchmarking.known_attacks import check_records, read_known_attacks
from roletrust_env.benchmarking.leaderboard import Leaderboard
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
from roletrust_env.benchmarking.run import play_suite, with_names
from roletrust_env.benchmarking.schema import CellResult
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import Suite, with_known
from roletrust_env.benchmarking.suite_files import AnySuite, load_suite, reproduction_command
from roletrust_env.benchmarking.verification import check_installed_names
from roletrust_env.benchmarking.worlds import WorldRow
from roletrust_env.evaluation.resources import in_time
from roletrust_env.evaluation.specs import check_installed
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
from roletrust_experiments.commands.leaderboard import (
    leaderboard_markdown,
    leaderboard_table,
    replay_command,
    report_command,
)
from roletrust_experiments.commands.options import NAMED, OWN, Out, Workers
from roletrust_experiments.plots.figure_files import write_figure

_INSTEAD = (
    " instead of those of the suite; repeat for more; `all` means all, of learners all of "
    "the suite."
)


def benchmark(
    suite: Annotated[
        str,
        typer.Option(
            help=(
                "Suite to play: quick, standard, full, marketplace, learners, learners-quick, or "
                "the path of a .toml file."
            )
        ),
    ] = "quick",
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar=NAMED,
            help=f"Trust model{_INSTEAD} {OWN} A program is exec:COMMAND, a service its URL.",
        ),
    ] = None,
    attack: Annotated[
        list[str] | None, typer.Option(metavar=NAMED, help=f"Scripted attack{_INSTEAD} {OWN}")
    ] = None,
    known: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE.json",
            help="Further attacks, by `roletrust submit --attacks`; repeat for more.",
        ),
    ] = None,
    learner: Annotated[
        list[str] | None,
        typer.Option(metavar=NAMED, help=f"Learner{_INSTEAD} Only in a suite for learners. {OWN}"),
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
    worlds: Annotated[
        int | None, typer.Option(min=0, help="Seed of other worlds, if the suite draws some.")
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only show the worlds and estimate the time.")
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Start again, and overwrite the results in --out.")
    ] = False,
    out: Out = Path("results/benchmark"),
) -> None:
    r"""Attack [bold]every trust model with every attack[/], and rank the models by the worst case.

    A suite combines trust models, scenarios, tracks (the roles of the compromised agents), shares
    of compromised agents, ways to attack and seeds; each combination is a cell. The ways to attack
    are scripted attacks, searches over their parameters, coalitions that learn, and known attacks.
    [bold]Utility[/] is the quality that consumers get from the most trusted provider, as a share of
    the best quality. [bold]Skill[/] is 1 for the best choice and 0 for a blind one. A condition is
    a scenario with a track and a share; its [bold]worst case[/] is the attack with the lowest
    score, chosen in some games and measured in others. Models are ranked by the mean worst case
    over all conditions.

    A suite for [bold]learners[/] combines tasks, learners, budgets of rounds and seeds. The share
    of a learner on a task is 0 for honest play. It is 1 for the optimum, for a proven bound, or for
    the best attack found where neither is known. Learners are measured in games that they have not
    seen. Written: [green]learners.csv learners.md learners.png[/].

    The result of each cell is saved in [green]results.sqlite[/] as soon as it is complete, so that
    an interrupted command continues when it is given again. Written at the end:
    [green]leaderboard.csv leaderboard.md[/]; `roletrust report` makes a page of the results. If a
    cell fails, the others count, and the exit code is 1.

    [bold]Examples[/]

    [dim]# all models, all scripts and a small search in a small market, in some minutes[/]
    [cyan]roletrust benchmark[/]

    [dim]# the time that the suite of the leaderboard takes[/]
    [cyan]roletrust benchmark --suite standard --dry-run[/]

    [dim]# your own model beside two others[/]
    [cyan]roletrust benchmark --model mypackage.mymodel:MyModel --model role-trust --model median[/]

    [dim]# your own learner beside PPO, in one or two minutes[/]
    [cyan]roletrust benchmark --suite learners-quick --learner mypackage.mine:MyLearner
    --learner PPO[/]
    """
    require("the benchmark", "train", "scipy", "cma", "torch", "stable_baselines3")
    if ray is not None:
        require("--ray", "ray", "ray")
    asked = _asked(load_suite(suite, worlds), model, attack, learner, allow_code)
    if known:
        if not isinstance(asked, Suite):
            raise ValueError(
                f"--known is not for the suite {asked.name}, which is one for {asked.kind}"
            )
        attacks = [known_attack for file in known for known_attack in read_known_attacks(file)]
        check_records(attacks)
        if lacking := sum(
            known_attack.condition not in asked.conditions for known_attack in attacks
        ):
            console.print(
                f"[yellow]{lacking} known attacks are for conditions that {escape(asked.name)} "
                "lacks.[/]"
            )
        asked = with_known(asked, attacks)
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
    elif isinstance(asked, ClosedLoopSuite):
        _show_board(asked, stored, out)
    else:
        _show(asked, stored, out)
    if not isinstance(asked, ClosedLoopSuite):
        tell(f"Next: {report_command(asked, out)}")
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
            # A log goes by the number of cells, as the trials that tell their costs may take a
            # minute.
            alike = {cell.key: 1.0 for cell in remaining}
            costs = alike if progress.disable else cell_costs(suite, remaining)
            progress.reset(job, total=sum(costs.values()))

        def show(cell: Any, result: CellResult) -> None:
            nonlocal done
            done += 1
            about = f"Playing {suite.name}, {done:,} of {number:,} cells"
            progress.update(job, advance=costs.get(cell.key, 0.0), description=about)
            if result.failed:
                tell(f"{cell.key}: {result.failed}", "red")

        return play_suite(suite, pool, out=out, force=force, on_start=begin, on_cell=show)


def _show(suite: Suite, cells: Sequence[StoredCell], out: Path) -> None:
    """Write and print the leaderboard."""
    leaderboard = Leaderboard.of(suite, cells)
    leaderboard.to_csv(out / "leaderboard.csv")
    write_text(
        out / "leaderboard.md",
        leaderboard_markdown(leaderboard, reproduction_command(suite, out / "results.sqlite")),
    )
    console.print(leaderboard_table(leaderboard))
    for line in leaderboard.caveats:
        tell(line, "dim")
    tell(f"Written to {out}: results.sqlite, leaderboard.csv, leaderboard.md")
    if replayed := replay_command(leaderboard, out / "results.sqlite"):
        tell(f"What the worst attack does: {replayed}")


def _show_board(suite: ClosedLoopSuite, cells: Sequence[StoredCell], out: Path) -> None:
    """Write and print the leaderboard of the closed loop."""
    board = ClosedLoopBoard.of(suite, cells)
    board.to_csv(out / "leaderboard.csv")
    board.cases_to_csv(out / "worst_cases.csv")
    command = reproduction_command(suite, out / "results.sqlite")
    about = f"Suite {suite.name}, version {suite.version}. Made by `{command}`."
    write_text(out / "leaderboard.md", f"{board.to_markdown()}\n\n{about}\n\n{board.legend}")
    console.print(escape(repr(board)), soft_wrap=True)
    tell(f"Written to {out}: results.sqlite, leaderboard.csv, leaderboard.md, worst_cases.csv")


def _asked(
    suite: AnySuite,
    model: Sequence[str] | None,
    attack: Sequence[str] | None,
    learner: Sequence[str] | None,
    allow_code: bool,
) -> AnySuite:
    """Return the suite with the models, attacks or learners of the options, once all of them can be
    made.

    Raises:
        ValueError: A name is unknown, what it names cannot be made or is not for such a suite, or a
            file names what is not installed.
    """
    wrong = {
        "learners": {"--model": model, "--attack": attack},
        "closed-loop": {"--attack": attack, "--learner": learner},
        "robustness": {"--learner": learner},
    }[suite.kind]
    for flag, names in wrong.items():
        if names:
            raise ValueError(
                f"{flag} is not for the suite {suite.name}, which is one for {suite.kind}"
            )
    if isinstance(suite, LearnersSuite):
        return _asked_learners(suite, learner, allow_code)
    if isinstance(suite, ClosedLoopSuite):
        if not allow_code:
            check_installed(trust_models, suite.models)
            check_installed(attackers, (*suite.attacks, *suite.usual.values()))
        return with_models(suite, _expanded(model, trust_models.names()) or suite.models)
    if not allow_code:
        check_installed_names(suite)
    everything = suite.model_copy(update={"models": "all", "attacks": "all"})
    return with_names(
        suite, _expanded(model, everything.model_names), _expanded(attack, everything.attack_names)
    )


def _expanded(names: Sequence[str] | None, everything: Sequence[str]) -> list[str]:
    return [part for name in names or [] for part in (everything if name == "all" else [name])]


def _show_cost(suite: AnySuite, workers: int | None) -> None:
    """Print the number of rounds, and the time of a suite for trust models; that of a learner is
    unknown.
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
    if isinstance(suite, ClosedLoopSuite):
        table = number_table(suite.name, "worlds: those that each cell plays", "cells", "worlds")
        worlds = suite.worlds.selection + suite.worlds.measured
        for (model, rule), cells in Counter(cell[:2] for cell in suite.cells()).items():
            table.add_row(f"{escape(model)} ({rule} rule)", f"{cells:,}", f"{worlds:,}")
        console.print(table)
        return
    for world_fields in suite.worlds.items():
        name, *values = WorldRow.of(*world_fields)
        world = ", ".join(
            f"{field} {value}" for field, value in zip(WorldRow._fields[1:], values, strict=True)
        )
        console.print(f"{escape(name)}: [dim]{escape(world)}[/]", soft_wrap=True)
    costs = estimate_cost(suite, suite.cells())
    caption = (
        "rounds: at the most; time: of one core, estimated from a short trial, too long on a "
        "busy machine"
    )
    table = number_table(f"{suite.name}, estimated", caption, "cells", "rounds", "time")
    for name, cost in costs.items():
        table.add_row(name, f"{cost.cells:,}", f"{cost.env_steps:,}", in_time(cost.seconds))
    total = sum(cost.seconds for cost in costs.values())
    number = workers or cores()
    console.print(table)
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
