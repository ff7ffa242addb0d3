"""`roletrust audit`: the price of manipulating the ranking of a log."""

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from roletrust_env.logs.audit import AuditReport
from roletrust_env.logs.audit import audit as audit_log
from roletrust_env.logs.audit_ranking import Journal, Prices
from roletrust_env.logs.compare import MONTH
from roletrust_env.logs.models import make_log_model
from roletrust_env.logs.rate import MODEL
from roletrust_env.storage.files import prepare_folder, write_text
from roletrust_env.trust.remote import RemoteModel
from roletrust_experiments.commands.console import (
    console,
    number_table,
    progress_bar,
    shown,
    stage,
    tell,
)
from roletrust_experiments.commands.log_options import (
    LogSettings,
    Ratings,
    Scale,
    log_arguments,
    read,
)
from roletrust_experiments.commands.options import NAMED, OWN, Out
from roletrust_experiments.plots.figure_files import write_figure
from roletrust_experiments.report.audit import WORDS, amount, audit_figure, audit_page

_SHOWN = 3  # most targets of each goal in the table, and at the border of the top


def audit(
    ratings: Ratings,
    scale: Scale = (0.0, 1.0),
    every: Annotated[float, typer.Option(help="Length of a round in seconds.")] = MONTH,
    settings: LogSettings = None,
    model: Annotated[
        str,
        typer.Option(metavar=NAMED, help=f"Trust model, or exec:COMMAND or a URL. {OWN}"),
    ] = MODEL,
    target: Annotated[
        list[str] | None,
        typer.Option(
            metavar="AGENT", help="Agent to push, in place of all others; repeat for more."
        ),
    ] = None,
    top: Annotated[int, typer.Option(min=1, help="Number of agents in the top.")] = 10,
    prices: Annotated[
        str,
        typer.Option(
            metavar="KEY=PRICE,...",
            help="Prices of a new account, a hijacked account, a rating, and a day; in any "
            "currency.",
        ),
    ] = "account=1,hijacked=10,rating=0.1,day=0",
    budget: Annotated[
        int, typer.Option(min=1, help="Number of attacks that a search plays for each target.")
    ] = 400,
    out: Out = Path("results/audit"),
) -> None:
    """Find [bold]the price of manipulating the ranking of a log[/]: how many accounts and ratings
    push an agent out of the top, or into it.

    Hostile accounts add ratings to the last twelve rounds of the log. Targets are each agent of
    the top, ten agents that are drawn below it, and an unrated one. For each, the output
    has a lower and an upper bound of the price. For mean, median, trimmed-mean and all-time-mean
    the cheapest attack is computed. For other models a search finds the upper bound, and a larger
    --budget continues a smaller one. Targets at the border of the top are always cheap, so they are
    listed apart, and medians leave them out.

    Written: [green]audit.html[/], the page with the share of targets by price, which
    [green]audit.png[/] has; [green]audit.json[/], all numbers and every rating of the cheapest
    attacks.

    [bold]Examples[/]

    [dim]# members rate members from -10 to 10[/]
    [cyan]roletrust audit log.csv.gz --set same_agents=true --scale -10 10[/]

    [dim]# a model of your own; an account costs 2, a rating 5[/]
    [cyan]roletrust audit log.csv --model exec:./my-score --prices account=2,rating=5[/]
    """
    paid = Prices.parsed(prices)
    chosen = make_log_model(model)
    prepare_folder(out)
    journal = Journal(out / "audit.journal") if isinstance(chosen, RemoteModel) else None
    if journal and journal.known:
        tell(f"{len(journal.known):,} attacks of an interrupted audit are in {journal.path}")
    log = read(ratings, log_arguments(settings, scale))
    with progress_bar(counted=False) as progress:
        report = audit_log(
            log,
            model=model,
            every=every,
            prices=paid,
            top=top,
            named=target or (),
            budget=budget,
            journal=journal,
            advance=stage(progress, f"Attacking {model}", 1),
            name=ratings.name,
        )
    write_text(out / "audit.json", report.json().decode() + "\n")
    write_figure(out / "audit.png", audit_figure(report), colours=256)
    write_text(out / "audit.html", audit_page(report, (out / "audit.png").read_bytes()))
    if journal:
        journal.path.unlink(missing_ok=True)
    console.print(_table(report))
    tell(f"{report.played:,} attacks. Written to {out}: audit.html, audit.png, audit.json")


def _table(report: AuditReport) -> Table:
    """Return the targets with their bounds as a table of 80 columns."""
    title = (
        f"Prices of attacks on {escape(report.model)}, top {report.top} of {report.ranked:,} agents"
    )
    caption = (
        f"price: {report.prices.account:g} for a new account, {report.prices.rating:g} for a "
        "rating; lower, upper: bounds of the cheapest price; accounts, sent, days: of the attack "
        "with the upper bound; *: at the border of the top, which medians leave out"
    )
    headings = ("rank", "lower", "upper", "gap", "accounts", "sent", "days")
    table = number_table(title, caption, *headings, name="target")
    for goal, median in report.medians.items():
        table.add_row(f"[bold]{WORDS[goal]}, median[/]", "", "", f"[bold]{amount(median.value)}[/]")
        for border in (False, True):
            listed = [one for one in report.exposures if (one.goal, one.border) == (goal, border)]
            for one in listed[:_SHOWN]:
                bounds = map(amount, (one.lower, one.upper, one.gap))
                sent = (f"{one.accounts}", f"{len(one.sent)}", amount(one.days)) if one.sent else ()
                name = f"  {shown(one.agent) or 'unrated'}{' *' * border}"
                table.add_row(name, f"{one.rank:,}", *bounds, *sent)
            if len(listed) > _SHOWN:
                table.add_row(f"  {len(listed) - _SHOWN} more on the page")
    return table
