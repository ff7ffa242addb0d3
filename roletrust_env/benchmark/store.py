"""Where results are kept as they come: one SQLite file a run, from which a killed run goes on."""

import json
import platform
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, Self

from filelock import FileLock, Timeout
from pydantic import FiniteFloat, TypeAdapter, ValidationError

from roletrust_env.benchmark.schema import AttackResult, CellResult
from roletrust_env.benchmark.sources import hashes
from roletrust_env.benchmark.suite import read_suite
from roletrust_env.benchmark.suite_types import AnyCell, AnySuite, suite_type
from roletrust_env.errors import explain
from roletrust_env.storage.provenance import software

FORMAT = 2
"""Of the file; one of another format is refused."""

_TABLES = """
CREATE TABLE facts (name TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE cells (
    key TEXT PRIMARY KEY, cell TEXT NOT NULL, seconds REAL NOT NULL, unsuitable TEXT NOT NULL, failed TEXT NOT NULL,
    env_steps INTEGER NOT NULL, host TEXT NOT NULL
) WITHOUT ROWID;
CREATE TABLE attacks (
    cell TEXT NOT NULL REFERENCES cells (key), attack TEXT NOT NULL, words TEXT NOT NULL, rounds INTEGER NOT NULL,
    chosen TEXT NOT NULL, measured TEXT NOT NULL, by_round TEXT NOT NULL,
    PRIMARY KEY (cell, attack)
) WITHOUT ROWID;
"""


_Numbers = list[FiniteFloat | None]
_NUMBERS, _SCORES = TypeAdapter(_Numbers), TypeAdapter(dict[str, _Numbers])


class StoredCell(NamedTuple):
    """A cell and what became of it."""

    cell: Any
    done: CellResult


class Store:
    """The file of a run. Who writes is alone; anybody may read meanwhile.

    Args:
        path: of the file.
        suite: that is to be written; None opens the file for reading.
        anew: whether what the file holds is thrown away before; never while another run writes to it.

    Raises:
        ValueError: there is nothing to read, or it is damaged, of another format, of another suite or of other
            software or source, or another run writes to it.
        OSError: it cannot be written.
    """

    def __init__(self, path: Path, suite: AnySuite | None = None, *, anew: bool = False) -> None:
        self.path = path
        self._lock: FileLock | None = None
        self._file: sqlite3.Connection | None = None
        if suite is None and path.is_dir():
            raise ValueError(f"{path} is a folder; name the results.sqlite in it")
        if suite is None and not path.is_file():
            raise ValueError(f"there is no {path}; `roletrust benchmark` makes it")
        try:
            with _explained(path):
                if suite is not None:
                    self._lock = _alone(path)
                    if anew:
                        _remove(path)
                mode = "ro" if suite is None else "rwc"
                self._file = sqlite3.connect(f"{path.resolve().as_uri()}?mode={mode}", uri=True, isolation_level=None)
                if suite is not None and not self._tables():
                    _prepare(self._file, suite)
                facts = self._facts()
            self.suite = read_suite(facts["suite"], str(path))
            self.software: dict[str, Any] = facts["software"]
            self._sources: dict[str, str] = facts.get("sources", {})
            if suite is not None:
                self._check(suite)
                with _explained(path):
                    self._file.execute("PRAGMA journal_mode=WAL")
                    self._file.execute("PRAGMA synchronous=NORMAL")
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        """Itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()

    def close(self) -> None:
        """Let others write."""
        if self._file is not None:
            self._file.close()
        if self._lock is not None:
            self._lock.release()

    def add(self, cell: AnyCell, done: CellResult) -> None:
        """Keep what became of a cell, whole or not at all; what was kept of it before goes."""
        row = (cell.key, json.dumps(cell._asdict()), *done[1:], platform.node())
        attacks = [(cell.key, part.attack, part.words, part.rounds, *map(json.dumps, part[3:])) for part in done.rows]
        with self._changing() as file:
            file.execute("DELETE FROM attacks WHERE cell = ?", (cell.key,))
            file.execute(f"INSERT OR REPLACE INTO cells VALUES ({', '.join('?' * len(row))})", row)
            file.executemany("INSERT INTO attacks VALUES (?, ?, ?, ?, ?, ?, ?)", attacks)

    def finished(self) -> set[str]:
        """The keys of the cells that need not be played again: all that did not fail."""
        with self._reading() as file:
            return {key for (key,) in file.execute("SELECT key FROM cells WHERE failed = ''")}

    def hosts(self) -> set[str]:
        """The machines that cells were played on."""
        with self._reading() as file:
            return {host for (host,) in file.execute("SELECT DISTINCT host FROM cells")}

    def all(self) -> list[StoredCell]:
        """All cells with what became of them, in the order of their keys."""
        with self._reading() as file:
            attacks: dict[str, list[AttackResult]] = {}
            for key, name, words, rounds, *plain in file.execute("SELECT * FROM attacks ORDER BY 1, 2"):
                attacks.setdefault(key, []).append(_row(name, words, rounds, *plain))
            found = file.execute(
                "SELECT key, cell, seconds, unsuitable, failed, env_steps FROM cells ORDER BY key"
            ).fetchall()
            kind = suite_type(self.suite)
            made = [(key, kind.cell(**json.loads(cell)), rest) for key, cell, *rest in found]
        return [StoredCell(cell, CellResult(tuple(attacks.get(key, ())), *rest)) for key, cell, rest in made]

    def _tables(self) -> int:
        """How many tables there are; 0 in a new file."""
        with self._reading() as file:
            return int(file.execute("SELECT count(*) FROM sqlite_master").fetchone()[0])

    def _facts(self) -> dict[str, Any]:
        """What the file says of itself, once it is known to be whole and of this format."""
        with self._reading() as file:
            facts = {name: json.loads(value) for name, value in file.execute("SELECT name, value FROM facts")}
            if facts.get("format") != FORMAT:
                raise ValueError(f"{self.path} has the format {facts.get('format')!r}; this version reads {FORMAT}")
            if not {"suite", "software"} <= facts.keys():
                raise sqlite3.DatabaseError("it does not say what it is of")
            for (found,) in file.execute("PRAGMA quick_check"):
                if found != "ok":
                    raise sqlite3.DatabaseError(" ".join(str(found).split()))
        return facts

    def _check(self, suite: AnySuite) -> None:
        """See that a run to go on with is the same."""
        if self.suite != suite:
            names = [
                name for name in type(suite).model_fields if getattr(self.suite, name, None) != getattr(suite, name)
            ]
            raise ValueError(
                f"{self.path} holds another suite (not the same: {', '.join(names)}); give another --out, or begin "
                "anew with --force"
            )
        if self.software != software():
            raise ValueError(f"{self.path} was made with other versions of the software; begin anew with --force")
        self.check_sources(suite)

    def check_sources(self, suite: AnySuite) -> None:
        """See that what was played is what is here.

        Args:
            suite: all that it names is imported.

        Raises:
            ValueError: a model, an attack or a learner has another source now.
        """
        here = hashes(suite_type(suite).named(suite))
        changed = [name for name, found in here.items() if self._sources.get(name, found) != found]
        if changed:
            raise ValueError(
                f"{self.path} was played with another source of {', '.join(changed)}, or with other parameters; give "
                "another --out, or begin anew with --force"
            )

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        assert self._file is not None
        with _explained(self.path):
            yield self._file

    @contextmanager
    def _changing(self) -> Iterator[sqlite3.Connection]:
        with self._reading() as file:
            file.execute("BEGIN IMMEDIATE")
            try:
                yield file
                file.execute("COMMIT")
            except BaseException:
                if file.in_transaction:
                    file.execute("ROLLBACK")
                raise


def _alone(path: Path) -> FileLock:
    """The lock of the one who writes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lock = FileLock(f"{path}.lock")
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise ValueError(f"another run writes to {path}; wait for it, or give another --out") from None
    return lock


