"""Where results are kept as they come: one SQLite file a run, from which a killed run goes on."""

import json
import platform
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, Self

from filelock import FileLock, Timeout

from experiments.benchmark.cells import Cell
from experiments.benchmark.suite import Suite, read_suite
from experiments.benchmark.work import Done, Row
from experiments.results.files import software

FORMAT = 1
"""Of the file; one of another format is refused."""

_TABLES = """
CREATE TABLE facts (name TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE cells (
    key TEXT PRIMARY KEY, model TEXT NOT NULL, scenario TEXT NOT NULL, track TEXT NOT NULL, share REAL NOT NULL,
    rung TEXT NOT NULL, seed INTEGER NOT NULL, seconds REAL NOT NULL, env_steps INTEGER NOT NULL,
    unsuitable TEXT NOT NULL, failed TEXT NOT NULL, host TEXT NOT NULL
) WITHOUT ROWID;
CREATE TABLE attacks (
    cell TEXT NOT NULL REFERENCES cells (key), attack TEXT NOT NULL, words TEXT NOT NULL, rounds INTEGER NOT NULL,
    chosen TEXT NOT NULL, measured TEXT NOT NULL, PRIMARY KEY (cell, attack)
) WITHOUT ROWID;
"""


class Kept(NamedTuple):
    """A cell and what became of it."""

    cell: Cell
    done: Done


class Store:
    """The file of a run. Who writes is alone; anybody may read meanwhile.

    Args:
        path: of the file.
        suite: that is to be written; None opens the file for reading.

    Raises:
        ValueError: there is nothing to read, or it is damaged, of another format, of another suite or of other
            software, or another run writes to it.
        OSError: it cannot be written.
    """

    def __init__(self, path: Path, suite: Suite | None = None) -> None:
        self.path = path
        self._lock: FileLock | None = None
        self._file: sqlite3.Connection | None = None
        if suite is None and not path.is_file():
            raise ValueError(f"there is no {path}; `roletrust benchmark` makes it")
        try:
            with _explained(path):
                if suite is not None:
                    self._lock = _alone(path)
                mode = "ro" if suite is None else "rwc"
                self._file = sqlite3.connect(f"{path.resolve().as_uri()}?mode={mode}", uri=True, isolation_level=None)
                if suite is not None:
                    _prepare(self._file, suite)
                facts = self._facts()
            if facts.get("format") != FORMAT:
                raise ValueError(f"{path} has the format {facts.get('format')!r}; this version reads {FORMAT}")
            self.suite = read_suite(facts["suite"], str(path))
            self.software: dict[str, Any] = facts["software"]
            if suite is not None:
                self._check(suite)
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

    def add(self, cell: Cell, done: Done) -> None:
        """Keep what became of a cell, whole or not at all; what was kept of it before goes."""
        row = (cell.key, *cell, done.seconds, done.env_steps, done.unsuitable, done.failed, platform.node())
        attacks = [
            (cell.key, part.attack, part.words, part.rounds, json.dumps(part.chosen), json.dumps(part.measured))
            for part in done.rows
        ]
        with self._changing() as file:
            file.execute("DELETE FROM attacks WHERE cell = ?", (cell.key,))
            file.execute(f"INSERT OR REPLACE INTO cells VALUES ({', '.join('?' * len(row))})", row)
            file.executemany("INSERT INTO attacks VALUES (?, ?, ?, ?, ?, ?)", attacks)

    def finished(self) -> set[str]:
        """The keys of the cells that need not be played again: all that did not fail."""
        with self._reading() as file:
            return {key for (key,) in file.execute("SELECT key FROM cells WHERE failed = ''")}

    def all(self) -> list[Kept]:
        """All cells with what became of them, in the order of their keys."""
        with self._reading() as file:
            attacks: dict[str, list[Row]] = {}
            for key, name, words, rounds, chosen, measured in file.execute("SELECT * FROM attacks ORDER BY 1, 2"):
                attacks.setdefault(key, []).append(Row(name, words, rounds, json.loads(chosen), json.loads(measured)))
            found = file.execute(
                "SELECT model, scenario, track, share, rung, seed, seconds, unsuitable, failed, env_steps, key "
                "FROM cells ORDER BY key"
            ).fetchall()
        return [Kept(Cell(*row[:6]), Done(tuple(attacks.get(row[10], ())), *row[6:10])) for row in found]

    def _facts(self) -> dict[str, Any]:
        with self._reading() as file:
            return {name: json.loads(value) for name, value in file.execute("SELECT name, value FROM facts")}

    def _check(self, suite: Suite) -> None:
        """See that a run to go on with is the same."""
        if self.suite != suite:
            names = [name for name in Suite.model_fields if getattr(self.suite, name) != getattr(suite, name)]
            raise ValueError(
                f"{self.path} holds another suite (not the same: {', '.join(names)}); give another --out, or begin "
                "anew with --force"
            )
        if self.software != software():
            raise ValueError(f"{self.path} was made with other versions of the software; begin anew with --force")

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


def _prepare(file: sqlite3.Connection, suite: Suite) -> None:
    """Make the tables if the file is new."""
    file.execute("PRAGMA journal_mode=WAL")
    file.execute("PRAGMA synchronous=NORMAL")
    if file.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
        return
    facts = {"format": FORMAT, "suite": suite.model_dump(mode="json"), "software": software()}
    rows = ", ".join(f"('{name}', '{_quoted(json.dumps(value))}')" for name, value in facts.items())
    file.executescript(f"BEGIN; {_TABLES} INSERT INTO facts VALUES {rows}; COMMIT;")


def _quoted(text: str) -> str:
    return text.replace("'", "''")


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """SQLite's errors as one line that says what to do."""
    try:
        yield
    except (sqlite3.DatabaseError, json.JSONDecodeError) as error:
        if "full" in str(error) or "I/O" in str(error):
            raise OSError(f"{path} cannot be written: {error}; what was kept stays, make room and go on") from None
        raise ValueError(f"{path} is no benchmark's file, or it is damaged: {error}") from None
