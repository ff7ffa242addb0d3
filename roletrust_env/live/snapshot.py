"""Snapshots of a manager's memory beside its journal, so that a restart does not replay all rounds.

A snapshot is text: names, numbers, and arrays as base64 of their bytes. It is never more than a shortcut. One that is
damaged, of other settings or of another journal is ignored, and all rounds are replayed.
"""

import base64
import hashlib
import json
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.live.journal import JournalPosition
from roletrust_env.live.trust_tracker import Team
from roletrust_env.storage.files import replacing

_VERSION = 1
_NUMBERS = "biuf"  # kinds of dtypes: bool, integers and floats


class Snapshot(NamedTuple):
    """The memory of a manager after a round.

    Attributes:
        position: Place in the journal after the round.
        stamp: Stamp of the round, nanoseconds.
        last_stamps: Last accepted stamp of each rater, nanoseconds.
        memory: Memory of the trust tracker, see `TrustTracker.memory`.
    """

    position: JournalPosition
    stamp: int
    last_stamps: dict[str, int]
    memory: list[Any]


def snapshot_path(journal: Path) -> Path:
    """Return the path of the snapshot of a journal."""
    return journal.with_name(f"{journal.name}.snapshot")


def write_snapshot(journal: Path, snapshot: Snapshot) -> None:
    """Write the snapshot of a journal in place of the one before.

    Raises:
        OSError: The file cannot be written.
    """
    offset, digest, round, team = snapshot.position
    data = {
        "snapshot": _VERSION,
        "offset": offset,
        "digest": digest,
        "round": round,
        "stamp": snapshot.stamp,
        "raters": team.raters,
        "providers": team.providers,
        "last_stamps": snapshot.last_stamps,
        "memory": [_packed(value) for value in snapshot.memory],
    }
    text = json.dumps(data, allow_nan=False).encode()
    with replacing(snapshot_path(journal)) as path:
        path.write_bytes(hashlib.sha256(text).hexdigest().encode() + b"\n" + text + b"\n")


def read_snapshot(journal: Path) -> Snapshot | None:
    """Return the snapshot of a journal; None if there is none or it is damaged."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        digest, text = snapshot_path(journal).read_bytes().rstrip(b"\n").split(b"\n")
        data = json.loads(text)
        if hashlib.sha256(text).hexdigest().encode() != digest or data["snapshot"] != _VERSION:
            return None
        team = Team(tuple(data["raters"]), tuple(data["providers"]))
        position = JournalPosition(int(data["offset"]), str(data["digest"]), int(data["round"]), team)
        stamps = {str(name): int(stamp) for name, stamp in data["last_stamps"].items()}
        return Snapshot(position, int(data["stamp"]), stamps, [_unpacked(value) for value in data["memory"]])
    return None


def _packed(value: Any) -> Any:
    """Return an array or a number as plain data.

    Raises:
        TypeError: The value is something else.
    """
    if not isinstance(value, np.ndarray):
        if not isinstance(value, bool | int | float):
            raise TypeError(f"a {type(value).__name__} cannot be stored in a snapshot")
        return value
    if value.dtype.kind not in _NUMBERS:
        raise TypeError(f"an array of {value.dtype} cannot be stored in a snapshot")
    data = base64.b64encode(np.ascontiguousarray(value).tobytes()).decode()
    return {"dtype": value.dtype.str, "shape": value.shape, "data": data}


def _unpacked(value: Any) -> Any:
    """Return the array or number of plain data.

    Raises:
        KeyError, TypeError, ValueError: The data is neither.
    """
    if isinstance(value, bool | int | float):
        return value
    dtype = np.dtype(value["dtype"])
    if dtype.kind not in _NUMBERS:
        raise ValueError("not an array of numbers")
    return np.frombuffer(base64.b64decode(value["data"], validate=True), dtype).reshape(value["shape"]).copy()
