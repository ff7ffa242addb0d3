"""Replays of real logs beside the leaderboard, from a file that `roletrust rate --compare` has written."""

import csv
from pathlib import Path

import numpy as np

from roletrust_env.metrics.confidence import Interval

_PROTOCOLS = ("attack", "searched attack")
_GOALS = ("sink", "lift")


def read_replays(path: Path) -> dict[str, Interval]:
    """Return what trust models keep where hostile accounts join a real log, by the name of the model.

    With the goal `sink` a model keeps the percentile of the good providers after the attack, with `lift` what the
    newcomers lack of the top. Of all attacks with a goal the one counts that leaves least. The result is the mean over
    both goals and all logs, 1 if no attack moves its targets.

    Args:
        path: File `comparison.csv`.

    Raises:
        ValueError: The file is none of that command, or has no replay with both goals.
        OSError: The file cannot be read.
    """
    found: dict[str, dict[tuple[str, str], list[Interval]]] = {}
    try:
        with path.open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                goal, _, accounts = row["measure"].partition(", ")
                if row["protocol"] not in _PROTOCOLS or goal not in _GOALS or accounts == "honest":
                    continue
                value, low, high = (float(row[name]) for name in ("value", "low", "high"))
                kept = Interval(value, low, high) if goal == "sink" else Interval(1 - value, 1 - high, 1 - low)
                found.setdefault(row["model"], {}).setdefault((row["log"], goal), []).append(kept)
    except (KeyError, TypeError, ValueError, AttributeError, csv.Error) as error:
        raise ValueError(f"{path} is no comparison.csv of `roletrust rate --compare` ({error!r})") from None
    logs = {log for groups in found.values() for log, _ in groups}
    complete = {model: groups for model, groups in found.items() if len(groups) == len(_GOALS) * len(logs)}
    if not complete:
        raise ValueError(f"{path} has no replay of a log with hostile accounts; `roletrust rate --compare` plays them")
    return {
        model: Interval(*np.mean([min(attacks) for attacks in groups.values()], axis=0).tolist())
        for model, groups in complete.items()
    }
