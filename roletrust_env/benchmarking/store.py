"""Storage of results: one SQLite file for each run. A stopped run continues from its file.

It also continues with a larger suite, for example with further models, seeds or methods.
"""

import json
import platform
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any, NamedTuple, Self

from filelock import FileLock
from pydantic import Field, TypeAdapter, ValidationError

from roletrust_env.benchmarking.schema import AnyCell, AttackResult, CellResult, SuiteSchema
from roletrust_env.benchmarking.sources import hashes
from roletrust_env.benchmarking.suite_files import AnySuite, read_suite
from roletrust_env.errors import short, validation_message
from roletrust_env.storage.files import write_lock
from roletrust_env.storage.provenance import software
from roletrust_env.storage.untrusted import UntrustedModel, check_file

_ROUNDING = 1e-9  # of a score at the end of its range

FORMAT = 6
"""Version of the file format."""

_TABLES = """
CREATE TABLE facts (name TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE cells (
    key TEXT PRIMARY KEY, cell TEXT NOT NULL, seconds REAL NOT NULL, unsuitable TEXT NOT NULL, failed TEXT NOT NULL,
    env_steps INTEGER NOT NULL, host TEXT NOT NULL
) WITHOUT ROWID;
CREATE TABLE attacks (
    cell TEXT NOT NULL REFERENCES cells (key), attack TEXT NOT NULL, words TEXT NOT NULL, rounds INTEGER NOT NULL,
    chosen TEXT NOT NULL, measured TEXT NOT NULL, by_round TEXT NOT NULL,
    record TEXT NOT NULL, progress TEXT NOT NULL,
    PRIMARY KEY (cell, attack)
) WITHOUT ROWID;
"""  # noqa: E501

_JOURNALS = "-wal", "-shm"

_ATTACK = TypeAdapter(AttackResult)
_RESULT = TypeAdapter(CellResult)


class _Facts(UntrustedModel):
    """Facts in a file about its run: the fields of its suite, and what the results depend on."""

    format: int
    suite: dict[str, Any]
    software: dict[str, Any]
    sources: dict[str, str] = Field(default_factory=dict)


class StoredCell(NamedTuple):
    """Cell with its result.

    Attributes:
        cell: The cell, or the trial of a learner.
        result: Result of the cell.
    """

    cell: Any
    result: CellResult


