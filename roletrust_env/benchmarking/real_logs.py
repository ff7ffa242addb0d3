"""Replays of real logs beside the leaderboard, from a file that `roletrust rate --compare` has
written.
"""

import csv
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from roletrust_env.metrics.confidence import Interval

_PROTOCOL = "attack"
_GOALS = ("sink", "lift")


def read_replays(path: Path) -> dict[str, Interval]:
    """Return what trust models keep where hostile accounts join a real log, by the name of the
    model.

    The result is the mean of `kept` over all logs.

    Args:
        path: File `comparison.csv`.

    Raises:
        ValueError: The file is none of that command, or has no replay with both goals.
        OSError: The file cannot be read.
    """
    by_model: dict[str, dict[str, dict[tuple[str, str], Interval]]] = {}
    try:
        with path.open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                measure = row["protocol"], row["measure"]
                if measure[0] == _PROTOCOL:
                    value = Interval(*(float(row[name]) for name in ("value", "low", "high")))
                    by_model.setdefault(row["model"], {}).setdefault(row["log"], {})[measure] = (
                        value
                    )
    except (KeyError, TypeError, ValueError, AttributeError, csv.Error) as error:
        raise ValueError(
            f"{path} is no comparison.csv of `roletrust rate --compare` ({error!r})"
        ) from None
    logs = {log for of_model in by_model.values() for log in of_model}
    by_log = {
        name: [kept(of_model.get(log, {})) for log in logs] for name, of_model in by_model.items()
    }
    complete = {
        name: [interval for interval in each if interval]
        for name, each in by_log.items()
        if all(each)
    }
    if not complete:
        raise ValueError(
            f"{path} has no replay of a log with hostile accounts; `roletrust rate --compare` "
            "plays them"
        )
    return {name: Interval(*np.mean(each, axis=0).tolist()) for name, each in complete.items()}


def kept(measures: Mapping[tuple[str, str], Interval]) -> Interval | None:
    """Return what a trust model keeps on a log under the worst attack with each goal, the mean over
    both goals.

    With the goal `sink` it keeps the percentile of the good providers after the attack, with `lift`
    what the newcomers lack of the top: 1 if no attack moves its targets.

    Args:
        measures: Measures of the model by protocol and name, as `roletrust rate --compare` has
            them.

    Returns:
        The mean with its interval; None where a goal was not attacked.
    """
    by_goal: dict[str, list[Interval]] = {}
    for (protocol, what), value in measures.items():
        goal, _, accounts = what.partition(", ")
        if protocol == _PROTOCOL and goal in _GOALS and accounts != "honest":
            left = (
                value
                if goal == "sink"
                else Interval(1 - value.value, 1 - value.high, 1 - value.low)
            )
            by_goal.setdefault(goal, []).append(left)
    complete = len(by_goal) == len(_GOALS)
    return (
        Interval(*np.mean([min(attacks) for attacks in by_goal.values()], axis=0).tolist())
        if complete
        else None
    )
