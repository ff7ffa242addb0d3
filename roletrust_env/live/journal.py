"""The journal of a manager: every round on disk before it is published, so that nothing that was said is lost."""

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, Self

from roletrust_env.live.trust_tracker import Rows, Team, Trust

_VERSION = 1


class Published(NamedTuple):
    """The trust after a round, as everybody hears it.

    Attributes:
        round: its number.
        stamp: of its services, nanoseconds.
        tor: of the raters, by name.
        top: of the providers, by name.
        missing: raters that were waited for, in vain.
    """

    round: int
    stamp: int
    tor: dict[str, float]
    top: dict[str, float]
    missing: tuple[str, ...]


class Entry(NamedTuple):
    """A round with all that led to it.

    Attributes:
        round: its number, from 0.
        stamp: the earliest of its messages, nanoseconds.
        closed: when it was closed, nanoseconds.
        team: who stood where.
        rows: the ratings.
        missing: raters that were waited for, in vain.
        trust: after the round.
    """

    round: int
    stamp: int
    closed: int
    team: Team
    rows: Rows
    missing: tuple[str, ...]
    trust: Trust

    @property
    def published(self) -> Published:
        """What everybody hears of it."""
        tor = dict(zip(self.team.raters, self.trust.tor, strict=True))
        top = dict(zip(self.team.providers, self.trust.top, strict=True))
        return Published(self.round, self.stamp, tor, top, self.missing)


class Journal:
    """A file of one line of JSON for each round, which grows only; a line for the team stands before its first round.

    Floats are written so that they are read back to the last bit.

    Args:
        path: of the file; it is made if need be. What was only half written when a manager was killed is cut off.
        about: what all its rounds have in common, such as the trust model.

    Raises:
        ValueError: the file is no journal, is about something else, or another process has it open.
        OSError: it cannot be read or written.
    """

    def __init__(self, path: Path, about: dict[str, Any]) -> None:
        self.path, self._team = path, Team()
        self._rounds = 0
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        try:
            _lock(self._file, path)
            self._begin({"journal": _VERSION, **about})
        except BaseException:
            self.close()
            raise

    def _begin(self, header: dict[str, Any]) -> None:
        with self.path.open("rb") as file:
            first = file.readline()
        if _line(header).startswith(first) and not first.endswith(b"\n"):  # new, or killed at once
            os.ftruncate(self._file, 0)
            self._write(header)
            return
        found = _parsed(self.path, first)
        if found.get("journal") != _VERSION:
            raise ValueError(f"{self.path} is no journal of version {_VERSION}")
        if found != header:
            raise ValueError(f"{self.path} is the journal of something else: {_difference(found, header)}")
        os.ftruncate(self._file, _whole(self.path))
        for entry in self.entries():
            self._team, self._rounds = entry.team, entry.round + 1

    @property
    def rounds(self) -> int:
        """How many rounds it holds."""
        return self._rounds

    def entries(self) -> Iterator[Entry]:
        """The rounds so far."""
        return read_journal(self.path)

    def append(self, entry: Entry) -> None:
        """Write a round; when this returns it is on the disk.

        Raises:
            ValueError: it is not the next one.
        """
        if entry.round != self._rounds:
            raise ValueError(f"round {entry.round} is not the next one, which is {self._rounds}")
        if entry.team != self._team:
            self._write({"raters": entry.team.raters, "providers": entry.team.providers})
        when = {"round": entry.round, "stamp": entry.stamp, "closed": entry.closed}
        self._write({**when, "ratings": dict(entry.rows), "missing": entry.missing, **entry.trust._asdict()})
        self._team, self._rounds = entry.team, self._rounds + 1

    def close(self) -> None:
        """Leave it to others."""
        os.close(self._file)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self.close()

    def _write(self, data: dict[str, Any]) -> None:
        line = _line(data)
        while line:  # a disk that is nearly full takes a part
            line = line[os.write(self._file, line) :]
        os.fsync(self._file)


def read_journal(path: Path) -> Iterator[Entry]:
    """The rounds of a journal, also of one that a manager is writing.

    Raises:
        ValueError: the file is no journal, or a line of it is damaged or lost.
        OSError: it cannot be read.
    """
    team, rounds = Team(), 0
    with path.open("rb") as file:
        header = _parsed(path, file.readline())
        if header.get("journal") != _VERSION:
            raise ValueError(f"{path} is no journal of version {_VERSION}")
        for line in file:
            if not line.endswith(b"\n"):
                return
            said = _parsed(path, line)
            try:
                if "round" not in said:
                    team = Team(tuple(said["raters"]), tuple(said["providers"]))
                    continue
                entry = _entry(said, team)
            except (KeyError, TypeError, ValueError):
                raise _damaged(path, line) from None
            if entry.round != rounds:
                raise ValueError(f"{path} is damaged: round {entry.round} stands where round {rounds} should be")
            yield entry
            rounds += 1


def _entry(said: dict[str, Any], team: Team) -> Entry:
    """A round of its line.

    Raises:
        KeyError, TypeError, ValueError: it is none.
    """
    trust, rows = Trust(*(tuple(said[name]) for name in Trust._fields)), said["ratings"]
    when = int(said["round"]), int(said["stamp"]), int(said["closed"])
    sizes = len(team.raters), len(team.providers)
    if sizes != (len(trust.tor), len(trust.top)) or not set(rows) <= set(team.raters):
        raise ValueError("it is of another team")
    if any(len(row) > len(team.providers) for row in rows.values()):
        raise ValueError("it is of more providers")
    return Entry(*when, team, rows, tuple(said["missing"]), trust)


def _lock(file: int, path: Path) -> None:
    """Keep a file to this process, as long as it has it open."""
    import fcntl  # not all systems have it, and the rest of the library runs on them

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise ValueError(f"{path} is the journal of a manager that is running; stop it, or name another") from None


def _whole(path: Path) -> int:
    """The length of a file without a last line that has no end."""
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        at, tail = size, b""
        while at > 0 and b"\n" not in tail:
            at = max(0, at - 65536)
            file.seek(at)
            tail = file.read(min(65536, size - at))
    return at + tail.rfind(b"\n") + 1


def _line(data: dict[str, Any]) -> bytes:
    return (json.dumps(data, allow_nan=False) + "\n").encode()


def _parsed(path: Path, line: bytes) -> dict[str, Any]:
    try:
        said = json.loads(line)
    except ValueError:  # neither JSON nor, perhaps, text
        said = None
    if not isinstance(said, dict):
        raise _damaged(path, line)
    return said


def _damaged(path: Path, line: bytes) -> ValueError:
    return ValueError(f"{path} is no journal: {line[:60].decode(errors='replace').rstrip()!r} is none of its lines")


def _difference(found: dict[str, Any], header: dict[str, Any]) -> str:
    keys = [key for key in {**found, **header} if found.get(key) != header.get(key)]
    return "; ".join(f"{key} is {found.get(key)!r} there and {header.get(key)!r} here" for key in keys)
