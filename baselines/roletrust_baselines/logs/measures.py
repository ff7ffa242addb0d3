"""All measures of a trust model on one log, and their tables: forecasts and attacks, or crowd work."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from roletrust_baselines.logs.advice import advise
from roletrust_baselines.logs.crowd import crowd_work, read_crowd
from roletrust_baselines.logs.folders import Folder
from roletrust_baselines.logs.forecasts import forecasts, next_rating, rated_before, rater_forward
from roletrust_baselines.logs.replay import ATTACKS, Replay, replay_attacks, search_attack
from roletrust_baselines.logs.rounds import TooSmallError
from roletrust_env.data.log import RatingLog
from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.markdown import markdown_table

Row = tuple[str, str, float | None, str, str, str, float, float, float]
"""Log, its SHA-256, length of a round or None, protocol, model, measure, value, and the ends of its interval."""

Found = dict[tuple[str, str], Interval]
"""Measures by protocol and name."""


def log_measures(
    log: Folder,
    every: float,
    scale: tuple[float, float],
    same_agents: bool,
    search: int,
    seed: int,
    read: Callable[[Path], RatingLog],
) -> Callable[[Any], tuple[Found, dict[str, str]]]:
    """Read a log once, by `read` where it is one of ratings, and return a function from a model to its measures.

    The function also returns the reasons why protocols could not be played, by what they are.
    """
    if log.truth is not None:
        crowd = read_crowd(log.path, log.truth)
        return lambda model: (_named("crowd work", crowd_work(model, crowd, seed)), {})
    ratings = read(log.path)

    def forecast(model: Any) -> Found:
        before = forecasts(model, ratings, every, same_agents=same_agents)
        found = _named("rated before", rated_before(before, ratings, scale, seed))
        found |= _named("next rating", next_rating(before, ratings, seed))
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


def recommendations(rows: list[Row]) -> list[str]:
    """Return a line for each log with forecasts: which model suits it, and why."""
    logs: dict[str, dict[str, Found]] = {}
    for row in rows:
        logs.setdefault(row[0], {}).setdefault(row[4], {})[row[3], row[5]] = Interval(*row[6:])
    advice = {log: advise(models) for log, models in logs.items()}
    return [f"{log}: {one.words}" for log, one in advice.items() if one]


def measure_tables(rows: list[Row]) -> list[tuple[str, list[str], list[list[str]]]]:
    """Return a table for each log and protocol: its title, its headings, and a line for each model."""
    tables = []
    for log, protocol in dict.fromkeys((row[0], row[3]) for row in rows):
        values = {(row[4], row[5]): Interval(*row[6:]) for row in rows if (row[0], row[3]) == (log, protocol)}
        measures = list(dict.fromkeys(what for _, what in values))
        names = dict.fromkeys(name for name, _ in values)
        undefined = Interval(math.nan, math.nan, math.nan)
        lines = [[name, *(_cell(values.get((name, what), undefined)) for what in measures)] for name in names]
        tables.append((f"{log}: {protocol}", ["model", *measures], lines))
    return tables


def _cell(value: Interval) -> str:
    if math.isnan(value.value):
        return "-"
    if math.isnan(value.low):  # a single user or task has no interval
        return f"{value.value:.3f}"
    return f"{value.value:.3f} ({value.low:.3f}, {value.high:.3f})"


def markdown(tables: list[tuple[str, list[str], list[list[str]]]], advice: list[str], left_out: list[str]) -> str:
    """Return the recommendations and the tables as Markdown."""
    parts = ["# Trust models on real ratings", *advice]
    for title, headings, lines in tables:
        parts += [f"## {title}", markdown_table(headings, lines, names=1)]
    if left_out:
        parts.append("\n".join(f"- Left out: {reason}." for reason in left_out))
    return "\n\n".join(parts) + "\n"
