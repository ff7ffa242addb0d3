"""`roletrust report`: the results of a benchmark on one page."""

from pathlib import Path
from typing import Annotated

import typer

from roletrust_experiments.commands.console import tell
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import Out


def report(
    results: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Results of benchmarks, one of trust models and one of learners at the most."
        ),
    ] = None,
    out: Out = Path("results/report"),
) -> None:
    """Write [bold]the results of a benchmark[/] as one page that opens in any browser, without a
    network.

    The page has the leaderboard, which can be sorted and filtered; the worst case of each model in
    each setting; skill with verified and with open reports; regret by round; the worlds and
    settings; and the learners and their progress. A run may be incomplete: the page shows the cells
    that have been played.

    Written: [green]report.html[/], the page; a [green].csv[/] with the numbers of each figure, and
    a [green].png[/] and a [green].pdf[/] of it; [green]leaderboard.md[/], the leaderboard in
    Markdown; and [green]regimes.csv[/], skill by the kind of reports.

    [bold]Examples[/]

    [dim]# play the quick suite, and show it[/]
    [cyan]roletrust benchmark mean block --suite quick --out results/quick[/]
    [cyan]roletrust report results/quick/results.sqlite --out results/quick/report[/]

    [dim]# models and learners on one page[/]
    [cyan]roletrust benchmark --suite learners-quick --out results/learners[/]
    [cyan]roletrust report results/quick/results.sqlite results/learners/results.sqlite[/]
    """
    require("the report", "train", "scipy", "cma")  # to read a suite of the benchmark
    from roletrust_experiments.report.files import report as write_report

    written = write_report(results or [Path("results/benchmark/results.sqlite")], out)
    tell(f"Written to {out}: {', '.join(written)}")
