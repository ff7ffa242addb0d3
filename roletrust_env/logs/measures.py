"""All measures of a trust model on one log, and their tables: forecasts and attacks."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.logs.decision import Evaluated
from roletrust_env.logs.forecasts import (
    forecasts,
    next_rating,
    past_mean,
    rated_before,
    rater_forward,
)
from roletrust_env.logs.log import Log, TooSmallError
from roletrust_env.logs.replay import Attack, Replay, Shift, replay_attacks
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

    def measure(self, model: Any, log: Log) -> "Measured":
        """Return the measures of a model on a log.

        Raises:
            MemoryError: The model does not fit, see `make_run`.
        """
        found, missing, evaluated = Found(), dict[str, str](), None
        try:
            before = forecasts(model, log, self.every, same_agents=log.same_agents)
        except TooSmallError as error:
            missing["forecasts"] = str(error)
        else:
            found = _named("rated before", rated_before(before, log, self.scale, self.seed))
            found |= _named("next rating", next_rating(before, log, self.seed))
            found |= _named("rater forward", rater_forward(before, log, self.seed))
            known = np.flatnonzero(~np.isnan(past_mean(before, log)))
            if len(known):
                evaluated = Evaluated(before.since + known, before.top[known], None)
        try:
            replay = Replay(model, log, self.every, same_agents=log.same_agents)
        except TooSmallError as error:
            missing["attacks"] = str(error)
        else:
            shifts = replay_attacks(replay, seed=self.seed)
            for attack, shift in shifts.items():
                found["attack", f"{attack.goal}, honest"] = shift.before
                found["attack", f"{attack.goal}, {attack.accounts} {attack.origin}"] = shift.after
            if evaluated is not None:
                evaluated = evaluated._replace(kept=_kept(shifts))
        return Measured(found, missing, evaluated)


class Measured(NamedTuple):
    """Measures of a model on a log.

    Attributes:
        intervals: Measures by protocol and name.
        missing: Why some could not be measured, by what they are.
        evaluated: What the model published, for paired comparisons; None without forecasts.
    """

    intervals: Found
    missing: dict[str, str]
    evaluated: Evaluated | None


def _kept(shifts: Mapping[Attack, Shift]) -> Any:
    """Return what each target keeps under the worst attack of each goal, shape (2, targets): its
    percentile if the attack sinks it, and what it lacks of the top if the attack lifts it.
    """
    by_goal: dict[str, list[Any]] = {}
    for attack, shift in shifts.items():
        kept = shift.targets if attack.goal == "sink" else 1 - shift.targets
        by_goal.setdefault(attack.goal, []).append(kept)
    return np.stack([min(attacks, key=np.mean) for attacks in by_goal.values()])


def _named(protocol: str, measures: Mapping[str, Interval]) -> Found:
    return {(protocol, what): value for what, value in measures.items()}


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
    tables: list[tuple[str, list[str], list[list[str]]]], reasons: list[str], left_out: list[str]
) -> str:
    """Return the decisions and the tables as Markdown."""
    parts = ["# Trust models on real ratings", *reasons]
    for title, headings, lines in tables:
        parts += [f"## {title}", markdown_table(headings, lines, names=1)]
    if left_out:
        parts.append("\n".join(f"- Left out: {reason}." for reason in left_out))
    return "\n\n".join(parts) + "\n"
