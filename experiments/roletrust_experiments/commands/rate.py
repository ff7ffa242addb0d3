"""`roletrust rate`: which agents to trust, from a log of ratings."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
import typer
from rich.markup import escape
from rich.progress import Progress

from roletrust_env.logs.evidence import Evidence, Role, evidence, joined, window
from roletrust_env.logs.explain import explain as explained
from roletrust_env.logs.explain import find_agent
from roletrust_env.logs.log import Log
from roletrust_env.logs.log_rounds import numbers_of, played
from roletrust_env.logs.models import make_log_model
from roletrust_env.logs.stream import TrustStream
from roletrust_env.logs.suspects import find_suspects
from roletrust_env.storage.files import prepare_folder, write_csv
from roletrust_env.storage.tables import write_table
from roletrust_experiments.commands.console import console, progress_bar, stage, tell
from roletrust_experiments.commands.log_options import LogOptions
from roletrust_experiments.commands.options import NAMED, OWN, Out, Seed, with_options
from roletrust_experiments.commands.rate_tables import (
    explanation_table,
    ranking_table,
    suspects_table,
)

_apart = attrgetter("n_late", "n_ahead", "n_repeated")  # ratings of a stream
_ROLES: tuple[Role, ...] = get_args(Role)
_MODEL = "leave-one-out"
_REASON = (
    "the nearest to the next ratings of the real log of docs/real.md; the paper's is --model "
    "role-trust"
)
_WHOLE = "a whole log, without --state and --lead"
_evidence, _state = (
    partial(typer.Option, rich_help_panel=panel) for panel in ("Evidence", "State")
)


@with_options(LogOptions)
def rate(
    ratings: Annotated[
        Path,
        typer.Argument(help="File of ratings, see above."),
    ],
    reading: LogOptions,
    model: Annotated[str, typer.Option(metavar=NAMED, help=f"Trust model. {OWN}")] = _MODEL,
    trusted: Annotated[
        list[str] | None,
        typer.Option(
            metavar="AGENT",
            help="Rater that is trusted beforehand, by models with seeds; repeat for more.",
        ),
    ] = None,
    rank_by: Annotated[
        Literal["low", "trust"],
        _evidence(help="Rank by the lower end of the interval of trust, or by trust."),
    ] = "low",
    top: Annotated[
        int, _evidence(min=0, help="Number of the most and of the least trusted agents to print.")
    ] = 5,
    explain: Annotated[
        str | None, _evidence(metavar="AGENT", help="Show what makes the trust in an agent.")
    ] = None,
    suspects: Annotated[
        bool, _evidence("--suspects", help="Look for raters that act together.")
    ] = False,
    state: Annotated[
        Path | None, _state(help="File of earlier ratings, which takes new; with --every.")
    ] = None,
    lead: Annotated[
        float | None, _state(help="Longest time without a rating; later ones are left out.")
    ] = None,
    seed: Seed = 0,
    out: Out = Path("results/rate"),
) -> None:
    """Compute [bold]the trust of raters and ratees from a log of ratings[/], a file that you bring.

    It is CSV, JSON, Parquet (also a folder), Feather, SQLite or xlsx; a text may be packed (.gz,
    .xz, .zip). Columns with usual names are found; otherwise --columns names them. --read says more
    about the file, such as header=false, decimal=, or time_unit=ms.

    Ratings count round by round, by time (--every), or all in one round. Several ratings of one
    agent by another in a round count as one, their mean. Rows may be in any order of time.

    Written: [green]ratees.csv raters.csv[/], with trust and evidence: a 95% interval, the number of
    ratings, of other agents in them, and of effectively independent ones, the last rating, the
    window of the log, model and version. First are those with the highest lower end of the
    interval. With --out trust.parquet both roles are one table.

    --explain shows the most important raters of an agent, and its trust without the ratings of
    each; of a rater, its ratings that agree and differ most with the trust in those that it rates,
    and its trust without each. --suspects shows groups of raters that rate the same ratees alike
    far beyond chance, and how far ranks move without each of them, beside shuffled logs, in which
    nobody acts together: [green]suspects.csv[/].

    With --state, rounds go on where an earlier run with this file has ended, and all agents so far
    are written, with the evidence of all ratings so far. Ratings of the running round are taken
    once, however often they come, unless --read repeats=true is given. Those of rounds that have
    ended are late, also if they came before. They are left out, so a log may be the whole one or
    its new part.

    [bold]Examples[/]

    [dim]# ratings from 1 to 5[/]
    [cyan]roletrust rate ratings.csv --scale 1 5[/]

    [dim]# members rate members, with rounds of 30 days[/]
    [cyan]roletrust rate log.csv.gz --same-agents --scale -10 10 --every 2592000[/]
    """
    every, state_or_lead, single = (
        reading.every,
        not (state is None and lead is None),
        out.suffix == ".parquet",
    )
    folder = out.parent if single else out
    tables = [out] if single else [out / f"{name}s.csv" for name in _ROLES]
    own = {path.resolve() for path in (ratings, state) if path}
    targets = [path.resolve() for path in (*tables, folder / "suspects.csv")]
    for wrong, words in (
        (
            any(own & {path, *path.parents} for path in targets),
            f"--out {out} would write to the log or the state",
        ),
        (single and out.is_dir(), f"--out {out} is a folder; a table needs another name"),
        (trusted and state, "--trusted needs a whole log, without --state"),
        (
            state and every is None,
            "--state needs --every: the time of a rating says whether it is new",
        ),
        (
            (explain is not None or suspects) and state_or_lead,
            f"--explain and --suspects need {_WHOLE}",
        ),
    ):
        if wrong:
            raise ValueError(words)
    chosen: Any = make_log_model(model)
    if trusted and not hasattr(chosen, "seeds"):
        raise ValueError(
            f"{model} has no seeds, as --trusted needs; merit-rank and personalized-pagerank have"
        )
    prepare_folder(folder)
    rounds: Any = {"every": every, "same_agents": reading.same_agents, "lead": lead}
    with progress_bar() as progress:
        stage(progress, f"Reading {ratings.name}")
        log = reading.log(ratings)
        if trusted:
            chosen = replace(
                chosen,
                seeds=tuple(
                    find_agent(log, trusted_name, ("rater",))["rater"] for trusted_name in trusted
                ),
            )
        roles = {} if explain is None else find_agent(log, explain)
        advance = stage(progress, "Playing rounds")
        pairs = None if state else log.pairs()
        if state_or_lead:
            run: Any = _stream(chosen, log, state, reading, rounds)
            trusts = [
                np.array(list(read_trust().values()))
                for read_trust in (run.provider_trust, run.rater_trust)
            ]
        else:
            run = played(chosen, log, numbers_of(log, every), pairs=pairs, advance=advance)
            trusts = [run.provider_trust, run.rater_trust]
        origin = {
            **window(run.window if state else log.times),
            "model": model,
            "version": version("roletrust-env"),
        }

        def ranked(role: Role, trust: Any) -> Evidence:
            return (evidence(log, role, trust, pairs) if pairs else run.evidence(role)).ranked(
                rank_by
            )

        with (
            ThreadPoolExecutor() as pool
        ):  # pyarrow and NumPy sort and write two tables beside each other
            evidence_of = dict(zip(_ROLES, pool.map(ranked, _ROLES, trusts), strict=True))
            written = _write(out, evidence_of, origin, progress, pool)
        for role, role_evidence in evidence_of.items():
            unknown = role == "rater" and not chosen.rates_raters
            console.print(
                f"{escape(model)} has no notion of trust in raters."
                if unknown
                else ranking_table(role_evidence, role, rank_by, top)
            )
        for role, agent in roles.items():
            if role == "ratee" or chosen.rates_raters:
                advance = stage(progress, f"Explaining trust in the {role} {explain}")
                reasons = explained(
                    chosen, log, numbers_of(log, every), role, agent, advance=advance
                )
                console.print(explanation_table(reasons, log, reading.scale))
        if suspects:
            advance = stage(progress, "Looking for suspects")
            groups = find_suspects(chosen, log, numbers_of(log, every), seed=seed, advance=advance)
            console.print(suspects_table(groups, log))
            rows = [
                (n, log.rater_names[at], *group[2:])
                for n, group in enumerate(groups.groups, 1)
                for at in group.raters
            ]
            written += ", suspects.csv"
            write_csv(
                folder / "suspects.csv", ("group", "rater", "shift", "apart", "shuffled", "p"), rows
            )
    tell(f"Model {model}{f', {_REASON}' if model == _MODEL else ''}.")
    tell(
        f"{len(log.values):,} ratings in {run.rounds:,} round{'s' * (run.rounds != 1)}. Written to "
        f"{written}"
    )
    if explain is None and not suspects and not state_or_lead:
        tell(
            "--explain AGENT shows what makes the trust in an agent; --suspects, which raters act "
            "together."
        )


def _stream(
    model: Any, log: Log, state: Path | None, reading: LogOptions, rounds: dict[str, Any]
) -> TrustStream:
    """Return a stream that has played a log, after the earlier ratings of a state, and print which
    were left out.
    """
    if state is None:
        agents: Any = tuple(np.arange(size) for size in log.shape)
        people: Any = log.raters, log.ratees
        opened: AbstractContextManager[TrustStream] = nullcontext(
            TrustStream(model, agents=agents, **rounds)
        )
    else:
        names = (np.array(list(names), object) for names in (log.rater_names, log.ratee_names))
        people = next(names)[log.raters], next(names)[log.ratees]
        stream_settings: Any = {
            "repeats": reading.reading().repeats,
            "keep_evidence": True,
            "source": reading.source(),
        }
        opened = TrustStream.opened(state, model, **stream_settings, **rounds)
    with opened as stream:
        before = _apart(stream)
        times = None if log.times is None else log.times.view("datetime64[ns]")
        stream.update(people[0], people[1], log.values, times)
    stream.finish()
    if any(apart := [after - had for after, had in zip(_apart(stream), before, strict=True)]):
        words = (
            "{:,} ratings of rounds that had ended, {:,} ahead by more than the lead, {:,} repeated"
        )
        tell(words.format(*apart))
    return stream


def _write(
    out: Path,
    evidence_of: dict[Role, Evidence],
    origin: dict[str, str],
    progress: Progress,
    pool: ThreadPoolExecutor,
) -> str:
    """Write the tables of both roles, in one file if it is a Parquet file, and return what was
    written.
    """
    tables = {
        out / f"{role}s.csv": role_evidence.table(role, origin)
        for role, role_evidence in evidence_of.items()
    }
    names = ", ".join(path.name for path in tables)
    if single := out.suffix == ".parquet":
        tables = {out: joined(tables.values())}
    stage(progress, "Writing", sum(map(len, tables.values())))
    advance = partial(progress.advance, progress.task_ids[-1])
    list(pool.map(partial(write_table, advance=advance), tables, tables.values()))
    return str(out) if single else f"{out}: {names}"
