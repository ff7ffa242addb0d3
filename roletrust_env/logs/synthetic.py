"""A synthetic log of ratings, to try things on."""

import gzip
from pathlib import Path

import numpy as np

from roletrust_env.randomness import generator


def write_log(path: Path | str, seed: int = 0, members: int = 120, months: int = 24) -> None:
    """Write a small synthetic log of members that rate members from -10 to 10, compressed.

    A tenth of the members cheat. Members join over time, prefer those that have been rated often,
    and differ in how often they rate; some always say 10, and some say the opposite of what they
    saw.

    Args:
        path: Path of the file, ending in `.csv.gz`.
        seed: Random seed.
        members: Number of members, at least 2.
        months: Number of months of 30 days.
    """
    rng = generator(seed)
    quality = np.where(
        rng.random(members) < 0.1, rng.uniform(-10, -4, members), rng.uniform(1, 6, members)
    )
    habit = rng.choice(["honest", "kind", "contrary"], members, p=[0.8, 0.15, 0.05])
    joined, pace, seen = (
        rng.integers(0, months, members),
        rng.exponential(1.5, members),
        np.ones(members),
    )
    lines = ["rater,ratee,rating,time\n"]
    for time in np.sort(rng.uniform(0, months, members * months)):
        there = np.flatnonzero(joined <= time)
        if len(there) < 2:
            continue
        rater = rng.choice(there, p=pace[there] / pace[there].sum())
        others = there[there != rater]
        chance = np.sqrt(seen[others])
        ratee = rng.choice(others, p=chance / chance.sum())
        saw = quality[ratee] + rng.normal(0, 2)
        rating = {"honest": saw, "kind": 10.0, "contrary": -saw}[str(habit[rater])]
        seen[ratee] += 1
        lines.append(f"{rater},{ratee},{int(np.clip(rating, -10, 10))},{int(time * 2_592_000)}\n")
    with gzip.open(path, "wt", encoding="utf-8", newline="") as file:
        file.writelines(lines)
