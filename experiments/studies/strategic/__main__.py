"""Whether honest service stays the best response when providers and raters learn, too."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from roletrust_env.storage.files import prepare_folder, write_csv, write_text
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.storage.provenance import software
from roletrust_experiments.commands import completion
from roletrust_experiments.commands.console import console, number_table, option, plus_minus, print_next
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import NAMED, Again, Out, Seed, Workers
from roletrust_experiments.plots.figure_files import write_figure
from studies.attackers.runs import read_runs
from studies.played import play_and_keep
from studies.running import run

if TYPE_CHECKING:
    from studies.strategic.points import Level

_ENDS = ("", "_half_95")
_ANARCHY = ("anarchy", "anarchy_low_95", "anarchy_high_95")
_LABELS = {
    "nobody learns": "nobody learns",
    "honest": "from honest play",
    "honest, shuffled": "the same, shuffled",
    "random": "from random",
}
_MEASURES = {
    "gain, provider": "provider_gain",
    "gain, rater": "rater_gain",
    "honest providers": "honest_providers",
    "honest raters": "honest_raters",
    "quality": "quality",
    "welfare": "welfare",
}
_PRICE = "price of anarchy"
_NAMES, _PAGE = ("world", "model", "start"), (*_MEASURES, _PRICE)
_SCREEN = ("welfare", _PRICE, "honest providers", "honest raters", "gain, provider", "gain, rater", "quality")
"""Columns of a terminal, which leaves out the last ones where it is narrow."""

_QUESTION = "What is left of welfare when providers and raters learn, by trust model?"


def strategic(
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar=NAMED,
            help="Trust model; repeat for more; seven of the project if left out.",
            autocompletion=completion.models,
            show_default=False,
        ),
    ] = None,
    scenario: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Scenario of the suite standard; repeat for more; crowd and market if left out.",
            show_default=False,
        ),
    ] = None,
    cost: Annotated[
        list[float] | None,
        typer.Option(
            min=0, help="Cost of a service of quality 1; repeat for more; 0.1 and 0.3 if left out.", show_default=False
        ),
    ] = None,
    runs: Annotated[int, typer.Option(min=2, help="Number of runs of each population.")] = 5,
    steps: Annotated[int, typer.Option(min=1, help="Number of steps of the learners.")] = 150,
    games: Annotated[int, typer.Option(min=2, help="Number of games that measure each run.")] = 32,
    seed: Seed = 0,
    workers: Workers = None,
    force: Again = False,
    out: Out = Path("results/strategic"),
) -> None:
    """Ask [bold]whether honest service stays the best response[/] when providers and raters learn, too.

    Agents earn what the environment rewards: trust, less the cost of their services. A provider chooses a level of
    quality and how it reacts to its own trust; a rater chooses how far it lifts or sinks its ratings and how far it
    follows published trust. All agents learn at once, each for itself, from honest play and from random strategies.
    With shuffled rewards nothing can be learnt, and what happens is drift.

    Measured: welfare, which is the quality that consumers get less its cost; the price of anarchy, which is the best
    welfare over the welfare of what was learnt; the share of honest agents; and the gain of the best deviation of one
    agent, with everybody honest and with what was learnt.

    Each population is saved when it is finished, so that an interrupted command continues when it is given again.

    Written: [green]strategic.md strategic.csv strategic.png strategic.json[/].

    [bold]Examples[/]

    [dim]# as in docs/, in some ten minutes on one core[/]
    [cyan]python -m studies.strategic --workers 1[/]

    [dim]# one model at one cost, in a minute[/]
    [cyan]python -m studies.strategic --model beta --scenario crowd --cost 0.5[/]
    """
    require("strategic agents", "train", "scipy", "cma")  # to read a suite of the benchmark
    from studies.strategic.points import (
        COSTS,
        MODELS,
        SCENARIOS,
        Effort,
        Level,
        check_of,
        play_point,
        points,
    )

    if games % 2:
        raise ValueError(f"--games is {games}; it must be even, because one half chooses and the other one measures")
    models, scenarios = (list(dict.fromkeys(given)) for given in (model or MODELS, scenario or SCENARIOS))
    every, effort = points(scenarios, models, sorted(set(cost or COSTS))), Effort(runs, steps, games, seed)
    for point in every:
        point.game()
    settings = {"command": "python -m studies.strategic", "effort": effort._asdict(), **software()}
    path = out / "strategic.json"
    kept = {} if force else read_runs(path, settings, check_of(effort))
    prepare_folder(out)
    jobs = {point.key: (point, effort) for point in every if point.key not in kept}
    play_and_keep(play_point, jobs, kept, total=len(every), workers=workers, settings=settings, path=path)
    found = [Level.of(point, kept[point.key]) for point in every if point.key in kept]
    if not found:
        raise ValueError("no population was played, so there is nothing to show")
    chosen = [*option("--model", model), *option("--scenario", scenario), *option("--cost", cost)]
    effort_options = ["--steps", steps, "--games", games, "--seed", seed]
    command = shlex.join(map(str, ["python", "-m", "studies.strategic", *chosen, "--runs", runs, *effort_options]))
    note = f"{runs} runs of {steps} steps, {games} games each; 95% intervals over the runs"
    _write(out, found, f"{note}. Made by `{command}`.", f"{runs} runs; 95% intervals")
    table = number_table("Strategic agents", note, *_SCREEN, name="population")
    for place, name, start, *numbers in _rows(found, _SCREEN):
        table.add_row(escape(f"{place}, {name}, {start}".replace("`", "")), *numbers)
    console.print(table)
    console.print(f"Written to {out}: strategic.md, strategic.csv, strategic.png, strategic.json", soft_wrap=True)
    more = 2 * runs
    elsewhere = out.with_name(f"{out.name}-{more}-runs")
    print_next("strategic", chosen, "--runs", more, effort_options, option("--workers", workers), "--out", elsewhere)


def _write(out: Path, found: Sequence["Level"], caption: str, note: str) -> None:
    """Write the table, the numbers and the figure."""
    from studies.plots.findings import finding_figure

    names = list(found[0].estimates)
    header = (
        *("scenario", "model", "cost", "start"),
        *(f"{name}{end}" for name in names for end in _ENDS),
        *_ANARCHY,
        *("provider_deviation", "rater_deviation"),
    )
    rows = [
        [
            *level.point,
            *(part for name in names for part in level.estimates[name][:2]),
            *(None if part == float("inf") else part for part in level.anarchy),
            *level.deviations,
        ]
        for level in found
    ]
    write_csv(out / "strategic.csv", header, rows)
    cells = _rows(found, _PAGE)
    write_text(out / "strategic.md", markdown_table([*_NAMES, *_PAGE], cells, len(_NAMES)) + f"\n\n{caption}\n")
    write_figure(out / "strategic.png", finding_figure(_QUESTION, _panels(found), note), colours=256)


def _panels(found: Sequence["Level"]) -> list[Any]:
    """Return a panel for each scenario and cost: the welfare of each model by the start, and the best one."""
    from studies.plots.findings import Panel, Series

    panels = []
    for place in dict.fromkeys((level.point.scenario, level.point.cost) for level in found):
        here = [level for level in found if (level.point.scenario, level.point.cost) == place]
        starts = dict.fromkeys(level.point.start for level in here)
        series = []
        for start in starts:
            some = [level for level in here if level.point.start == start]
            series.append(
                Series(
                    _LABELS[start],
                    [one.point.model for one in some],
                    [one.estimates["welfare"].interval for one in some],
                )
            )
        panels.append(Panel(f"{place[0]}, cost {place[1]:g}", "", "welfare", series))
    return panels


def _rows(found: Sequence["Level"], columns: Sequence[str]) -> list[list[str]]:
    """Return a row for each population: its names, and the numbers of these columns."""
    rows = []
    for level in found:
        scenario, model, cost, start = level.point
        rows.append([f"{scenario}, {cost:g}", f"`{model}`", start, *(_number(level, column) for column in columns)])
    return rows


def _number(level: "Level", column: str) -> str:
    if column != _PRICE:
        return plus_minus(level.estimates[_MEASURES[column]])
    price = level.anarchy
    return "∞" if price.value == float("inf") else f"{price.value:.2f} ({price.low:.2f}, {price.high:.2f})"


if __name__ == "__main__":
    run(strategic)
