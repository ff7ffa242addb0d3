"""`roletrust report`: what a benchmark found, as one page to look at."""

import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

from roletrust_env.storage.files import prepare_folder, write_csv, write_text
from roletrust_experiments.commands.console import ALLOW_CODE, console
from roletrust_experiments.commands.extras import require
from roletrust_experiments.plots.figure_files import write_figure


def report(
    results: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Files of `roletrust benchmark`: one of trust models, one of learners, or both; "
            "by default results/benchmark/results.sqlite.",
            show_default=False,
        ),
    ] = None,
    allow_code: Annotated[bool, typer.Option("--allow-code", help=ALLOW_CODE)] = False,
    out: Annotated[Path, typer.Option(help="Folder for the report; it is made if need be.")] = Path("results/report"),
) -> None:
    """Show [bold]what a benchmark found[/] on one page, which opens in any browser, without a network.

    The leaderboard, to sort and to filter; what each attack leaves of each model, and how it comes to that round by
    round; which share of liars breaks a model; damage against detectability; which learner attacks best, and how soon;
    and what limits these numbers. A run need not be over: the page shows the cells that have been played.

    Written: [green]report.html[/], of each figure a [green].csv[/] with its numbers and a [green].png[/], and
    [green]leaderboard.md[/], the leaderboard as a table in Markdown.

    [bold]Examples[/]

    [dim]# play the quick suite, and look at it[/]
    [cyan]roletrust benchmark --out results/quick[/]
    [cyan]roletrust report results/quick/results.sqlite --out results/quick/report[/]

    [dim]# models and learners on one page[/]
    [cyan]roletrust benchmark --suite learners-quick --out results/learners[/]
    [cyan]roletrust report results/quick/results.sqlite results/learners/results.sqlite[/]
    """
    require("the report", "report", "bokeh", "jinja2")
    require("the report", "train", "scipy", "cma")  # as the benchmark whose suite it reads
    from roletrust_experiments.commands.leaderboard import leaderboard_markdown
    from roletrust_experiments.report.content import read
    from roletrust_experiments.report.page import page
    from roletrust_experiments.report.pictures import pictures

    paths = results or [Path("results/benchmark/results.sqlite")]
    content = read(paths, allow_code=allow_code)
    prepare_folder(out)
    for name, table in content.tables.items():
        write_csv(out / f"{name}.csv", table.header, [[_flat(value) for value in row] for row in table.rows])
    for name, picture in pictures(content).items():
        write_figure(out / f"{name}.png", picture)
    command = shlex.join(["roletrust", "report", *map(str, paths), "--out", str(out)])
    write_text(out / "report.html", page(content, command))
    written = "report.html"
    if told := content.robustness:
        write_text(out / "leaderboard.md", leaderboard_markdown(told.leaderboard, told.command))
        written += ", leaderboard.md"
    console.print(f"Written to {out}: {written}; {', '.join(content.tables)}, each as .csv and .png", soft_wrap=True)


def _flat(value: Any) -> Any:
    """A curve goes into one field of a table."""
    return " ".join(f"{part:g}" for part in value) if isinstance(value, list) else value
