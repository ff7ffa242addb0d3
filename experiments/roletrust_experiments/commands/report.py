"""`roletrust report`: the results of a benchmark on one page."""

import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

from roletrust_env.storage.files import prepare_folder, write_csv, write_text
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
    pages: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Folder with the pages of the trust models, to which it then links.",
        ),
    ] = "",
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
    require(
        "the report", "train", "scipy", "cma", "jinja2"
    )  # to read a suite of the benchmark, and for the page
    from roletrust_env.errors import check_unicode
    from roletrust_experiments.report.content import read
    from roletrust_experiments.report.figures import write_figures
    from roletrust_experiments.report.page import page

    paths = results or [Path("results/benchmark/results.sqlite")]
    for path in paths:
        check_unicode("the path of the results", str(path))  # which the page shows
    content = read(paths)
    prepare_folder(out)
    for name, table in content.tables.items():
        write_csv(
            out / f"{name}.csv",
            table.header,
            [[_flat(value) for value in row] for row in table.rows],
        )
    drawn = write_figures(out, content, ".png", ".pdf")
    pictures = {name: (out / f"{name}.png").read_bytes() for name in drawn}
    linked = [*(["--pages", pages] if pages else [])]
    command = shlex.join(["roletrust", "report", *map(str, paths), *linked, "--out", str(out)])
    replayed, written = "", ["report.html"]
    if models := content.models:
        models.write(out)
        replayed = shlex.join(["roletrust", "replay", str(models.path)])
        written += ["leaderboard.md", "regimes.csv"]
    write_text(out / "report.html", page(content, pictures, command, pages.rstrip("/"), replayed))
    tell(f"Written to {out}: {', '.join(written)}; {', '.join(drawn)}, each as .csv, .png and .pdf")


def _flat(value: Any) -> Any:
    """Return a value for a field of a table; a curve becomes one field."""
    return " ".join(f"{part:g}" for part in value) if isinstance(value, list) else value
