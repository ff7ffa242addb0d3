"""`roletrust real`: trust models on logs of real ratings that the user brings."""

from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from roletrust_env import make_scenario
from roletrust_env.data.crowd import CROWD_METHODS, CrowdMethod, crowd_work, read_crowd, write_crowd
from roletrust_env.data.folders import Folder, find_logs, write_log
from roletrust_env.data.forecasts import forecasts, next_rating, rater_forward
from roletrust_env.data.log import Columns, read_ratings
from roletrust_env.data.replay import ATTACKS, Replay, replay_attacks, search_attack
from roletrust_env.data.rounds import TooSmallError
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.files import prepare_folder, replacing, write_csv
from roletrust_env.trust import Traits, trust_models
from roletrust_env.trust.models.log_models import LOG_MODELS
from roletrust_env.world.scenario import Scenario
from roletrust_experiments.commands.console import console, progress_bar
from roletrust_experiments.commands.options import ModelsOption, Out, Seed
from roletrust_experiments.commands.real_tables import HEADER, Row, markdown, measure_tables, screen_tables


def real(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of logs; a folder in it may hold one, too.")],
    model: ModelsOption = None,
    every: Annotated[float, typer.Option(min=0, help="Length of a round, in the unit of the times.")] = 2_592_000.0,
    scale: Annotated[tuple[float, float], typer.Option(metavar="WORST BEST", help="Worst and best rating.")] = (
        -10,
        10,
    ),
    two_roles: Annotated[
        bool, typer.Option("--two-roles", help="A rater and a ratee of one name are different agents.")
    ] = False,
    synthetic: Annotated[
        bool, typer.Option("--synthetic", help="First write a small synthetic log of either kind to DIR.")
    ] = False,
    search: Annotated[
        int,
        typer.Option(min=0, help="Number of attacks that a search plays for each goal, number and origin of accounts."),
    ] = 0,
    seed: Seed = 0,
    out: Out = Path("results/real"),
) -> None:
    """Measure [bold]trust models on real ratings[/]: forecasts, crowd work, and a few hostile accounts in a replay.

    The files are yours: none comes with the package. A log of ratings is a file *network.csv or ratings.csv without
    header: rater, ratee, rating, time. Crowd work is answer.csv (question, worker, answer) and truth.csv (question,
    truth). Each may be compressed by gzip, or be a Parquet file with the same columns. By default all central models
    are measured, and those of neighbouring fields: all-time-mean, two-way-mean, fairness-goodness, bias-deserve, rev2,
    geometric-median and centred-clipping; on crowd work also dawid-skene, one-coin-dawid-skene, glad and mace, which
    need the extra crowd. A model that does not fit and a protocol for which a log is too small
    are left out, and a line says so. Intervals resample whole users or
    tasks.

    Written: [green]real.csv real.md[/].

    [bold]Examples[/]

    [dim]# a synthetic log, to see what comes out[/]
    [cyan]roletrust real results/log --synthetic[/]

    [dim]# two models, with rounds of a week[/]
    [cyan]roletrust real results/log --model role-trust --model beta --every 604800[/]
    """
    scenario = make_scenario("paper-3x3")
    central = [name for name in trust_models() if Traits.of(parse_trust_model(name, scenario)).family == "central"]
    methods = CROWD_METHODS if find_spec("crowdkit") else ()
    models = {name: _model(name, scenario) for name in model or [*central, *LOG_MODELS, *methods]}
    if synthetic:
        prepare_folder(folder)
        folder.mkdir(parents=True, exist_ok=True)
        write_log(folder / "ratings.csv.gz", seed)
        write_crowd(folder, seed)
    logs = find_logs(folder)
    prepare_folder(out)
    rows: list[Row] = []
    left_out: list[str] = []
    with progress_bar() as progress:
        task = progress.add_task("", total=len(logs) * len(models))
        for log in logs:
            measure = _measures(log, every, scale, not two_roles, search, seed)
            for name, one in models.items():
                progress.update(task, description=f"{log.name}, {name}", advance=1)
                if log.truth is None and isinstance(one, CrowdMethod):
                    continue
                try:
                    found, missing = measure(one)
                except MemoryError as error:
                    left_out.append(f"{name} on {log.name}: {error}")
                    continue
                left_out += [f"{protocols} on {log.name}: {reason}" for protocols, reason in missing.items()]
                length = every if log.truth is None else None
                for (protocol, what), value in found.items():
                    rows.append((log.name, log.sha256, length, protocol, name, what, *value))
    left_out = list(dict.fromkeys(left_out))  # what a log is too small for is the same for all models
    if not rows:
        raise ValueError(f"nothing could be measured; {'; '.join(left_out)}")
    write_csv(out / "real.csv", HEADER, rows)
    tables = measure_tables(rows)
    for table in screen_tables(tables):
        console.print(table)
    for reason in left_out:
        console.print(f"[dark_orange3]left out:[/] {escape(reason)}", soft_wrap=True)
    with replacing(out / "real.md") as path:
        path.write_text(markdown(tables, left_out), encoding="utf-8")
    console.print(f"Written to {out}: real.csv, real.md", soft_wrap=True)


def _model(name: str, scenario: Scenario) -> Any:
    """Return a trust model, also of a neighbouring field, or a method of crowd work."""
    if name in CROWD_METHODS:
        return CrowdMethod(name)
    return LOG_MODELS[name]() if name in LOG_MODELS else parse_trust_model(name, scenario)


Found = dict[tuple[str, str], Interval]
"""Measures by protocol and name."""


def _measures(
    log: Folder, every: float, scale: tuple[float, float], same_agents: bool, search: int, seed: int
) -> Callable[[Any], tuple[Found, dict[str, str]]]:
    """Read a log once, and return a function from a model to its measures.

    The function also returns the reasons why protocols could not be played, by what they are.
    """
    if log.truth is not None:
        crowd = read_crowd(log.path, log.truth)
        return lambda model: (_named("crowd work", crowd_work(model, crowd, seed)), {})
    ratings = read_ratings(log.path, Columns("1", "2", "3", "4"), scale=scale, same_agents=same_agents, repeats=True)

    def forecast(model: Any) -> Found:
        before = forecasts(model, ratings, every, same_agents=same_agents)
        found = _named("next rating", next_rating(before, ratings, seed))
        return found | _named("rater forward", rater_forward(before, ratings, seed))

    def attacked(model: Any) -> Found:
        found: Found = {}
        replay = Replay(model, ratings, every, same_agents=same_agents)
        for attack, shift in replay_attacks(replay, seed=seed).items():
            found["attack", f"{attack.goal}, honest"] = shift.before
            found["attack", f"{attack.goal}, {attack.accounts} {attack.origin}"] = shift.after
        for attack in ATTACKS if search else ():
            worst = search_attack(replay, attack, search, seed)
            found["searched attack", f"{attack.goal}, {attack.accounts} {attack.origin}"] = worst.shift.after
        return found

    def measure(model: Any) -> tuple[Found, dict[str, str]]:
        found: Found = {}
        missing = {}
        for protocols, play in (("forecasts", forecast), ("attacks", attacked)):
            try:
                found |= play(model)
            except TooSmallError as error:
                missing[protocols] = str(error)
        return found, missing

    return measure


def _named(protocol: str, measures: Mapping[str, Interval]) -> Found:
    return {(protocol, what): value for what, value in measures.items()}
