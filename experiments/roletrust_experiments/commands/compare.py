"""`roletrust compare`: which trust model suits a log of ratings."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from roletrust_env.logs.decision import Decision, Evaluated, decide
from roletrust_env.logs.folders import find_logs, write_log
from roletrust_env.logs.measures import Protocols, Row, markdown, measure_tables
from roletrust_env.logs.models import LOG_MODELS, make_log_model
from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.files import prepare_folder, write_csv, write_text
from roletrust_env.trust import Traits, make_trust_model, trust_models
from roletrust_experiments.commands.console import (
    console,
    number_table,
    progress_bar,
    shown,
    tell,
    tell_left_out,
)
from roletrust_experiments.commands.log_options import MONTH, LogOptions
from roletrust_experiments.commands.options import NAMED, OWN, Out, Seed, with_options

_HEADINGS = ("forecast", "difference", "kept")
_CAPTION = (
    "forecast: r of trust with the next ratings of agents that have earlier ones; difference: to "
    "the best, paired; kept: of 1, under the worst of the attacks by hostile accounts; all with "
    "95% intervals"
)
HEADER = ("log", "sha256", "round", "protocol", "model", "measure", "value", "low", "high")


@with_options(LogOptions)
def compare(
    logs: Annotated[
        Path,
        typer.Argument(
            help="File of ratings with times, as for `roletrust rate`; or a folder of logs."
        ),
    ],
    reading: LogOptions,
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar=NAMED,
            help=f"Trust model; repeat for more; all central ones if left out. {OWN}",
        ),
    ] = None,
    synthetic: Annotated[
        bool,
        typer.Option(
            "--synthetic",
            help="First write a synthetic log to the folder, with ratings from -10 to 10.",
        ),
    ] = False,
    seed: Seed = 0,
    out: Out = Path("results/compare"),
) -> None:
    """Find out [bold]which trust model suits a log[/]: its forecasts, and what it keeps under
    attack.

    The measures are forecasts of the next ratings, and a few hostile accounts in a replay.
    Forecasts are compared by paired differences, in resamples of raters and ratees. A model is
    recommended only where a difference is significant. By default all central models are measured,
    and those of neighbouring fields: all-time-mean, two-way-mean, fairness-goodness, bias-deserve,
    rev2, geometric-median and centred-clipping. What does not fit is left out, and a line says so.

    In a folder and in the folders in it, logs are the files *network.csv and ratings.csv. Columns
    are found or named as by `roletrust rate`. Written: [green]comparison.csv comparison.md[/].

    [bold]Examples[/]

    [dim]# three models on a synthetic log[/]
    [cyan]roletrust compare results/log --synthetic --model role-trust --model mean --model beta[/]

    [dim]# all models on a log of members that rate members, with rounds of a week[/]
    [cyan]roletrust compare log.csv --same-agents --scale -10 10 --every 604800[/]
    """
    if synthetic:
        reading = replace(reading, scale=(-10.0, 10.0), same_agents=True)
    every = MONTH if reading.every is None else reading.every
    central = [
        name for name in trust_models() if Traits.of(make_trust_model(name)).family == "central"
    ]
    models = {name: make_log_model(name) for name in model or [*central, *LOG_MODELS]}
    if synthetic:
        if (file := logs / "ratings.csv.gz").exists():
            raise ValueError(f"--synthetic would replace {file}; name another folder")
        prepare_folder(logs)
        logs.mkdir(parents=True, exist_ok=True)
        write_log(file, seed)
    folders = find_logs(logs)
    for log in folders:
        if log.path.resolve() == (out / "comparison.csv").resolve():
            raise ValueError(f"--out {out} would replace the log {log.path}")
    # All are read before a model plays.
    contents = [reading.log(log.path, repeats=True) for log in folders]
    protocols = Protocols(every, reading.scale, seed)
    prepare_folder(out)
    rows: list[Row] = []
    left_out: list[str] = []
    decisions = dict[str, Decision]()
    with progress_bar() as progress:
        task = progress.add_task("", total=len(folders) * len(models))
        for log, content in zip(folders, contents, strict=True):
            evaluated = dict[str, Evaluated]()
            for name, made in models.items():
                progress.update(task, description=f"{log.name}, {name}", advance=1)
                try:
                    measured = protocols.measure(made, content)
                except MemoryError as error:
                    left_out.append(f"{name} on {log.name}: {error}")
                    continue
                left_out += [
                    f"{what} on {log.name}: {reason}" for what, reason in measured.missing.items()
                ]
                if measured.evaluated is not None:
                    evaluated[name] = measured.evaluated
                for (protocol, what), value in measured.intervals.items():
                    rows.append((log.name, log.sha256, every, protocol, name, what, *value))
                if rows:  # what is measured is kept
                    write_csv(out / "comparison.csv", HEADER, rows)
            if decision := decide(content, evaluated, seed):
                decisions[log.name] = decision
    left_out = list(dict.fromkeys(left_out))  # some reasons are the same for all models
    if not rows:
        raise ValueError(f"nothing could be measured; {'; '.join(left_out)}")
    reasons = []
    for name, decision in decisions.items():
        table = number_table(shown(name), _CAPTION, *_HEADINGS, name="model")
        for standing in decision.standings:
            table.add_row(escape(standing.name), *map(_short, standing[1:]))
        console.print(table)
        recommended = decision.recommended or "no model"
        reasons.append(f"{name}: {recommended} is recommended. {decision.reason}")
        tell(reasons[-1])
    for reason in left_out:
        tell_left_out(reason)
    write_text(out / "comparison.md", markdown(measure_tables(rows), reasons, left_out))
    tell(f"Written to {out}: comparison.md, the tables of all measures, and comparison.csv")


def _short(value: Interval) -> str:
    """Return a value with its interval for a table of 80 columns; a dash if it is undefined."""
    return "-" if value.value != value.value else "{:.2f} ({:.2f}, {:.2f})".format(*value)
