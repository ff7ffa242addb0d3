"""`roletrust reruns`: whether runs with other seeds agree as often as their intervals and ranks promise."""

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from roletrust_env.storage.files import prepare_folder, write_text
from roletrust_experiments.commands.console import console, number_table, print_next
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import Out

_COLUMNS = ("promised", "kept", "cases")


def reruns(
    results: Annotated[Path, typer.Argument(help="Results of `roletrust benchmark` with many seeds, results.sqlite.")],
    seeds: Annotated[int, typer.Option(min=1, help="Number of seeds of a run.")] = 2,
    out: Out = Path("results/reruns"),
) -> None:
    """Show whether [bold]runs of a benchmark with other seeds[/] agree as often as they promise.

    The seeds of the results are cut into runs. Each run has a leaderboard of its own, with intervals and with the
    probability that a rank holds in another run. The other runs show how often that is true.

    Written: [green]reruns.md[/].

    [bold]Examples[/]

    [dim]# ten trust models, six runs of two seeds; a quarter of an hour on two cores[/]
    [cyan]roletrust benchmark --suite reruns --out results/reruns[/]
    [cyan]roletrust reruns results/reruns/results.sqlite[/]
    """
    require("the benchmark", "train", "scipy", "cma")  # to read a suite of the benchmark
    from roletrust_env.benchmark.reruns import promises
    from roletrust_env.benchmark.reruns import reruns as leaderboards
    from roletrust_env.benchmark.store import Store
    from roletrust_env.benchmark.suite import Suite

    with Store(results) as store:
        suite, stored = store.suite, store.all()
    if not isinstance(suite, Suite):
        raise ValueError(f"{results} is of a suite for {suite.kind}; give one for trust models")
    boards = leaderboards(suite, stored, seeds)
    prepare_folder(out)
    caption = f"suite {suite.name}: {len(boards)} runs of {seeds} seeds, {len(boards[0])} models; every pair of runs"
    table = number_table("Reruns", caption, *_COLUMNS, name="promise")
    lines = ["| promise | promised | kept | cases |", "| :--- | ---: | ---: | ---: |"]
    for one in promises(boards):
        texts = f"{one.promised:.2f}", f"{one.kept:.2f}", f"{one.cases:,}"
        table.add_row(one.what, *texts)
        lines.append(f"| {' | '.join((one.what, *texts))} |")
    console.print(table)
    command = f"roletrust reruns {results} --seeds {seeds}"
    write_text(out / "reruns.md", "\n".join(lines) + f"\n\nReruns of {caption}. Made by `{command}`.\n")
    console.print(escape(f"Written: {out / 'reruns.md'}"), soft_wrap=True)
    print_next("report", results)
