"""The journal of a manager. Every round is on disk before it is published, so no published trust is
ever lost.

Beside it lies a snapshot of the manager's memory, so that a restart does not replay all rounds. A
snapshot is a file of arrays, see `roletrust_env.storage.arrays`. It is never more than a shortcut.
One that is damaged, of other settings or of another journal is ignored, and all rounds are
replayed.
"""

import hashlib
import json
import mmap
import os
from base64 import b64decode, b64encode
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeInt, TypeAdapter, field_validator

from roletrust_env.storage.arrays import load_arrays, save_arrays
from roletrust_env.storage.untrusted import UntrustedModel, check_file, parse_json, parse_untrusted
from roletrust_env.trust.stored import taken
from roletrust_manager.journal.held_file import HeldFile
from roletrust_manager.team import PublishedTrust, RatingRows, Team, Trust

_VERSION = 2
_BLOCK = 1 << 20  # bytes that are read at once


_Share = Annotated[float, Field(ge=0, le=1)]
_Nanoseconds = Annotated[int, Field(ge=-(2**63), lt=2**63)]


class _TeamLine(UntrustedModel):
    """A line with the names of the team from the next round on."""

    raters: tuple[str, ...]
    providers: tuple[str, ...]

    @field_validator("raters", "providers")
    @classmethod
    def _differ(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if len(set(names)) < len(names):
            raise ValueError("a name occurs twice")
        return names


class _RoundLine(UntrustedModel):
    """A line with a round, see `JournalEntry`."""

    round: NonNegativeInt
    stamp: _Nanoseconds
    closed: _Nanoseconds
    ratings: dict[str, list[_Share | None]]
    missing: tuple[str, ...]
    tor: tuple[_Share, ...]
    top: tuple[_Share, ...]
    toa: tuple[_Share, ...]
    signed: dict[str, str] = Field(default={}, min_length=1)


class _SnapshotHeader(_TeamLine):
    """Content of a snapshot beside the arrays of its run, see `Snapshot`."""

    snapshot: Literal[3] = 3
    position: tuple[NonNegativeInt, str, NonNegativeInt]
    stamp: _Nanoseconds
    last_stamps: dict[str, _Nanoseconds]


_LINES: TypeAdapter[_RoundLine | _TeamLine] = TypeAdapter(_RoundLine | _TeamLine)


class JournalEntry(NamedTuple):
    """A closed round: its ratings and the trust after it.

    Attributes:
        round: Number of the round, from 0.
        stamp: Earliest stamp of its messages, nanoseconds.
        closed: Time at which it was closed, nanoseconds.
        team: Agents of the team, in the order of the values.
        ratings: Ratings that counted.
        missing: Expected raters whose ratings did not arrive in time.
        trust: Trust after the round.
        signed: Signed message of each rater in `ratings`, as CDR; empty if the team has no keys.
    """

    round: int
    stamp: int
    closed: int
    team: Team
    ratings: RatingRows
    missing: tuple[str, ...]
    trust: Trust
    signed: Mapping[str, bytes] = {}

    @property
    def published(self) -> PublishedTrust:
        """Trust to publish."""
        tor = dict(zip(self.team.raters, self.trust.tor, strict=True))
        top = dict(zip(self.team.providers, self.trust.top, strict=True))
        return PublishedTrust(self.round, self.stamp, tor, top, self.missing)


class JournalPosition(NamedTuple):
    """A place in a journal, between two rounds.

    Attributes:
        offset: Number of bytes before it.
        digest: SHA-256 of these bytes.
        round: Number of the next round.
        team: Team of the last round.
    """

    offset: int
    digest: str
    round: int
    team: Team


class Journal:
    """A file to which one line of JSON is appended for each round.

    A line with the names of the team precedes the team's first round. Floats are read back to the
    last bit.

    Args:
        path: Path of the file; it is created if it does not exist. A last line without an end, as a
            killed manager leaves it, is cut off.
        about: Settings that all rounds have in common, such as the trust model.
        after: Position whose earlier rounds need not be read, if they have not changed since; None
            for the start.

    Attributes:
        after: Position from which the rounds were read; None for the start.
        rounds: Number of rounds in the journal.

    Raises:
        ValueError: The file is not a journal, has other settings, or is open in another process.
        OSError: The file cannot be read or written.
    """

    def __init__(
        self, path: Path, about: dict[str, Any], after: JournalPosition | None = None
    ) -> None:
        self.path, self._team = path, Team()
        self.rounds, self._digest, self._size = 0, hashlib.sha256(), 0
        self.after: JournalPosition | None = None
        if path.exists():
            check_file(path, "a journal is a file, or a path where there is nothing yet")
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            self._file = HeldFile(path)
        except BlockingIOError:
            raise ValueError(
                f"{path} is in use by another manager; stop that manager, or name another journal"
            ) from None
        try:
            self._begin({"journal": _VERSION, **about}, after)
        except BaseException:
            self.close()
            raise

    def _begin(self, header: dict[str, Any], after: JournalPosition | None) -> None:
        with self.path.open("rb") as file:
            first = file.readline()
        if _line(header).startswith(first) and not first.endswith(
            b"\n"
        ):  # new, or killed while it wrote the header
            os.ftruncate(self._file.number, 0)
            self._write(header)
            return
        stored = _parse_header(self.path, first)
        if stored != header:
            raise ValueError(
                f"{self.path} is a journal with other settings: {_difference(stored, header)}"
            )
        os.ftruncate(self._file.number, complete_size(self.path))
        with self.path.open("rb") as file:
            if after is not None and self._hash(file, after.offset) == (after.offset, after.digest):
                self.after, self._team, self.rounds = after, after.team, after.round
            self._hash(file, None)
        for entry in read_journal(self.path, self.after):
            self._team, self.rounds = entry.team, entry.round + 1

    def _hash(self, file: IO[bytes], end: int | None) -> tuple[int, str]:
        """Read a file up to an offset or to its end, and return the size and the digest so far."""
        while block := file.read(_BLOCK if end is None else min(_BLOCK, end - self._size)):
            self._digest.update(block)
            self._size += len(block)
        return self._size, self._digest.hexdigest()

    @property
    def position(self) -> JournalPosition:
        """Position after the last round."""
        return JournalPosition(self._size, self._digest.hexdigest(), self.rounds, self._team)

    def append(self, entry: JournalEntry) -> None:
        """Append a round. It is on the disk when this returns.

        Raises:
            ValueError: The round is not the next one.
        """
        if entry.round != self.rounds:
            raise ValueError(f"the next round of the journal is {self.rounds}, not {entry.round}")
        if entry.team != self._team:
            self._write({"raters": entry.team.raters, "providers": entry.team.providers})
        line = {
            "round": entry.round,
            "stamp": entry.stamp,
            "closed": entry.closed,
            "ratings": dict(entry.ratings),
            "missing": entry.missing,
            **entry.trust._asdict(),
        }
        if entry.signed:
            line["signed"] = {
                rater: b64encode(message).decode() for rater, message in entry.signed.items()
            }
        self._write(line)
        self._team, self.rounds = entry.team, self.rounds + 1

    def close(self) -> None:
        """Close the file and release it to other processes."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self.close()

    def _write(self, data: dict[str, Any]) -> None:
        self._file.check()
        line = _line(data)
        self._digest.update(line)
        self._size += len(line)
        while line:  # a nearly full disk writes only a part
            line = line[os.write(self._file.number, line) :]
        os.fsync(self._file.number)


def read_settings(path: Path) -> dict[str, Any]:
    """Return the settings that all rounds of a journal have in common, such as the trust model.

    Raises:
        ValueError: The file is not a journal.
        OSError: The file cannot be read.
    """
    with path.open("rb") as file:
        return _parse_header(path, file.readline())


def read_journal(path: Path, after: JournalPosition | None = None) -> Iterator[JournalEntry]:
    """Iterate over the rounds of a journal, even while a manager is writing it.

    Args:
        path: Path of the journal.
        after: Position from which to read; None for the start.

    Raises:
        ValueError: The file is not a journal, or a line is damaged or missing.
        OSError: The file cannot be read.
    """
    team, rounds = Team(), 0
    with path.open("rb") as file:
        _parse_header(path, file.readline())
        if after is not None:
            team, rounds = after.team, after.round
            file.seek(after.offset)
        for line in file:
            if not line.endswith(b"\n"):
                return
            try:
                data = _LINES.validate_json(line)
                if isinstance(data, _TeamLine):
                    team = Team(data.raters, data.providers)
                    continue
                entry = _entry(data, team)
            except ValueError:
                raise _damaged(path, line) from None
            if entry.round != rounds:
                raise ValueError(
                    f"{path} is damaged: it has round {entry.round} in place of round {rounds}"
                )
            yield entry
            rounds += 1


class Snapshot(NamedTuple):
    """The memory of a manager after a round.

    Attributes:
        position: Place in the journal after the round.
        stamp: Stamp of the round, nanoseconds.
        last_stamps: Last accepted stamp of each rater, nanoseconds.
        run: All that the run keeps, see `TeamRun.save`.
    """

    position: JournalPosition
    stamp: int
    last_stamps: dict[str, int]
    run: dict[str, NDArray[Any]]


def snapshot_path(journal: Path) -> Path:
    """Return the path of the snapshot of a journal."""
    return journal.with_name(f"{journal.name}.snapshot")


def write_snapshot(journal: Path, snapshot: Snapshot) -> None:
    """Write the snapshot of a journal in place of the one before.

    Raises:
        OSError: The file cannot be written.
    """
    offset, digest, number, team = snapshot.position
    header = _SnapshotHeader(
        raters=team.raters,
        providers=team.providers,
        position=(offset, digest, number),
        stamp=snapshot.stamp,
        last_stamps=snapshot.last_stamps,
    )
    arrays = {"header": np.frombuffer(header.model_dump_json().encode(), np.uint8), **snapshot.run}
    save_arrays(snapshot_path(journal), arrays)


def read_snapshot(journal: Path) -> Snapshot | None:
    """Return the snapshot of a journal; None if there is none.

    Raises:
        ValueError: It is damaged, or of another version. The message says what is wrong, without
            the path.
        OSError: It cannot be read.
    """
    try:
        run = load_arrays(snapshot_path(journal))
    except FileNotFoundError:
        return None
    header = parse_untrusted(_SnapshotHeader, taken(run, "header", np.uint8, (None,)).tobytes())
    position = JournalPosition(*header.position, Team(header.raters, header.providers))
    return Snapshot(position, header.stamp, header.last_stamps, run)


def _entry(line: "_RoundLine", team: Team) -> JournalEntry:
    """Return the round of a line.

    Raises:
        ValueError: The line is not a round of this team.
    """
    trust, ratings, sizes = (
        Trust(line.tor, line.top, line.toa),
        line.ratings,
        (len(team.raters), len(team.providers)),
    )
    if sizes != (len(trust.tor), len(trust.top)) or not set(ratings) <= set(team.raters):
        raise ValueError("the round is of another team")
    if any(len(row) > len(team.providers) for row in ratings.values()):
        raise ValueError("the round has more providers than the team")
    if not set(line.signed) <= set(team.raters):
        raise ValueError("a signed message is of another team")
    signed = {rater: _decode_base64(text) for rater, text in line.signed.items()}
    return JournalEntry(
        line.round, line.stamp, line.closed, team, ratings, line.missing, trust, signed
    )


def _decode_base64(text: str) -> bytes:
    """Return the bytes of a text in base64.

    Raises:
        ValueError: The text is not the only one in base64 that has these bytes.
    """
    data = b64decode(text)
    if b64encode(data).decode() != text:
        raise ValueError("the text is not canonical base64")
    return data


def complete_size(path: Path) -> int:
    """Return the size of a journal without an unfinished last line, and without the line of a team
    whose first round is not there, bytes.
    """
    if not path.stat().st_size:
        return 0
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
        end = text.rfind(b"\n") + 1
        last = text.rfind(b"\n", 0, max(end - 1, 0)) + 1
        return last if text[last:end].startswith(b'{"raters"') else end


def _line(data: dict[str, Any]) -> bytes:
    return (json.dumps(data, allow_nan=False) + "\n").encode()


def _parse_header(path: Path, line: bytes) -> dict[str, Any]:
    """Return the first line of a journal.

    Raises:
        ValueError: It is not that of a journal of this format.
    """
    header = _parse(path, line)
    if header.get("journal") != _VERSION:
        raise ValueError(f"{path} is no journal of format {_VERSION}")
    return header


def _parse(path: Path, line: bytes) -> dict[str, Any]:
    try:
        data = parse_json(line)
    except ValueError:  # neither JSON nor, perhaps, text
        data = None
    if not isinstance(data, dict):
        raise _damaged(path, line)
    return data


def _damaged(path: Path, line: bytes) -> ValueError:
    return ValueError(
        f"{path} is no journal: {line[:60].decode(errors='replace').rstrip()!r} is not a line of "
        "one"
    )


def _difference(stored: dict[str, Any], header: dict[str, Any]) -> str:
    keys = [key for key in {**stored, **header} if stored.get(key) != header.get(key)]
    return "; ".join(
        f"{key} is {stored.get(key)!r} there and {header.get(key)!r} here" for key in keys
    )
