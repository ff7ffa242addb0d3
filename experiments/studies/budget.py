"""`python -m studies.budget`: the worst case that each way to attack finds, by the rounds that it may play."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.metrics.confidence import Estimate
from roletrust_env.storage.files import prepare_folder, write_csv, write_text
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.storage.provenance import describe, software
from roletrust_experiments.commands import completion
from roletrust_experiments.commands.console import console, number_table, option, print_next
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import (
    NAMED,
    Again,
    ConditionScenario,
    ConditionShare,
    ConditionSuite,
    ConditionTrack,
    FreshGames,
    Out,
    Searches,
    Seed,
    Workers,
)
from roletrust_experiments.plots.figure_files import write_figure
from studies.attackers.budget import (
    BUDGETS,
    MODELS,
    WAYS,
    Kept,
    Level,
    Point,
    known_ways,
    left_out,
    levels,
    play_point,
    points,
)
from studies.attackers.condition import Condition
from studies.attackers.runs import Run, of_kind, read_runs
from studies.played import play_and_keep
from studies.running import run

_HEADER = ("model", "way", "budget", "seed", "utility", "rounds", "seconds", "attack", "left_out")


def budget(
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar=NAMED,
            help=f"Trust model; repeat for more; {', '.join(MODELS)} if left out. NAME may be your own class, "
            "package.module:Class, whose module is then imported.",
            autocompletion=completion.models,
            show_default=False,
        ),
    ] = None,
    way: Annotated[
        list[str] | None,
        typer.Option(
            metavar=NAMED,
            help=f"Way to attack: scripts, or a search method; repeat for more; {', '.join(WAYS)} if left out, as far "
            "as they are installed.",
            autocompletion=completion.ways,
            show_default=False,
        ),
    ] = None,
    budget: Annotated[
        list[int] | None,
        typer.Option(
            min=1,
            help=f"Rounds x games that a search may play; repeat for more; {', '.join(map(str, BUDGETS))} if left out.",
            show_default=False,
        ),
    ] = None,
    suite: ConditionSuite = "two-worlds",
    stage: ConditionScenario = "crowd",
    track: ConditionTrack = "coalition",
    share: ConditionShare = 0.3,
    games: FreshGames = 200,
    seed: Seed = 0,
    runs: Searches = 3,
    workers: Workers = None,
    force: Again = False,
    out: Out = Path("results/budget"),
) -> None:
    """Show [bold]how much worse the worst case gets[/] for a trust model if its attacker may search longer.

    Each way to attack searches with each budget of game rounds. The attack that it finds is measured in fresh games,
    the same ones for all ways: the utility of a consumer that goes to the most trusted provider, as a share of the best
    possible. Lower is a better attack. The interval is over the runs.

    scripts: the best of all scripted attacks at their defaults; its rounds are those that choose it. A search that does
    not suit a budget is left out, and a line says why. Learners on torch get at most 100,000 rounds.

    Each run is saved when it is finished, so that an interrupted command continues when it is given again, also with
    more models, ways, budgets or runs. Seconds are those of the search alone; other processes make them longer.

    Written: [green]budget.png budget.md budget.csv budget.json[/].

    [bold]Examples[/]

    [dim]# six models and eight ways with up to two million rounds, in hours[/]
    [cyan]python -m studies.budget[/]

    [dim]# one model, two ways, small budgets, in a minute[/]
    [cyan]python -m studies.budget --model beta --way scripts --way evolution --budget 50000 --budget 100000 --runs 1[/]

    [dim]# your own model where half of the raters lie[/]
    [cyan]python -m studies.budget --model mypackage.mymodel:MyModel --track raters --share 0.5[/]
    """
    require("the budgets", "train", "scipy", "cma", "torch", "stable_baselines3", "safetensors")
    condition = Condition.of(suite, stage, track, share)
    models, ways = list(dict.fromkeys(model or MODELS)), known_ways(way)
    condition.check(models)
    searches = points(models, ways, sorted(set(budget or BUDGETS)), range(seed, seed + runs))
    settings = {"command": "python -m studies.budget", "condition": condition.describe(), "games": games, **software()}
    path = out / "budget.json"
    kept = {} if force else read_runs(path, settings, of_kind(Kept))
    prepare_folder(out)
    jobs = {point.key: (condition, point, games) for point in searches if point.key not in kept}
    failed = play_and_keep(play_point, jobs, kept, total=len(searches), workers=workers, settings=settings, path=path)
    found, reasons = levels(searches, kept), list(left_out(searches, kept))
    for reason in reasons:
        console.print(f"[dark_orange3]left out:[/] {escape(reason)}", soft_wrap=True)
    if not found:
        raise ValueError("no search was played, so there is nothing to show; give other ways or larger budgets")
    caption = (
        f"Utility of the consumer in {games} fresh games, mean ± half the 95% interval over the runs ({runs}); in "
        f"brackets the seconds of a search. Lower is a better attack. Condition: {condition}."
    )
    _write(out, condition, found, searches, kept, caption, reasons)
    _print(found)
    console.print(escape(caption), soft_wrap=True)
    console.print(f"Written to {out}: budget.png, budget.md, budget.csv, budget.json", soft_wrap=True)
    chosen = [*option("--suite", suite, "two-worlds"), *option("--scenario", stage, "crowd")]
    print_next("transfer", option("--model", model), chosen)
    if failed:
        raise typer.Exit(1)


def _write(
    out: Path,
    condition: Condition,
    found: Sequence[Level],
    searches: Sequence[Point],
    runs: dict[str, Run],
    caption: str,
    reasons: Sequence[str],
) -> None:
    from studies.plots.attackers import budget_figure

    write_csv(out / "budget.csv", _HEADER, [_line(point, runs[point.key]) for point in searches if point.key in runs])
    write_figure(
        out / "budget.png",
        budget_figure(
            f"Worst case by rounds of the search ({condition})",
            found,
            "lower is a better attack; bands are 95% intervals over the runs",
        ),
    )
    names = dict.fromkeys(level.model for level in found)
    parts = [markdown_table(*_table(found), names=2), caption]
    if reasons:
        parts.append("\n".join(f"- Left out: {reason}." for reason in reasons))
    made = "; ".join(f"`{name}` is `{_made(name, condition)}`" for name in names)
    parts.append(
        f"Trust models: {made}. Written by `python -m studies.budget`; `budget.json` has the settings and the software."
    )
    write_text(out / "budget.md", "\n\n".join(parts) + "\n")


def _made(name: str, condition: Condition) -> str:
    """Return the class and the parameters of a trust model in the condition."""
    made = describe(parse_trust_model(name, condition.arguments(name)["scenario"]))
    parameters = ", ".join(f"{key}={value}" for key, value in made["parameters"].items())
    return f"{made['class'].rpartition('.')[2]}({parameters})"


def _line(point: Point, run: Run) -> tuple[Any, ...]:
    return (*point, *(run.get(field) for field in _HEADER[len(point) :]))


def _table(found: Sequence[Level]) -> tuple[list[str], list[list[str]]]:
    """Return the headings, and a row for each model and way; scripts stand at the first budget that covers them."""
    budgets = sorted({level.budget for level in found if level.budget}) or [max(level.rounds for level in found)]
    rows: dict[tuple[str, str], list[str]] = {}
    for level in found:
        name = level.way if level.budget else f"{level.way}, {level.rounds:,} rounds"
        cells = rows.setdefault((level.model, name), ["-"] * len(budgets))
        at = next((k for k, limit in enumerate(budgets) if limit >= level.at), len(budgets) - 1)
        cells[at] = f"{amount(level.utility)} ({level.seconds:,.0f} s)"
    return ["model", "way", *(f"{limit:,}" for limit in budgets)], [[*names, *row] for names, row in rows.items()]


def _print(found: Sequence[Level]) -> None:
    headings, rows = _table(found)
    table = number_table("Worst case by rounds of the search", "", *headings[2:])
    for model, way, *numbers in rows:
        table.add_row(escape(f"{model}: {way}"), *numbers)
    console.print(table)


def amount(value: Estimate) -> str:
    """Return a mean with half of its interval, if it has one.

    Example:
        >>> amount(Estimate(0.51234, 0.021)), amount(Estimate(0.5, float("nan")))
        ('0.512 ± 0.021', '0.500')
    """
    return f"{value.mean:.3f}" + (f" ± {value.half:.3f}" if value.half == value.half else "")


if __name__ == "__main__":
    run(budget)
