"""Logs of few ratings, and the synthetic log."""

from pathlib import Path

import numpy as np

from roletrust_env.logs import Log, read, write_log


def small_log(edges: list[tuple[int, int, float, float]]) -> Log:
    raters, ratees, values, times = (np.array(column) for column in zip(*edges, strict=True))
    names = [str(n) for n in range(int(max(raters.max(), ratees.max())) + 1)]
    return Log(raters, ratees, values.astype(float), times.astype(int) * 10**9, names, names)


def synthetic_log(folder: Path) -> Log:
    """Return the synthetic log of members that rate members."""
    write_log(folder / "ratings.csv.gz")
    return read(folder / "ratings.csv.gz", scale=(-10, 10), same_agents=True)