class ResultStore:
    """File of a run. It has one writer at a time and any number of readers.

    Args:
        path: Path of the file.
        suite: Suite of the run to write. None opens the file for reading.

    Raises:
        ValueError: The file does not exist, is damaged, is being written by another run, has
            another format, software or source, or has cells that the suite lacks or plays in
            another way.
        OSError: The file cannot be written.
    """

    def __init__(self, path: Path, suite: AnySuite | None = None) -> None:
        self.path = path
        self._lock: FileLock | None = None
        self._file: sqlite3.Connection | None = None
        self._stray: list[Path] = []  # journals that a reader may leave
        if suite is None:
            check_file(path, "`roletrust benchmark` creates it", wanted="the results.sqlite in it")
        try:
            with _readable_errors(path):
                if suite is not None:
                    self._lock = write_lock(path)
                mode = "mode=rwc"
                if suite is None:
                    journals = [
                        end for end in ("-journal", *_JOURNALS) if Path(f"{path}{end}").exists()
                    ]
                    mode = "mode=ro" if journals else "immutable=1"  # a finished run has no journal
                    self._stray = [Path(f"{path}{end}") for end in _JOURNALS if end not in journals]
                self._file = sqlite3.connect(
                    f"{path.resolve().as_uri()}?{mode}", uri=True, isolation_level=None
                )
                if suite is not None and not self._tables():
                    _prepare(self._file, suite)
                facts = self._facts()
            self.suite = read_suite(facts.suite, str(path))
            self.software, self._sources = facts.software, facts.sources
            if suite is not None:
                self._check(suite)
                with _readable_errors(path):
                    self._file.execute("PRAGMA journal_mode=WAL")
                    self._file.execute("PRAGMA synchronous=NORMAL")
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        """Return the store."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self.close()

    def close(self) -> None:
        """Close the file and let others write to it."""
        if self._file is not None:
            self._file.close()
        if self._lock is not None:
            self._lock.release()
        if any(journal.exists() for journal in self._stray):
            begun = Path(
                f"{self.path}.lock"
            ).exists()  # journals of a run that has begun since are its own
            with suppress(ValueError, OSError), write_lock(self.path) if begun else nullcontext():
                for journal in self._stray:
                    journal.unlink(missing_ok=True)

    def add(self, cell: AnyCell, result: CellResult) -> None:
        """Store the result of a cell in one transaction. It replaces an earlier result of the
        cell.
        """
        row = (cell.key, json.dumps(cell._asdict()), *result[1:], platform.node())
        attacks = [
            (
                *(cell.key, *part[:3], *map(json.dumps, part[3:6])),
                *(part.record, json.dumps(part.progress)),
            )
            for part in result.rows
        ]
        with self._transaction() as file:
            file.execute("DELETE FROM attacks WHERE cell = ?", (cell.key,))
            file.execute(f"INSERT OR REPLACE INTO cells VALUES ({', '.join('?' * len(row))})", row)
            file.executemany(f"INSERT INTO attacks VALUES ({', '.join('?' * 9)})", attacks)

    def finished_keys(self) -> set[str]:
        """Return the keys of the cells that were played without a failure."""
        with self._reading() as file:
            return {key for (key,) in file.execute("SELECT key FROM cells WHERE failed = ''")}

    def all(self) -> list[StoredCell]:
        """Return all cells with their results, in the order of their keys."""
        with self._reading() as file:
            attacks: dict[str, list[AttackResult]] = {}
            for (
                key,
                *plain,
                chosen,
                measured,
                by_round,
                record,
                progress,
            ) in file.execute("SELECT * FROM attacks ORDER BY 1, 2"):
                values = map(json.loads, (chosen, measured, by_round))
                row = (*plain, *values, record, json.loads(progress))
                attacks.setdefault(key, []).append(_ATTACK.validate_python(row))
            rows = file.execute(
                "SELECT key, cell, seconds, unsuitable, failed, env_steps FROM cells ORDER BY key"
            ).fetchall()
            cells, found_cells = {cell.key: cell for cell in self.suite.cells()}, list[StoredCell]()
            for key, cell, *columns in rows:
                result = _RESULT.validate_python(((), *columns))._replace(
                    rows=tuple(attacks.pop(key, ()))
                )
                if key not in cells or json.loads(cell) != cells[key]._asdict():
                    raise sqlite3.DatabaseError(f"cell {short(key)} is none of the suite")
                if any(not self._has_scores(row) for row in result.rows):
                    raise sqlite3.DatabaseError(
                        f"cell {short(key)} has other scores than its suite, or one out of range"
                    )
                found_cells.append(StoredCell(cells[key], result))
            if attacks:
                raise sqlite3.DatabaseError(
                    f"attacks are of cell {short(min(attacks))}, which is missing"
                )
        return found_cells

    def _has_scores(self, row: AttackResult) -> bool:
        """Return whether an attack has scores of the suite, each for the same games and within its
        range. An attack that was chosen from may lack the measured ones, and a stored run the
        scores that are newer than itself.
        """
        parts = [(row.chosen, self.suite.chosen_scores)]
        if row.measured or not row.chosen:
            parts.append((row.measured, self.suite.measured_scores))
        sizes = [{len(part[name]) for name in ranges if name in part} for part, ranges in parts]
        if any(name not in part for part, ranges in parts for name in list(ranges)[:1]):
            return False  # the score by which attacks are chosen
        wanted = [int(bool(ranges)) for _, ranges in parts]
        sized = [len(lengths) for lengths in sizes] == wanted and not any(0 in s for s in sizes)
        return sized and all(
            value is None or low - _ROUNDING <= value <= high + _ROUNDING
            for part, ranges in parts
            for name, (low, high) in ranges.items()
            for value in part.get(name, ())
        )

    def _tables(self) -> int:
        """Return the number of tables, which is 0 in a new file."""
        with self._reading() as file:
            return int(file.execute("SELECT count(*) FROM sqlite_master").fetchone()[0])

    def _facts(self) -> "_Facts":
        """Return the metadata of the file after a check of its integrity and its format."""
        with self._reading() as file:
            facts = {
                name: json.loads(value)
                for name, value in file.execute("SELECT name, value FROM facts")
            }
            if facts.get("format") != FORMAT:
                raise ValueError(
                    f"{self.path} has the format {short(repr(facts.get('format')))}; this version "
                    f"reads {FORMAT}"
                )
            for (message,) in file.execute("PRAGMA quick_check"):
                if message != "ok":
                    raise sqlite3.DatabaseError(" ".join(str(message).split()))
            return _Facts.model_validate(facts)

    def _check(self, suite: AnySuite) -> None:
        """Check that the run to continue has the same software and sources, and go on with the
        suite.
        """
        if self.suite != suite and not self._extended_by(suite):
            names = [
                name
                for name in type(suite).model_fields
                if getattr(self.suite, name, None) != getattr(suite, name)
            ]
            raise ValueError(
                f"{self.path} holds another suite (different: {', '.join(names)}), and the new one "
                "lacks cells that "
                "were played, or plays them in another way; give another --out"
            )
        if self.software != software():
            raise ValueError(
                f"{self.path} was written with other software versions; give another --out"
            )
        self.check_sources(suite)
        if self.suite != suite:
            sources = {**self._sources, **hashes(suite.factories())}
            facts = {"suite": suite.model_dump(mode="json"), "sources": sources}
            with self._transaction() as file:
                rows = [(json.dumps(value), name) for name, value in facts.items()]
                file.executemany("UPDATE facts SET value = ? WHERE name = ?", rows)
            self.suite, self._sources = suite, sources

    def _extended_by(self, suite: SuiteSchema) -> bool:
        """Return whether a suite contains all cells in the file, and plays them in the same way."""
        if type(suite) is not type(self.suite):
            return False
        known = {cell.key for cell in suite.cells()}
        with self._reading() as file:
            played: list[Any] = [
                suite.cell_type(**json.loads(cell))
                for (cell,) in file.execute("SELECT cell FROM cells")
            ]
        return all(
            cell.key in known and self.suite.rules(cell) == suite.rules(cell) for cell in played
        )

    def check_sources(self, suite: SuiteSchema) -> None:
        """Check that the models, attacks and learners have the same source as when they were
        played.

        Args:
            suite: Suite of the run. Everything that it names is imported.

        Raises:
            ValueError: The source of a model, an attack or a learner has changed.
        """
        current = hashes(suite.factories())
        changed = [
            name for name, digest in current.items() if self._sources.get(name, digest) != digest
        ]
        if changed:
            raise ValueError(
                f"{self.path} was played with another source of {', '.join(changed)}, or with "
                "other parameters; give another --out"
            )

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        assert self._file is not None
        with _readable_errors(self.path):
            yield self._file

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        with self._reading() as file:
            file.execute("BEGIN IMMEDIATE")
            try:
                yield file
                file.execute("COMMIT")
            except BaseException:
                if file.in_transaction:
                    file.execute("ROLLBACK")
                raise


def _prepare(file: sqlite3.Connection, suite: SuiteSchema) -> None:
    """Create the tables of a new file in one transaction."""
    sources = hashes(suite.factories())
    facts = {
        "format": FORMAT,
        "suite": suite.model_dump(mode="json"),
        "software": software(),
        "sources": sources,
    }
    rows = ", ".join(
        "('{}', '{}')".format(name, json.dumps(value).replace("'", "''"))
        for name, value in facts.items()
    )
    file.executescript(f"BEGIN; {_TABLES} INSERT INTO facts VALUES {rows}; COMMIT;")


_NOT_WRITABLE = {
    sqlite3.SQLITE_FULL,
    sqlite3.SQLITE_IOERR,
    sqlite3.SQLITE_CANTOPEN,
    sqlite3.SQLITE_READONLY,
}
_LOCKED = {sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED}


@contextmanager
def _readable_errors(path: Path) -> Iterator[None]:
    """Turn errors of SQLite into one-line errors that say what to do."""
    try:
        yield
    except ValidationError as error:
        raise ValueError(
            f"{path} is damaged or is not a results file of a benchmark: "
            f"{validation_message(error)}"
        ) from None
    except (
        sqlite3.DatabaseError,
        json.JSONDecodeError,
        TypeError,
        AttributeError,
        RecursionError,
    ) as error:
        code = getattr(error, "sqlite_errorcode", 0) & 0xFF  # the primary result code
        if code in _NOT_WRITABLE:
            raise OSError(
                f"{path} cannot be written: {error}; its content is safe, so free some space and "
                "run the command again"
            ) from None
        if code in _LOCKED:
            raise ValueError(
                f"{path} is locked by another program ({error}); close it and run the command again"
            ) from None
        raise ValueError(
            f"{path} is damaged or is not a results file of a benchmark: {error}"
        ) from None