def _remove(path: Path) -> None:
    """Remove a file and what SQLite keeps beside it; not the lock, which is held."""
    for end in ("", "-wal", "-shm"):
        Path(f"{path}{end}").unlink(missing_ok=True)


def _prepare(file: sqlite3.Connection, suite: AnySuite) -> None:
    """Make the tables of a new file, all or none."""
    sources = hashes(suite_type(suite).named(suite))
    facts = {"format": FORMAT, "suite": suite.model_dump(mode="json"), "software": software(), "sources": sources}
    rows = ", ".join(f"('{name}', '{_quoted(json.dumps(value))}')" for name, value in facts.items())
    file.executescript(f"BEGIN; {_TABLES} INSERT INTO facts VALUES {rows}; COMMIT;")


def _row(attack: str, words: str, rounds: int, chosen: str, measured: str, by_round: str) -> AttackResult:
    """An attack as it was kept."""
    scores = _SCORES.validate_json(chosen), _SCORES.validate_json(measured)
    return AttackResult(attack, words, rounds, *scores, _NUMBERS.validate_json(by_round))


def _quoted(text: str) -> str:
    return text.replace("'", "''")


_UNWRITABLE = {sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY}
_HELD = {sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED}


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """SQLite's errors as one line that says what to do."""
    try:
        yield
    except ValidationError as error:
        raise ValueError(f"{path} is no benchmark's file, or it is damaged: {explain(error)}") from None
    except (sqlite3.DatabaseError, json.JSONDecodeError, TypeError, AttributeError, RecursionError) as error:
        code = getattr(error, "sqlite_errorcode", 0) & 0xFF  # the rest says more than is needed
        if code in _UNWRITABLE:
            raise OSError(f"{path} cannot be written: {error}; what it holds stays, make room and go on") from None
        if code in _HELD:
            raise ValueError(f"{path} is held by another program ({error}); close that, and go on") from None
        raise ValueError(f"{path} is no benchmark's file, or it is damaged: {error}") from None
