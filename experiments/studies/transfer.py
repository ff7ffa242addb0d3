"""`python -m studies.transfer`: coalitions trained against one trust model, played against the others."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from roletrust_env.storage.files import prepare_folder, write_csv, write_text
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.storage.provenance import software
from roletrust_env.trust import trust_models
from roletrust_experiments.commands import completion
from roletrust_experiments.commands.console import console, number_table, print_next
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import (
    NAMED,
    Again,
    ConditionScenario,
    ConditionShare,
    ConditionSuite,
    ConditionTrack,
    FreshGames,
    ModelsOption,
    Out,
    Searches,
    Seed,
    Workers,
)
from roletrust_experiments.plots.figure_files import write_figure
from studies.attackers.condition import Condition
from studies.attackers.runs import Run, of_kind, read_runs
from studies.played import play_and_keep
from studies.running import run

if TYPE_CHECKING:
    from studies.attackers.transfer import Cell

_HEADER = ("trained_on", "universal", "played_on", "seen", "utility", "half_95")


def transfer(
    model: ModelsOption = None,
    on: Annotated[
        list[str] | None,
        typer.Option(
            metavar=NAMED,
            help="Further trust model to play against, without training on it; repeat for more. NAME may be your own "
            "class, package.module:Class, whose module is then imported.",
            autocompletion=completion.models,
            show_default=False,
        ),
    ] = None,
    budget: Annotated[int, typer.Option(min=1, help="Rounds x games that each training may play.")] = 300_000,
    suite: ConditionSuite = "two-worlds",
    stage: ConditionScenario = "crowd",
    track: ConditionTrack = "raters",
    share: ConditionShare = 0.5,
    games: FreshGames = 200,
    seed: Seed = 0,
    runs: Searches = 3,
    workers: Workers = None,
    force: Again = False,
    out: Out = Path("results/transfer"),
) -> None:
    """Show [bold]whether an attacker of one trust model harms the others[/], too.

    A coalition is trained by evolution, from random networks, against each trust model (rows), and plays against every
    trust model (columns) in fresh games, the same ones for all rows. The number is the utility of a consumer that goes
    to the most trusted provider, as a share of the best possible. Lower is a better attack. A frame marks the trust
    models of the training.

    The universal coalitions that come with the project are further rows. They are not trained here, and were trained
    in turn against the trust models with a frame.

    Each run is saved when it is finished, so that an interrupted command continues when it is given again. A further
    column trains the rows again with the same seeds, and plays only against the new trust model.

    Written: [green]transfer.png transfer.md transfer.csv transfer.json[/].

    [bold]Examples[/]

    [dim]# all trust models against each other, in hours[/]
    [cyan]python -m studies.transfer[/]

    [dim]# two trust models, one short training of each, in a minute[/]
    [cyan]python -m studies.transfer --model beta --model role-trust --budget 50000 --runs 1[/]

    [dim]# is your own model safe from attackers of the others?[/]
    [cyan]python -m studies.transfer --model beta --model qor --on mypackage.mymodel:MyModel[/]
    """
    require("the transfer", "train", "scipy", "cma", "torch", "safetensors")
    from studies.attackers.transfer import Kept, coalitions, missing_models, play_row, sentences, table

    condition = Condition.of(suite, stage, track, share)
    models = list(dict.fromkeys(model or trust_models()))
    columns = list(dict.fromkeys([*models, *(on or [])]))
    condition.check(columns)
    rows, seeds = coalitions(models), range(seed, seed + runs)
    condition_settings = {"condition": condition.describe(), "budget": budget, "games": games}
    settings = {"command": "python -m studies.transfer", **condition_settings, **software()}
    path = out / "transfer.json"
    kept = {} if force else read_runs(path, settings, of_kind(Kept))
    prepare_folder(out)
    jobs = {
        row.key(one): (condition, row, one, missing, budget, games)
        for row in rows
        for one in seeds
        if (missing := missing_models(row, one, columns, kept))
    }
    failed = play_and_keep(
        play_row,
        jobs,
        kept,
        total=len(rows) * runs,
        workers=workers,
        settings=settings,
        path=path,
        merge=_merge,
    )
    cells = table(rows, columns, seeds, kept)
    if not cells:
        raise ValueError("no row of the table could be played in full; the reasons are above")
    caption = (
        f"Utility of the consumer in {games} fresh games, mean over the runs ({runs}), with {budget:,} rounds of "
        f"training each. Lower is a better attack. A star: trained on this trust model. Condition: {condition}."
    )
    lines = sentences(cells)
    _write(out, condition, cells, [caption, *lines])
    _print(cells)
    for line in (caption, *lines):
        console.print(escape(line), soft_wrap=True)
    console.print(f"Written to {out}: transfer.png, transfer.md, transfer.csv, transfer.json", soft_wrap=True)
    print_next("budget", "--model", models[0])
    if failed:
        raise typer.Exit(1)


def _merge(before: Run, run: Run) -> Run:
    """Return a run with the trust models of an earlier run of the same training."""
    return {**run, "utility": {**before.get("utility", {}), **run["utility"]}}


def _write(out: Path, condition: Condition, cells: "Sequence[Sequence[Cell]]", lines: Sequence[str]) -> None:
    from studies.plots.attackers import transfer_figure

    write_csv(
        out / "transfer.csv",
        _HEADER,
        [
            (cell.coalition.name, cell.coalition.universal, cell.model, cell.seen, *map(float, cell.utility[:2]))
            for row in cells
            for cell in row
        ],
    )
    title, note = f"Trained on one trust model, played on others ({condition})", "a frame: trained on this trust model"
    write_figure(out / "transfer.png", transfer_figure(title, cells, note))
    parts = [markdown_table(*_table(cells), names=1), *lines]
    parts.append(
        "Written by `python -m studies.transfer`; `transfer.json` has the settings, the software and every run."
    )
    write_text(out / "transfer.md", "\n\n".join(parts) + "\n")


def _table(cells: "Sequence[Sequence[Cell]]") -> tuple[list[str], list[list[str]]]:
    """Return the headings, and a row for each coalition."""
    headings = ["trained on", *(cell.model for cell in cells[0])]
    rows = [[row[0].coalition.name, *(f"{cell.utility.mean:.2f}{'*' * cell.seen}" for cell in row)] for row in cells]
    return headings, rows


def _print(cells: "Sequence[Sequence[Cell]]") -> None:
    headings, rows = _table(cells)
    table = number_table("Trained on the rows, played on the columns", "", *map(escape, headings[1:]))
    for name, *numbers in rows:
        table.add_row(escape(name), *numbers)
    console.print(table)


if __name__ == "__main__":
    run(transfer)
