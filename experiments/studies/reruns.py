"""`python -m studies.reruns`: whether runs with other seeds, or with agents at other places, agree as they should."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from roletrust_env.storage.files import prepare_folder, write_text
from roletrust_env.storage.markdown import markdown_table
from roletrust_experiments.commands.console import console, number_table, plus_minus, print_next, short
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import Out
from studies.running import run


def reruns(
    results: Annotated[Path, typer.Argument(help="Results of `roletrust benchmark` with many seeds, results.sqlite.")],
    seeds: Annotated[int, typer.Option(min=1, help="Number of seeds of each run.")] = 2,
    shuffled: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help='Results of the same suite with `places = "shuffled"`: show instead whether the places of agents '
            "matter.",
            show_default=False,
        ),
    ] = None,
    out: Out = Path("results/reruns"),
) -> None:
    """Show whether [bold]runs of a benchmark with other seeds[/] agree as often as their leaderboards promise.

    The seeds of the results are cut into runs. Each run has a leaderboard of its own, which has intervals and the
    probability that a rank holds in another run. The other runs show how often such a promise is kept.

    With --shuffled, show instead whether the places of agents matter: how the scores of each model change if it sees
    the agents of each game in another order.

    Written: [green]reruns.md[/], and with --shuffled in place of it [green]places.md[/].

    [bold]Examples[/]

    [dim]# ten trust models, six runs of two seeds; a quarter of an hour on two cores[/]
    [cyan]roletrust benchmark --suite reruns --out results/reruns[/]
    [cyan]python -m studies.reruns results/reruns/results.sqlite[/]

    [dim]# the same models with all agents at random places[/]
    [cyan]roletrust benchmark --suite reruns-shuffled --out results/reruns-shuffled[/]
    [cyan]python -m studies.reruns results/reruns/results.sqlite --shuffled results/reruns-shuffled/results.sqlite[/]
    """
    require("the benchmark", "train", "scipy", "cma")  # to read a suite of the benchmark
    if shuffled is None:
        _show_promises(results, seeds, out)
    else:
        _show_places(results, shuffled, out)
    print_next("report", results)


def _show_promises(results: Path, seeds: int, out: Path) -> None:
    """Show and write what runs of a few seeds promise of one another, and how often others keep it."""
    from roletrust_experiments.commands.leaderboard import read_run
    from studies.rerun_promises import promises
    from studies.rerun_promises import reruns as leaderboards

    suite, stored = read_run(results)
    boards = leaderboards(suite, stored, seeds)
    caption = f"suite {suite.name}: {len(boards)} runs of {seeds} seeds, {len(boards[0])} models; every pair of runs"
    rows = [[one.what, f"{one.promised:.2f}", f"{one.kept:.2f}", f"{one.cases:,}"] for one in promises(boards)]
    command = f"python -m studies.reruns {results} --seeds {seeds}"
    _show("Reruns", ["promise", "promised", "kept", "cases"], rows, caption, command, out / "reruns.md")


def _show_places(results: Path, shuffled: Path, out: Path) -> None:
    """Show and write how the scores of models change if they see the agents in another order."""
    from roletrust_experiments.commands.leaderboard import read_run
    from studies.shuffled import place_effects

    (suite, stored), (other, theirs) = read_run(results), read_run(shuffled)
    rows = [
        [
            one.model,
            plus_minus(one.clean),
            plus_minus(one.clean_change, 5),
            plus_minus(one.worst),
            plus_minus(one.worst_change, 5),
        ]
        for one in place_effects(suite, stored, other, theirs)
    ]
    caption = (
        f"suites {suite.name} and {other.name}, {len(other.seeds)} seeds: {suite.score} with agents in order, and its "
        "change in the same games if they are shuffled"
    )
    command = f"python -m studies.reruns {results} --shuffled {shuffled}"
    headings = ["model", "clean", "change", "worst", "change"]
    _show("Places of agents", headings, rows, caption, command, out / "places.md")


def _show(title: str, headings: Sequence[str], rows: list[list[str]], caption: str, command: str, path: Path) -> None:
    """Print a table, and write it with its caption and its command."""
    prepare_folder(path.parent)
    table = number_table(title, caption, *headings[1:], name=headings[0])
    for name, *numbers in rows:
        table.add_row(escape(name), *(short(number) for number in numbers))
    console.print(table)
    text = markdown_table(headings, rows, names=1)
    write_text(path, f"{text}\n\n{title} of {caption}. Made by `{command}`.\n")
    console.print(escape(f"Written: {path}"), soft_wrap=True)


if __name__ == "__main__":
    run(reruns)
