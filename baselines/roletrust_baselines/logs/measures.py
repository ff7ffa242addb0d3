"""All measures of a trust model on one log, and their tables: forecasts and attacks."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from roletrust_baselines.logs.advice import FORECAST, advise, kept
from roletrust_baselines.logs.errors import TooSmallError
from roletrust_baselines.logs.forecasts import forecasts, next_rating, rated_before, rater_forward
from roletrust_baselines.logs.replay import Replay, replay_attacks
from roletrust_env.data.log import RatingLog
from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.markdown import markdown_table

Row = tuple[str, str, float, str, str, str, float, float, float]
"""Log, its SHA-256, length of a round, protocol, model, measure, value, and the ends of its
interval."""

Found = dict[tuple[str, str], Interval]
"""Measures by protocol and name."""

_UNDEFINED = Interval(math.nan, math.nan, math.nan)


class Protocols(NamedTuple):
    """How models are measured on logs.

    Attributes:
        every: Length of a round, in the unit of the times.
        scale: Worst and best rating.
        seed: Random seed of the resamples and draws.
    """

    every: float
    scale: tuple[float, float]
    seed: int

    def measure(self, model: Any, log: RatingLog) -> tuple[Found, dict[str, str]]:
        """Return the measures of a model on a log, and the reasons why some could not be played, by
        what they are.
        """
        found, missing = Found(), {}
        for what, play in (("forecasts", self._forecasts), ("attacks", self._attacks)):
            try:
                found |= play(model, log)
            except TooSmallError as error:
                missing[what] = str(error)
        return found, missing

    def _forecasts(self, model: Any, log: RatingLog) -> Found:
        before = forecasts(model, log, self.every, same_agents=log.same_agents)
        found = _named("rated before", rated_before(before, log, self.scale, self.seed))
        found |= _named("next rating", next_rating(before, log, self.seed))
        return found | _named("rater forward", rater_forward(before, log, self.seed))

    def _attacks(self, model: Any, log: RatingLog) -> Found:
        found = Found()
        replay = Replay(model, log, self.every, same_agents=log.same_agents)
        for attack, shift in replay_attacks(replay, seed=self.seed).items():
            found["attack", f"{attack.goal}, honest"] = shift.before
            found["attack", f"{attack.goal}, {attack.accounts} {attack.origin}"] = shift.after
        return found


def _named(protocol: str, measures: Mapping[str, Interval]) -> Found:
    return {(protocol, what): value for what, value in measures.items()}


def recommendations(rows: list[Row]) -> list[str]:
    """Return a line for each log with forecasts: which model suits it, and why."""
    advice = {log: advise(models) for log, models in _by_log(rows).items()}
    return [f"{log}: {one.words}" for log, one in advice.items() if one]


def summaries(rows: list[Row]) -> dict[str, list[tuple[str, str, str]]]:
    """Return the models of each log, the best forecast first, with their forecast and what they
    keep under attack.
    """
    return {
        log: [
            (
                name,
                interval_text(one.get(FORECAST, _UNDEFINED)),
                interval_text(kept(one) or _UNDEFINED),
            )
            for name, one in sorted(
                models.items(),
                key=lambda item: (
                    -np.nan_to_num(item[1].get(FORECAST, _UNDEFINED).value, nan=-np.inf)
                ),
            )
        ]
        for log, models in _by_log(rows).items()
    }


def _by_log(rows: list[Row]) -> dict[str, dict[str, Found]]:
    """Return the measures of each model on each log."""
    logs: dict[str, dict[str, Found]] = {}
    for row in rows:
        logs.setdefault(row[0], {}).setdefault(row[4], {})[row[3], row[5]] = Interval(*row[6:])
    return logs


def measure_tables(rows: list[Row]) -> list[tuple[str, list[str], list[list[str]]]]:
    """Return a table for each log and protocol: its title, its headings, and a line for each
    model.
    """
    tables = []
    for log, protocol in dict.fromkeys((row[0], row[3]) for row in rows):
        values = {
            (row[4], row[5]): Interval(*row[6:])
            for row in rows
            if (row[0], row[3]) == (log, protocol)
        }
        measures = list(dict.fromkeys(what for _, what in values))
        names = dict.fromkeys(name for name, _ in values)
        lines = [
            [name, *(interval_text(values.get((name, what), _UNDEFINED)) for what in measures)]
            for name in names
        ]
        tables.append((f"{log}: {protocol}", ["model", *measures], lines))
    return tables


def interval_text(value: Interval) -> str:
    """Return a value with the ends of its interval, such as `0.500 (0.400, 0.600)`; a dash if it is
    undefined.
    """
    if math.isnan(value.value):
        return "-"
    if math.isnan(value.low):  # a single user or task has no interval
        return f"{value.value:.3f}"
    return f"{value.value:.3f} ({value.low:.3f}, {value.high:.3f})"


def markdown(
    tables: list[tuple[str, list[str], list[list[str]]]], advice: list[str], left_out: list[str]
) -> str:
    """Return the recommendations and the tables as Markdown."""
    parts = ["# Trust models on real ratings", *advice]
    for title, headings, lines in tables:
        parts += [f"## {title}", markdown_table(headings, lines, names=1)]
    if left_out:
        parts.append("\n".join(f"- Left out: {reason}." for reason in left_out))
    return "\n\n".join(parts) + "\n"
