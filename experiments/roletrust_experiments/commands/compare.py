"""`roletrust compare`: which trust model suits a log of ratings."""

from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from roletrust_env.logs.compare import MONTH, Row
from roletrust_env.logs.compare import compare as compare_models
from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.files import prepare_folder, write_csv, write_text
from roletrust_experiments.commands.console import (
    console,
    number_table,
    progress_bar,
    stages,
    tell,
    tell_left_out,
)
from roletrust_experiments.commands.log_options import (
    LogSettings,
    Ratings,
    Scale,
    log_arguments,
    read,
)
from roletrust_experiments.commands.options import NAMED, OWN, Out, Seed

_CAPTION = (
    "forecast: r of trust with the next ratings of agents that have earlier ones; difference: to "
    "the best, paired; kept: of 1, under the worst of the attacks by hostile accounts; all with "
    "95% intervals"
)
HEADER = ("log", "round", "version", *Row._fields)


def compare(
    ratings: Ratings,
    scale: Scale = (0.0, 1.0),
    every: Annotated[float, typer.Option(help="Length of a round in seconds.")] = MONTH,
    settings: LogSettings = None,
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar=NAMED,
            help=f"Trust model; repeat for more; all central ones if left out. {OWN}",
        ),
    ] = None,
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

    Columns are found or named as by `roletrust rate`. Written: [green]comparison.csv
    comparison.md[/].

    [bold]Examples[/]

    [dim]# three models[/]
    [cyan]roletrust compare log.csv --scale 1 5 --model role-trust --model mean --model beta[/]

    [dim]# all models on a log of members that rate members, with rounds of a week[/]
    [cyan]roletrust compare log.csv --set same_agents=true --scale -10 10 --every 604800[/]
    """
    if ratings.resolve() in {(out / f"comparison.{kind}").resolve() for kind in ("csv", "md")}:
        raise ValueError(f"--out {out} would replace the log {ratings}")
    log = read(ratings, log_arguments(settings, scale), repeats=True)
    prepare_folder(out)
    origin = ratings.name, every, version("roletrust-env")

    def keep(rows: list[Row]) -> None:
        write_csv(out / "comparison.csv", HEADER, [(*origin, *row) for row in rows])

    with progress_bar(counted=False) as progress:
        found = compare_models(
            log,
            model or (),
            every=every,
            seed=seed,
            keep=keep,
            advance=stages(progress),
        )
    table = number_table("", _CAPTION, "forecast", "difference", "kept", name="model")
    for standing in found.standings:
        table.add_row(escape(standing.name), *map(_short, standing[1:]))
    console.print(table)
    tell(f"{found.recommended or 'no model'} is recommended. {found.reason}")
    for reason in found.left_out:
        tell_left_out(reason)
    write_text(out / "comparison.md", found.markdown())
    tell(f"Written to {out}: comparison.md, the tables of all measures, and comparison.csv")


def _short(value: Interval) -> str:
    """Return a value with its interval for a table of 80 columns; a dash if it is undefined."""
    return "-" if value.value != value.value else "{:.2f} ({:.2f}, {:.2f})".format(*value)
