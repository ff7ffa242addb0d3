"""`roletrust rate`: whom to trust, from a log of ratings."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.markup import escape

from roletrust_env import make_scenario
from roletrust_env.data.log import Columns, RatingLog, read_ratings
from roletrust_env.data.rounds import check_rounds, log_rounds, play_log
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.storage.files import prepare_folder, write_csv
from roletrust_env.trust.grid_ledger import make_ledger
from roletrust_env.trust.ledger import Floats
from roletrust_experiments.commands.console import console, number_table, progress_bar
from roletrust_experiments.commands.options import ModelOption, Out


def rate(
    ratings: Annotated[
        Path, typer.Argument(help="CSV file of ratings, also in gzip (.gz), or a Parquet file (.parquet).")
    ],
    model: ModelOption = "role-trust",
    rater: Annotated[str, typer.Option(help="Column of the rater: a name, or a number from 1.")] = "rater",
    ratee: Annotated[str, typer.Option(help="Column of the rated agent.")] = "ratee",
    rating: Annotated[str, typer.Option(help="Column of the rating.")] = "rating",
    time: Annotated[
        str | None, typer.Option(help="Column of the time: numbers, or dates of ISO 8601.", show_default=False)
    ] = None,
    scale: Annotated[tuple[float, float], typer.Option(metavar="WORST BEST", help="Worst and best rating.")] = (0, 1),
    every: Annotated[
        float | None,
        typer.Option(help="Length of a round, in the unit of the time; seconds for dates.", show_default=False),
    ] = None,
    count: Annotated[int | None, typer.Option(min=1, help="Number of ratings of a round.", show_default=False)] = None,
    same_agents: Annotated[
        bool,
        typer.Option("--same-agents", help="Raters and ratees of one name are one agent."),
    ] = False,
    repeats: Annotated[
        bool, typer.Option("--repeats", help="Allow rows that repeat an earlier row, with the same time.")
    ] = False,
    top: Annotated[int, typer.Option(min=0, help="Number of the most and of the least trusted agents to print.")] = 5,
    out: Out = Path("results/rate"),
) -> None:
    """Compute [bold]the trust of raters and ratees from a log of ratings[/], a CSV or Parquet file that you bring.

    Parquet needs pyarrow, the extra parquet.

    Ratings count round by round: by time (--every), by number (--count), or all in one round. Several ratings of one
    agent by another in a round count as one, their mean. Rows may be in any order of time.

    Written: [green]ratees.csv raters.csv[/], with name, trust and number of ratings, the most trusted first.

    [bold]Examples[/]

    [dim]# ratings from 1 to 5 with a header rater,ratee,rating[/]
    [cyan]roletrust rate ratings.csv --scale 1 5[/]

    [dim]# a file without header in which members rate members, with rounds of 30 days[/]
    [cyan]roletrust rate log.csv.gz --rater 1 --ratee 2 --rating 3 --time 4 --scale -10 10 --every 2592000[/]
    """
    trust_model = parse_trust_model(model, make_scenario("paper-3x3"))
    check_rounds(every, count, has_times=time is not None)
    prepare_folder(out)
    with progress_bar() as progress:
        task = progress.add_task(f"Reading {ratings.name}", total=None)
        log = read_ratings(
            ratings,
            Columns(rater, ratee, rating, time),
            scale=scale,
            same_agents=same_agents,
            repeats=repeats,
            advance=lambda rows: progress.update(task, completed=rows),
        )
        rounds = int(log_rounds(log, every, count)[-1]) + 1
        ledger = make_ledger(trust_model, log.shape, one_role=not same_agents)
        progress.update(task, description=f"Playing {rounds:,} rounds", completed=0, total=len(log.values))
        play_log(ledger, log, every=every, count=count, advance=lambda done: progress.update(task, completed=done))
        given, received = _counts(log)
        roles = {
            "ratees": (log.ratee_names, ledger.provider_trust, received),
            "raters": (log.rater_names, ledger.rater_trust, given),
        }
        lines = {role: _ranked(*columns) for role, columns in roles.items()}
        for role, rows in lines.items():
            write_csv(out / f"{role}.csv", ("name", "trust", "ratings"), rows)
    if not log.was_sorted:
        console.print("The rows were not in the order of time; they were sorted.")
    for role, rows in lines.items():
        if role == "raters" and not trust_model.rates_raters:
            console.print(f"{escape(model)} has no notion of trust in raters.")
            continue
        _print(role, rows, top)
    written = f"Written to {out}: ratees.csv, raters.csv"
    console.print(f"{len(log.values):,} ratings in {rounds:,} rounds. {written}", soft_wrap=True)


def _counts(log: RatingLog) -> tuple[Floats, Floats]:
    """Return the number of ratings by each rater and of each ratee."""
    return tuple(np.bincount(places, minlength=n) for places, n in zip(log[:2], log.shape, strict=True))  # type: ignore[return-value]


def _ranked(names: list[str], trust: Floats, ratings: Floats) -> list[tuple[str, float, int]]:
    """Return the agents with ratings, the most trusted first, and of equals the one with the most ratings."""
    order = np.lexsort((-ratings, -trust))
    return [(names[at], float(trust[at]), int(ratings[at])) for at in order.tolist() if ratings[at]]


def _print(role: str, rows: list[tuple[str, float, int]], top: int) -> None:
    """Print the most and the least trusted agents of a role."""
    ends = dict.fromkeys([*range(min(top, len(rows))), *range(max(0, len(rows) - top), len(rows))])
    table = number_table(f"Trust of {len(rows):,} {role}", "", "rank", "trust", "ratings")
    for place in ends:
        name, trust, ratings = rows[place]
        table.add_row(escape(name), f"{place + 1:,}", f"{trust:.4f}", f"{ratings:,}")
    console.print(table)
