"""`roletrust rate`: whom to trust, from a log of ratings, and which trust model suits logs."""

from contextlib import nullcontext
from functools import partial
from importlib.metadata import version
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
import typer
from rich.markup import escape

from roletrust_baselines.logs.explanation import explain as explained
from roletrust_baselines.logs.explanation import find_ratee
from roletrust_baselines.logs.rounds import numbers_of
from roletrust_baselines.logs.suspects import find_suspects
from roletrust_env.data.columns import Columns
from roletrust_env.data.dialect import Dialect
from roletrust_env.data.evidence import Role, evidence, joined, window
from roletrust_env.data.log import RatingLog, read_ratings
from roletrust_env.data.rounds import check_lateness, check_rounds
from roletrust_env.data.stream import TrustStream
from roletrust_env.evaluation.specs import parse_named, parse_settings
from roletrust_env.storage.files import prepare_folder, write_csv
from roletrust_env.storage.tables import write_table
from roletrust_env.trust.model import registry
from roletrust_experiments.commands.console import console, progress_bar
from roletrust_experiments.commands.options import NAMED, OWN, Out, Seed
from roletrust_experiments.commands.rate_tables import explanation_table, ranking_table, suspects_table

_apart = attrgetter("n_late", "n_ahead", "n_repeated")  # ratings of a stream
_BLOCK = 50_000  # ratings at a time, where rounds do not depend on it
_MODEL = "leave-one-out"
_REASON = "the nearest to the next ratings of the real log of docs/real.md; the paper's is --model role-trust"


def reader(columns: Columns, labels: str | None, dialect: Dialect, **rows: Any) -> "partial[RatingLog]":
    """Return `read_ratings` with what options say of a file; it tells on the console how the file was read.

    Args:
        columns: Columns of the file.
        labels: Numbers of ratings that are texts, such as `yes=1,no=0`; None without.
        dialect: Parts of the dialect that are known.
        **rows: Options of `read_ratings` about rows.
    """
    return partial(
        read_ratings,
        columns=columns,
        labels=parse_settings(labels.split(",") if labels else (), "--labels"),
        dialect=dialect,
        tell=lambda line: console.print(escape(line), soft_wrap=True),
        **rows,
    )


