"""Trust models on logs of real ratings: `roletrust rate --compare`."""

from dataclasses import replace
from pathlib import Path

from rich.markup import escape

from roletrust_baselines.logs.folders import find_logs, write_log
from roletrust_baselines.logs.measures import (
    Protocols,
    Row,
    markdown,
    measure_tables,
    recommendations,
    summaries,
)
from roletrust_baselines.logs.models import LOG_MODELS, make_log_model
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

_CAPTION = (
    "forecast: r of trust with the next ratings of agents that have earlier ones; kept: of 1, "
    "under the worst of the "
    "attacks by hostile accounts; both with 95% intervals"
)
HEADER = ("log", "sha256", "round", "protocol", "model", "measure", "value", "low", "high")


def compare(
    folder: Path,
    reading: LogOptions,
    names: list[str] | None,
    *,
    synthetic: bool,
    seed: int,
    out: Path,
) -> None:
    """Measure trust models on a log or on the logs in a folder, and write and print the tables.

    Args:
        folder: File of ratings, or folder of logs; a folder in it may hold one, too.
        reading: Options by which a file of ratings is read.
        names: Trust models; None for all central ones and those of neighbouring fields.
        synthetic: Whether a small synthetic log is first written to the folder.
        seed: Random seed of the resamples and draws, and of the synthetic log.
        out: Folder of the results.

    Raises:
        ValueError: There is no log, a log is wrong, or nothing could be measured.
    """
    every, scale = MONTH if reading.every is None else reading.every, reading.scale or (-10.0, 10.0)
    both = reading.same_agents is not False
    reading = replace(reading, every=every, scale=scale, same_agents=both, repeats=True)
    central = [
        name for name in trust_models() if Traits.of(make_trust_model(name)).family == "central"
    ]
    models = {name: make_log_model(name) for name in names or [*central, *LOG_MODELS]}
    if synthetic:
        prepare_folder(folder)
        folder.mkdir(parents=True, exist_ok=True)
        write_log(folder / "ratings.csv.gz", seed)
    logs = find_logs(folder)
    # All are read before a model plays.
    contents = [reading.read(log.path) for log in logs]
    protocols = Protocols(every, scale, seed)
    prepare_folder(out)
    rows: list[Row] = []
    left_out: list[str] = []
    with progress_bar() as progress:
        task = progress.add_task("", total=len(logs) * len(models))
        for log, content in zip(logs, contents, strict=True):
            for name, model in models.items():
                progress.update(task, description=f"{log.name}, {name}", advance=1)
                try:
                    measures, missing = protocols.measure(model, content)
                except MemoryError as error:
                    left_out.append(f"{name} on {log.name}: {error}")
                    continue
                left_out += [f"{what} on {log.name}: {reason}" for what, reason in missing.items()]
                for (protocol, what), value in measures.items():
                    rows.append((log.name, log.sha256, every, protocol, name, what, *value))
                if rows:  # what is measured is kept
                    write_csv(out / "comparison.csv", HEADER, rows)
    left_out = list(
        dict.fromkeys(left_out)
    )  # what a log is too small for is the same for all models
    if not rows:
        raise ValueError(f"nothing could be measured; {'; '.join(left_out)}")
    for name, lines in summaries(rows).items():
        table = number_table(shown(name), _CAPTION, "forecast", "kept", name="model")
        for cells in lines:
            table.add_row(*map(escape, cells))
        console.print(table)
    advice = recommendations(rows)
    for line in advice:
        tell(line)
    for reason in left_out:
        tell_left_out(reason)
    write_text(out / "comparison.md", markdown(measure_tables(rows), advice, left_out))
    tell(f"Written to {out}: comparison.md, the tables of all measures, and comparison.csv")
