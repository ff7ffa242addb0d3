"""Folders of real ratings: what is in them, whether a file is a known one, and a synthetic log in
the same form.
"""

import gzip
import hashlib
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np

from roletrust_env.randomness import generator

KNOWN = {"76bd9d8f1d3ff9a1813d9fc8e6902a0ee4d0a2f8c1003842dbc9ec79149ab60c": "Bitcoin OTC"}
"""Names of the logs whose numbers the documentation gives, by the SHA-256 of their unpacked
contents."""

SOURCES = (
    "a log is *network.csv or ratings.csv, with rater, ratee, rating and time, such as SNAP's "
    "soc-sign-bitcoin-otc "
    "(https://snap.stanford.edu/data/soc-sign-bitcoin-otc.html); it may be compressed (.gz), or a "
    "Parquet file "
    "with the same columns (.parquet)"
)
"""Form of the files, and where to get one."""

_ENDINGS = tuple(
    end + packed for end in (".csv", ".tsv", ".parquet", ".jsonl") for packed in ("", ".gz")
)


class Folder(NamedTuple):
    """File of one log.

    Attributes:
        path: File of the ratings.
        name: Name of a known log, or the path.
        sha256: Hash of the unpacked contents, hexadecimal.
    """

    path: Path
    name: str
    sha256: str


def find_logs(folder: Path) -> list[Folder]:
    """Return the logs in a folder and in the folders in it, or the one in a file of ratings.

    Raises:
        ValueError: There is none. The message says what a log is, and where to get one.
        OSError: A file cannot be read.
    """
    if folder.is_file():
        return [_folder(folder)]
    found = list[Folder]()
    for place in [folder, *sorted(path for path in folder.glob("*") if path.is_dir())]:
        tables = [
            (path, path.name.removesuffix(end))
            for end in _ENDINGS
            for path in place.glob(f"*{end}")
        ]
        found += [
            _folder(path)
            for path, stem in sorted(tables)
            if stem.endswith("network") or stem == "ratings"
        ]
    if not found:
        raise ValueError(f"{folder} has no log; {SOURCES}")
    return found


def _folder(path: Path) -> Folder:
    digest = hashlib.sha256()
    with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
        try:
            while block := file.read(1 << 20):
                digest.update(block)
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise ValueError(f"{path} is a damaged gzip file: {error}") from None
    sha256 = digest.hexdigest()
    return Folder(path, KNOWN.get(sha256, f"{path.parent.name}/{path.name}"), sha256)


def write_log(path: Path, seed: int = 0, members: int = 120, months: int = 24) -> None:
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