def rate(
    ratings: Annotated[Path, typer.Argument(help="File of ratings, see below; with --compare, also a folder of logs.")],
    model: Annotated[
        list[str] | None,
        typer.Option(metavar=NAMED, help=f"Trust model, {_MODEL} if left out; with --compare, repeat for more. {OWN}"),
    ] = None,
    rater: Annotated[str, typer.Option(help="Column of the rater: a name, or a number from 1.")] = "rater",
    ratee: Annotated[str, typer.Option(help="Column of the rated agent.")] = "ratee",
    rating: Annotated[str, typer.Option(help="Column of the rating.")] = "rating",
    time: Annotated[str | None, typer.Option(help="Column of the time, numbers or dates.")] = None,
    scale: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="WORST BEST", help="Worst and best rating: 0 and 1, with --compare -10 and 10."),
    ] = None,
    labels: Annotated[str | None, typer.Option(help="Numbers of ratings that are texts, such as yes=1,no=0.")] = None,
    separator: Annotated[str | None, typer.Option(help="Separator, also comma, tab, semicolon, bar, blanks.")] = None,
    encoding: Annotated[str | None, typer.Option(help="Encoding, such as utf-8, utf-16 or latin-1.")] = None,
    header: Annotated[bool | None, typer.Option(help="Whether the first row has the names of the columns.")] = None,
    time_unit: Annotated[str | None, typer.Option(metavar="s|ms|us|ns", help="Unit of times that are numbers.")] = None,
    every: Annotated[float | None, typer.Option(help="Length of a round: seconds, or the unit of the time.")] = None,
    count: Annotated[int | None, typer.Option(min=1, help="Number of ratings of a round.")] = None,
    same_agents: Annotated[
        bool | None,
        typer.Option(
            "--same-agents/--two-roles", help="Whether rater and ratee of one name are one; in --compare, yes."
        ),
    ] = None,
    repeats: Annotated[bool, typer.Option("--repeats", help="Allow rows that repeat an earlier one.")] = False,
    state: Annotated[Path | None, typer.Option(help="File of earlier ratings, which takes new; with --every.")] = None,
    late: Annotated[
        Literal["drop", "count"],
        typer.Option(help="Leave out ratings of rounds that have ended, or count them in the running one."),
    ] = "drop",
    lead: Annotated[float | None, typer.Option(help="Longest time without a rating; later ones are left out.")] = None,
    missing: Annotated[bool, typer.Option("--missing", help="Leave out rows in which a value is missing.")] = False,
    tag: Annotated[str | None, typer.Option(help="Tag of the feedback events of ERC-8004 that count.")] = None,
    rank_by: Annotated[
        Literal["low", "trust"], typer.Option(help="Rank by the lower end of the interval of trust, or by trust.")
    ] = "low",
    top: Annotated[int, typer.Option(min=0, help="Number of the most and of the least trusted agents to print.")] = 5,
    explain: Annotated[str | None, typer.Option(metavar="AGENT", help="Show what makes the trust in a ratee.")] = None,
    suspects: Annotated[bool, typer.Option("--suspects", help="Look for raters that act together.")] = False,
    compare: Annotated[bool, typer.Option("--compare", help="Measure trust models on logs, see below.")] = False,
    search: Annotated[int, typer.Option(min=0, help="With --compare: attacks that a search plays for each.")] = 0,
    synthetic: Annotated[bool, typer.Option("--synthetic", help="With --compare: first write synthetic logs.")] = False,
    seed: Seed = 0,
    out: Out = Path("results/rate"),
) -> None:
    """Compute [bold]the trust of raters and ratees from a log of ratings[/], a file that you bring.

    It is CSV in any dialect, JSON lines (.jsonl) or Parquet, also in gzip (.gz). Separator, encoding, header, columns
    with common names and the unit of times are found, and a line says which; an option overrides each.

    Ratings count round by round: by time (--every), by number (--count), or all in one round. Several ratings of one
    agent by another in a round count as one, their mean. Rows may be in any order of time.

    Written: [green]ratees.csv raters.csv[/], with trust and evidence: a 95% interval, the number of ratings, of other
    agents in them, and of effectively independent ones, the last rating, the window of the log, model and version.
    First are those with the highest lower end of the interval. With --out trust.parquet both roles are one table.

    --explain shows the most important raters of an agent, and its trust without the ratings of each. --suspects shows
    groups of raters that rate the same ratees alike far beyond chance, and how far ranks move without each of them,
    beside shuffled logs, in which nobody acts together: [green]suspects.csv[/].

    With --state, rounds go on where an earlier run with this file has ended, and all agents so far are written, with
    the evidence of all ratings so far. Ratings of the running round are taken once, however often they come, unless
    --repeats is given. Those of rounds that have ended are late, also if they came before: by default they are left
    out, so a log may be the whole one or its new part; with --late count it must be its new part.

    With --compare, trust models are measured on a file, or on the logs in a folder and in the folders in it:
    forecasts, crowd work, and a few hostile accounts in a replay; one model is recommended. In a folder, a log of
    ratings is a file *network.csv or ratings.csv; crowd work is answer.csv (question, worker, answer) and truth.csv
    (question, truth). Rounds are of 30 days (--every). --search plays so many attacks for each goal, number and
    origin of accounts. By default all central models are measured, and those of neighbouring fields: all-time-mean,
    two-way-mean, fairness-goodness, bias-deserve, rev2, geometric-median and centred-clipping; on crowd work also
    dawid-skene, one-coin-dawid-skene, glad and mace, which need the extra crowd. What does not fit is left out, and a
    line says so.
    Written then: [green]comparison.csv comparison.md[/].

    [bold]Examples[/]

    [dim]# ratings from 1 to 5[/]
    [cyan]roletrust rate ratings.csv --scale 1 5[/]

    [dim]# members rate members, with rounds of 30 days[/]
    [cyan]roletrust rate log.csv.gz --same-agents --scale -10 10 --every 2592000[/]

    [dim]# two models on a synthetic log, with rounds of a week[/]
    [cyan]roletrust rate results/log --compare --synthetic --model role-trust --model beta --every 604800[/]
    """
    columns, dialect = Columns(rater, ratee, rating, time), Dialect(separator, encoding, header, time_unit)
    timed = columns if time or not (every or compare) else columns._replace(time="time")
    read = reader(timed, labels, dialect, missing=missing, tag=tag)
    if compare:
        if any(value is not None for value in (count, state, lead)):
            raise ValueError("--count, --state and --lead are not for --compare: rounds go by time there")
        from roletrust_experiments.commands import comparison

        ends, both = (-10, 10) if scale is None else scale, same_agents is not False
        comparison.compare(
            ratings,
            model,
            every=comparison.MONTH if every is None else every,
            scale=ends,
            same_agents=both,
            synthetic=synthetic,
            search=search,
            seed=seed,
            read=partial(read, scale=ends, same_agents=both, repeats=True),
            out=out,
        )
        return
    if synthetic or search or len(model or ()) > 1:
        raise ValueError("--synthetic, --search and several models need --compare")
    name = model[0] if model else _MODEL
    both = same_agents is True
    chosen: Any = parse_named(registry, name)
    check_rounds(every, count)
    check_lateness(late, lead, every)
    if state is not None and every is None:
        raise ValueError("--state needs --every: the time of a rating says whether it is new")
    if (explain is not None or suspects) and not (state is None and lead is None):
        raise ValueError("--explain and --suspects need a whole log, without --state and --lead")
    single = out.suffix == ".parquet"
    folder = out.parent if single else out
    prepare_folder(folder)
    with progress_bar() as progress:
        task = progress.add_task(f"Reading {ratings.name}", total=None)
        log = read(
            ratings,
            scale=scale or (0, 1),
            same_agents=both,
            repeats=repeats,
            every=every,
            advance=lambda rows: progress.update(task, completed=rows),
        )
        agent = None if explain is None else find_ratee(log, explain)
        many, people = len(log.values), (log.raters, log.ratees)
        settings: Any = {"every": every, "count": count, "same_agents": both, "late": late, "lead": lead}
        if state is None:
            agents = tuple(np.arange(size) for size in log.shape)
            opened: Any = nullcontext(TrustStream(chosen, agents=agents, **settings))  # type: ignore[arg-type]
        else:
            source = {"rating scale": list(scale or (0, 1)), "tag": tag}
            opened = TrustStream.opened(state, chosen, repeats=repeats, keep_evidence=True, source=source, **settings)
            people = np.array(log.rater_names, object)[log.raters], np.array(log.ratee_names, object)[log.ratees]
        progress.update(task, description="Playing rounds", completed=0, total=many)
        size = many if state or lead is not None or (every is None and count is None) else _BLOCK
        with opened as stream:
            before = _apart(stream)
            for start in range(0, many, size):
                part = slice(start, start + size)
                times = None if every is None or log.times is None else log.times[part]
                stream.update(people[0][part], people[1][part], log.values[part], times)
                progress.update(task, completed=start + size)
        stream.finish()
        if state is None:
            trusts: dict[Role, Any] = {"ratee": stream.provider_trust(), "rater": stream.rater_trust()}
            roles = {role: evidence(log, role, trust).ranked(rank_by) for role, trust in trusts.items()}
        else:
            roles = {role: stream.evidence(role).ranked(rank_by) for role in get_args(Role)}
        origin = {**window(stream.window if state else log.times), "model": name, "version": version("roletrust-env")}
        tables = {out / f"{role}s.csv": ranked.table(role, origin) for role, ranked in roles.items()}
        for path, table in ({out: joined(tables.values())} if single else tables).items():
            progress.update(task, description=f"Writing {path.name}", completed=0, total=len(table))
            write_table(path, table, lambda rows: progress.update(task, completed=rows))
        reasons = groups = None
        how: Any = {"same_agents": both, "advance": lambda n, total: progress.update(task, completed=n, total=total)}
        if agent is not None:
            progress.update(task, description=f"Explaining {explain}", completed=0)
            reasons = explained(chosen, log, numbers_of(log, every, count), agent, **how)
        if suspects:
            progress.update(task, description="Looking for suspects", completed=0)
            groups = find_suspects(chosen, log, numbers_of(log, every, count), seed=seed, **how)
    apart = [after - had for after, had in zip(_apart(stream), before, strict=True)]
    if any(apart):
        words = "{:,} ratings of rounds that had ended (--late {}), {:,} ahead by more than the lead, {:,} repeated"
        console.print(words.format(apart[0], late, *apart[1:]), soft_wrap=True)
    for role, ranked in roles.items():
        if role == "rater" and not chosen.rates_raters:
            console.print(f"{escape(name)} has no notion of trust in raters.")
        else:
            console.print(ranking_table(ranked, role, rank_by, top))
    if reasons is not None and agent is not None:
        console.print(explanation_table(reasons, log, agent, scale or (0, 1)))
    if groups is not None:
        console.print(suspects_table(groups, log))
        rows = [(n, log.rater_names[at], *one[2:]) for n, one in enumerate(groups.groups, 1) for at in one.raters]
        write_csv(folder / "suspects.csv", ("group", "rater", "shift", "apart", "shuffled", "p"), rows)
    console.print(f"Model {escape(name)}{f', {_REASON}' if model is None else ''}.", soft_wrap=True)
    written = f"Written to {out}{'' if single else ': ratees.csv, raters.csv'}"
    console.print(f"{many:,} ratings in {stream.rounds:,} rounds. {written}", soft_wrap=True)
