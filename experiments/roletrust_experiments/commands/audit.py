"""`roletrust audit`: how cheaply the ranking of a log is pushed."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, Literal

import typer
from rich.markup import escape
from rich.table import Table

from roletrust_env.logs.audit import (
    SHORT,
    AuditReport,
    Comparison,
    attack_count,
    audit_model,
    compare_models,
)
from roletrust_env.logs.audit_ranking import ACCOUNTS, GOALS, Journal, Plan, Prices, Ranking
from roletrust_env.logs.models import make_log_model
from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.files import prepare_folder, write_json, write_text
from roletrust_env.trust import Traits, make_trust_model, trust_models
from roletrust_env.trust.outside import OutsideModel
from roletrust_experiments.commands.console import (
    console,
    number_table,
    progress_bar,
    shown,
    stage,
    tell,
)
from roletrust_experiments.commands.log_options import MONTH, LogOptions
from roletrust_experiments.commands.options import NAMED, OWN, Out, Seed, with_options
from roletrust_experiments.plots.figure_files import write_figure
from roletrust_experiments.report.audit import WORDS, audit_figure, audit_page

_OTHERS = 3  # models beside the audited one
_DEAR = 1e12  # the highest price
_SHOWN = 3  # most exposed agents of each goal


@with_options(LogOptions)
def audit(
    ratings: Annotated[
        Path, typer.Argument(help="File of ratings with times, as for `roletrust rate`.")
    ],
    reading: LogOptions,
    model: Annotated[
        str,
        typer.Option(
            "--model",
            "--scorer",
            metavar=NAMED,
            help=f"Trust model, or exec:COMMAND or a URL. {OWN}",
        ),
    ] = "leave-one-out",
    other: Annotated[
        list[str] | None,
        typer.Option(
            metavar=NAMED,
            help="Model to compare; repeat for more. If left out, the three that forecast best.",
        ),
    ] = None,
    alone: Annotated[bool, typer.Option("--alone", help="Compare with no other model.")] = False,
    rank_by: Annotated[
        Literal["low", "trust"],
        typer.Option(help="Rank by the lower end of the interval of trust, or by trust."),
    ] = "low",
    top: Annotated[int, typer.Option(min=1, help="Number of agents in the top.")] = 10,
    target: Annotated[
        list[str] | None,
        typer.Option(
            metavar="AGENT", help="Agent to push, in place of all others; repeat for more."
        ),
    ] = None,
    targets: Annotated[
        int, typer.Option(min=1, help="Number of targets that are drawn below the top.")
    ] = 10,
    budget: Annotated[
        int, typer.Option(min=1, help="Number of attacks that a search plays for each target.")
    ] = 120,
    price_account: Annotated[float, typer.Option(min=0, help="Price of a new account.")] = 1.0,
    price_hijacked: Annotated[
        float, typer.Option(min=0, help="Price of an active rater's account.")
    ] = 10.0,
    price_rating: Annotated[float, typer.Option(min=0, help="Price of a rating.")] = 0.1,
    price_day: Annotated[
        float, typer.Option(min=0, help="Price of a day from the first rating to the end.")
    ] = 0.0,
    fail_below: Annotated[
        float | None, typer.Option(help="Exit with code 1 if the median price of a goal is lower.")
    ] = None,
    seed: Seed = 0,
    out: Out = Path("results/audit"),
) -> None:
    """Find [bold]how cheaply the ranking of a log is pushed[/]: by which accounts and ratings, and
    at what price.

    Hostile accounts join the last twelve rounds of the log, beside its ratings: new ones, aged
    ones, which first rate others, and hijacked ones of active raters. A search looks for the
    cheapest attack that pushes a target out of the top, or into it: each agent of the top, agents
    that are drawn below it, and one that nobody has rated. It knows the log and sees the ranks, and
    there may be a cheaper attack. A second search from the next seed shows its chance.

    Prices may be in any currency; by default a new account is the unit. A goal fails (--fail-below)
    by the median price of its targets, since the last of the top and the first below it are always
    cheap.

    Written: [green]audit.html[/], the page with the curve of effect against price, which
    [green]audit.png[/] has; [green]audit.json[/], all numbers and every rating of the cheapest
    attacks; [green]audit.schema.json[/], its JSON Schema. Columns and dialect of the file are found
    as by `roletrust rate`, with the same options.

    [bold]Examples[/]

    [dim]# members rate members from -10 to 10[/]
    [cyan]roletrust audit log.csv.gz --same-agents --scale -10 10[/]

    [dim]# would another model resist more?[/]
    [cyan]roletrust audit log.csv.gz --other mean --other role-trust[/]

    [dim]# in CI, a scorer of your own: accounts cost 2, ratings 5, and no goal may cost less than
    100[/]
    [cyan]roletrust audit log.csv --scorer exec:./my-score --price-account 2 --price-rating 5
    --fail-below 100[/]
    """
    if not all(
        abs(price) <= _DEAR
        for price in (price_account, price_hijacked, price_rating, price_day, fail_below or 0)
    ):
        raise ValueError(f"prices and --fail-below must be numbers up to {_DEAR:g}")
    if alone and other:
        raise ValueError("--alone compares with no model, and --other with some")
    prices, chosen = (
        Prices(price_account, price_hijacked, price_rating, price_day),
        make_log_model(model),
    )
    others = {name: make_log_model(name) for name in other or ()}
    prepare_folder(out)
    every = MONTH if reading.every is None else reading.every
    journal = Journal(out / "audit.journal") if isinstance(chosen, OutsideModel) else None
    if journal and journal.known:
        tell(
            f"{len(journal.known):,} attacks are known from an interrupted audit, see "
            f"{journal.path}"
        )
    with progress_bar(counted=False) as progress:
        stage(progress, f"Reading {ratings.name}")
        log = replace(reading, every=every).log(ratings)
        settings: Any = {"same_agents": reading.same_agents, "top": top, "rank_by": rank_by}
        ranking = Ranking(chosen, log, every, journal=journal, **settings)
        if journal and not journal.known:
            begun = perf_counter()
            ranking.play(ranking.targets(targets, seed, target or ())[0], Plan(), prices)
            _estimate(
                model,
                perf_counter() - begun,
                attack_count(len(target or ()) or top + targets + 1, budget, 2),
            )
        advance, seeds = stage(progress, f"Attacking {model}", 1), (seed, seed + 1)
        audited = audit_model(
            ranking,
            prices,
            targets=targets,
            named=target or (),
            budget=budget,
            seeds=seeds,
            advance=advance,
        )
        compared, step = dict[str, Comparison](), stage(progress, "Comparing with other models", 1)
        if not alone:
            models, most = (others, len(others)) if others else (_quick_models(), _OTHERS)
            compared = compare_models(
                ranking, model, models, prices, targets=targets, seed=seed, most=most, advance=step
            )
    many = len(log.values)
    report = AuditReport(
        ratings.name, many, every, top, rank_by, prices, budget, seeds, model, audited, compared
    )
    write_text(out / "audit.json", report.json().decode() + "\n")
    write_json(out / "audit.schema.json", report.schema())
    write_figure(out / "audit.png", audit_figure(report), colours=256)
    write_text(out / "audit.html", audit_page(report, (out / "audit.png").read_bytes()))
    if journal:
        journal.path.unlink(missing_ok=True)
    for table in _tables(report):
        console.print(table)
    far = f", and prices at most {audited.apart:.0%} apart" if audited.apart > 0 else ""
    summary = (
        f"{audited.played:,} attacks; both searches found the same price for "
        f"{audited.agreement:.0%} of the targets{far}"
    )
    tell(f"{summary}. Written to {out}: audit.html, audit.png, audit.json, audit.schema.json")
    low = min(median.value for median in audited.medians.values())
    if fail_below is not None and low < fail_below:
        console.print(
            f"[bold red]Failed:[/] a median price is {low:g}, below {fail_below:g}", soft_wrap=True
        )
        raise typer.Exit(1)


def _estimate(model: str, seconds: float, attacks: int) -> None:
    """Say how long an audit of a model outside may take."""
    length = (
        f"{seconds * attacks / 60:,.0f} minutes"
        if seconds * attacks > 120
        else f"{seconds * attacks:,.0f} s"
    )
    estimate = (
        f"{model} takes {seconds:.2g} s for an attack; up to {attacks:,} attacks take about "
        f"{length}"
    )
    tell(f"{estimate}. --budget and --targets make them fewer.")


def _quick_models() -> dict[str, Any]:
    """Return the central models that update what a round touches alone: an attack takes them little
    time.
    """
    models = {name: make_trust_model(name) for name in trust_models()}
    traits = {name: Traits.of(model) for name, model in models.items()}
    return {
        name: models[name]
        for name, traits_of_model in traits.items()
        if traits_of_model.family == "central" and (traits_of_model.local or traits_of_model.nearby)
    }


def _tables(report: AuditReport) -> list[Table]:
    """Return what is found about a model, and models beside each other, as tables of 80 columns."""
    model, audited = report.model, report.audit
    title = (
        f"Cheapest attacks found on {escape(model)}, top {report.top} of {audited.ranked:,} agents"
    )
    account, rating = report.prices.account, report.prices.rating
    caption = (
        f"price: {account:g} for a new account, {rating:g} for a rating; rank, ratings: of the "
        "target; accounts, sent, "
        "days: accounts and ratings of the attack, and the days that it takes"
    )
    cheap = number_table(
        title, caption, "rank", "ratings", "price", "accounts", "sent", "days", name="target"
    )
    for goal, median in audited.medians.items():
        whole = [exposure for exposure in audited.exposures if exposure.goal == goal]
        of = f", median of {len(whole)}" if len(whole) > 1 else ""
        cheap.add_row(f"[bold]{WORDS[goal]}{of}[/]", "", "", _cell(median, _amount))
        for exposure in whole[:_SHOWN]:
            best = exposure.cheapest
            cells = (f"{best.accounts}", f"{best.ratings}", _days(best.days)) if best else ()
            agent = shown(exposure.agent) or "nobody has rated"
            cheap.add_row(
                f"  {agent}",
                f"{exposure.rank:,}",
                f"{exposure.ratings:,}",
                _amount(exposure.price),
                *cells,
            )
    moved = number_table(
        "Mean number of ranks that accounts move a target", "", *map(str, ACCOUNTS), name="accounts"
    )
    for goal, origin in dict.fromkeys(
        (movement.goal, movement.origin) for movement in audited.movements
    ):
        line = [
            movement.places
            for movement in audited.movements
            if (movement.goal, movement.origin) == (goal, origin)
        ]
        moved.add_row(
            f"{WORDS[goal]}, {origin}", *(_cell(place, "{:,.0f}".format) for place in line)
        )
    if not report.compared:
        return [cheap, moved]
    title = f"Median price in {SHORT} attacks, and correlation r of trust with the next rating"
    beside = number_table(title, "", *(WORDS[goal] for goal in GOALS), "r", name="model")
    for name, both in report.compared.items():
        costs = [_cell(both.medians[goal], _amount) for goal in GOALS]
        beside.add_row(escape(name), *costs, _cell(both.forecast["r"], "{:.3f}".format))
    return [cheap, moved, beside]


def _days(days: float) -> str:
    return "" if math.isnan(days) else f"{days:,.0f}" if days >= 10 else f"{days:.2g}"


def _amount(price: float) -> str:
    return "none" if math.isinf(price) else f"{price:,.4g}"


def _cell(value: Interval, form: Callable[[float], str]) -> str:
    """Return a value with its interval below it."""
    ends = "" if math.isnan(value.low) else f"\n({form(value.low)}, {form(value.high)})"
    return form(value.value) + ends
