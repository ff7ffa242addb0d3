"""The journal of a trust manager in a database: all that it has acknowledged, in order."""

import re
import secrets
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from pydantic import Field, FiniteFloat, TypeAdapter, ValidationError
from sqlalchemy import (
    URL,
    BigInteger,
    Column,
    Connection,
    Double,
    Integer,
    MetaData,
    Select,
    String,
    Table,
    Text,
    bindparam,
    cast,
    create_engine,
    event,
    func,
    insert,
    inspect,
    make_url,
    select,
    text,
    update,
)
from sqlalchemy.exc import ArgumentError, SQLAlchemyError

from roletrust_env.errors import short
from roletrust_manager.admission.keys import NAME, check_name
from roletrust_manager.journal.held_file import HeldFile
from roletrust_manager.journal.merkle import MerkleTree

_SCHEMA = 2
_LOCK = int.from_bytes(b"roletrus")  # the advisory lock of PostgreSQL, one for each database
_WAIT_S = 3.0  # for the lock of a manager that has just been killed

BLOCK = 10_000
"""Number of rows that are read at once."""

_tables = MetaData()
_meta = Table(
    "meta",
    _tables,
    Column("name", String(32), primary_key=True),
    Column("value", Text, nullable=False),
)
_number = BigInteger().with_variant(Integer, "sqlite")  # SQLite has whole numbers of 64 bits only
events = Table(
    "events",
    _tables,
    Column("seq", _number, primary_key=True, autoincrement=False),
    Column("kind", String(8), nullable=False),
    Column("time", _number, nullable=False),
    Column("sender", String(220), nullable=False),
    Column("stamp", _number, nullable=False),
    Column("provider", String(220)),
    Column("rating", Double),
    Column("token", Text, nullable=False),
)
"""Table of the events, see `Event`."""


_APPEND = insert(events)
_HEAD = update(_meta).where(_meta.c.name == "head").values(value=bindparam("head"))


class Event(NamedTuple):
    """Entry that a manager has acknowledged.

    Attributes:
        seq: Number, from 1 without gaps.
        kind: Kind of the token: `register`, `rating`, `rotate` or `leave`.
        time: Time of arrival, microseconds since 1970; that of a request is above that of the one
            before it.
        sender: Agent that has signed it, see `Member.identity`.
        stamp: Time of signing, nanoseconds.
        provider: Rated agent, of a rating.
        rating: Rating, on the scale of the manager.
        token: Token as it came.
    """

    seq: int
    kind: Literal["register", "rating", "rotate", "leave"]
    time: Annotated[int, Field(ge=0, lt=2**53)]
    sender: str
    stamp: Annotated[int, Field(ge=0)]
    provider: str | None
    rating: FiniteFloat | None
    token: str


_events = TypeAdapter(list[Event])


class StoreError(OSError):
    """The store cannot be read or written."""


class JournalStore:
    """The journal in a file of SQLite, or in a database of PostgreSQL. One manager has it at a
    time.

    Args:
        address: Path of the file, which is created if it does not exist, or
            `postgresql://USER:PASSWORD@HOST/DATABASE`.
        name: Name of the manager; of a new store one is made up if none is given.

    Attributes:
        name: Name of the manager, to which tokens are addressed; empty before the store is opened.
        path: Path of the file; None in PostgreSQL.
        key: Key with which the manager signs checkpoints, made with a new store.

    Raises:
        ValueError: The address or the name is not valid.
    """

    def __init__(self, address: str, name: str | None = None) -> None:
        self.path: Path | None = None
        self._file: HeldFile | None = None
        self._connection: Connection | None = None
        self.name, self._wanted = "", name
        if name is not None:
            check_name(name)
        if address and "://" not in address:
            self.path = Path(address).resolve()  # so that no text stands for a database in memory
            url, self._shown = URL.create("sqlite", database=str(self.path)), address
        else:
            try:
                url = make_url(address)
            except ArgumentError:
                raise ValueError(
                    f"the store is {address!r}; it must be a file of SQLite, or postgresql://..."
                ) from None
            self._shown = url.render_as_string(hide_password=True)
            if url.drivername != "postgresql":
                raise ValueError(
                    f"the store is {self._shown}; it must be a file of SQLite, or postgresql://..."
                )
            url = url.set(drivername="postgresql+psycopg")
        self._engine = create_engine(url, pool_pre_ping=True)
        if self.path is not None:
            event.listen(self._engine, "connect", _durable)

    def open(self) -> None:
        """Open the store, which makes a new one; nothing happens if it is open.

        Raises:
            ValueError: The store is of another name or schema.
            StoreError: The store cannot be opened, or another manager has it.
        """
        if self.name:
            return
        if self.path is not None:
            try:
                self._file = HeldFile(self.path, 0o600)  # its key signs checkpoints
            except BlockingIOError:
                raise self._in_use() from None
            except OSError as error:
                raise StoreError(f"{self._shown} cannot be opened: {error.strerror}") from None
        try:
            with self._writer().begin():
                self.name = self._opened(self._writer())
            if self.path is not None:  # readers and the writer do not wait for one another then
                self._writer().exec_driver_sql("pragma journal_mode = wal")
                self._writer().commit()
        except SQLAlchemyError as error:
            self.close()
            raise self._failed("cannot be opened", error) from None
        except BaseException:
            self.close()
            raise

    def _opened(self, connection: Connection) -> str:
        """Return the name of the manager, after a check of what the store says of itself; a new one
        is told.
        """
        existing = set(inspect(connection).get_table_names())
        if self.path is not None and (others := existing - set(_tables.tables)):
            raise ValueError(
                f"{self._shown} is a database of another program, with a table {min(others)!r}"
            )
        own = {name: table for name, table in _tables.tables.items() if name in existing}
        filled = {
            name
            for name, stored_table in own.items()
            if connection.execute(select(stored_table).limit(1)).first() is not None
        }
        if filled == {"events"} or (filled and len(own) < len(_tables.tables)):
            raise ValueError(
                f"{self._shown} is damaged: its table meta or its table events is missing or empty"
            )
        _tables.create_all(connection)
        meta: dict[str, str] = {row.name: row.value for row in connection.execute(select(_meta))}
        if not meta:
            meta = {
                "schema": str(_SCHEMA),
                "manager": self._wanted or f"manager-{secrets.token_hex(4)}",
                "head": f"0 {MerkleTree().root().hex()}",
                "key": Ed25519PrivateKey.generate().private_bytes_raw().hex(),
            }
            connection.execute(
                insert(_meta), [{"name": key, "value": value} for key, value in meta.items()]
            )
        if (schema := meta.get("schema")) != str(_SCHEMA):
            raise ValueError(f"{self._shown} has format {schema}; format {_SCHEMA} is read here")
        if not re.fullmatch(NAME, str(meta.get("manager", ""))):
            raise ValueError(
                f"{self._shown} is damaged: its manager is called "
                f"{short(repr(meta.get('manager', '')))}"
            )
        if self._wanted not in (None, meta["manager"]):
            raise ValueError(
                f"{self._shown} is of the manager {meta['manager']}, not of {self._wanted}; tokens "
                "name it"
            )
        try:
            self.key = Ed25519PrivateKey.from_private_bytes(bytes.fromhex(meta.get("key", "")))
        except ValueError:
            raise ValueError(f"{self._shown} is damaged: its key is none") from None
        return meta["manager"]

    @property
    def origin(self) -> str:
        """Name of the journal in checkpoints."""
        return f"roletrust/{self.name.replace('+', '%2B')}"

    def append(self, new: Sequence[Event], root: bytes) -> None:
        """Write events in one transaction. They are on the disk then.

        Args:
            new: Events.
            root: Root hash of the journal with them, see `MerkleTree`.

        Raises:
            StoreError: They cannot be written, or the file was deleted or replaced; whether they
                are, `last` will say.
        """
        try:
            if self._file is not None:
                self._file.check()
            connection = self._writer()
            with connection.begin():
                connection.execute(_APPEND, [new_event._asdict() for new_event in new])
                connection.execute(_HEAD, {"head": f"{new[-1].seq} {root.hex()}"})
        except SQLAlchemyError as error:
            if self._connection is not None and self._connection.invalidated:
                self._release()
            raise self._failed("cannot be written", error) from None
        except FileNotFoundError as error:
            raise StoreError(str(error)) from None

    def check_head(self, seq: int, root: bytes) -> None:
        """Check that the journal is what was written last.

        Args:
            seq: Number of the last event.
            root: Root hash.

        Raises:
            StoreError: Its last events are missing, or some were altered.
        """
        try:
            with self._engine.connect() as connection:
                found = select(_meta.c.value).where(_meta.c.name == "head")
                head = str(connection.execute(found).scalar())
        except SQLAlchemyError as error:
            raise self._failed("cannot be read", error) from None
        if head != f"{seq} {root.hex()}":
            number = head.partition(" ")[0]
            missing = number.isdecimal() and int(number) > seq
            raise self.damaged(
                seq + missing, "it is missing" if missing else "it or one before it was altered"
            )

    def digests(self, until: int, known: Sequence[str] = ()) -> list[str]:
        """Return the SHA-256 of each block of events up to a number, all of their columns, in a
        file of SQLite.

        Args:
            until: Number of the last event.
            known: Those of the first blocks.

        Raises:
            StoreError: The store cannot be read.
        """
        rows = select(events).where(events.c.seq.between(bindparam("a"), bindparam("b")))
        ordered = rows.order_by(events.c.seq).subquery()
        texts = (func.aggregate_strings(func.coalesce(cast(c, Text), "-"), " ") for c in ordered.c)
        kinds = (end(func.typeof(c)) for c in ordered.c for end in (func.min, func.max))
        query = select(*texts, *kinds)

        def digest(first: int) -> str:
            ends = {"a": first, "b": min(first + BLOCK - 1, until)}
            with self._engine.connect() as connection:
                found = connection.execute(query, ends).one()
            return sha256("\n".join(map(str, found)).encode()).hexdigest()

        try:
            more = range(1 + BLOCK * len(known), until + 1, BLOCK)
            return [*known, *(digest(first) for first in more)]
        except SQLAlchemyError as error:
            raise self._failed("cannot be read", error) from None

    def history(self, seq: int = 0, time: int = 0) -> Iterator[Event]:
        """Yield events in order.

        Args:
            seq: Number of the event after which they begin.
            time: Its time.

        Raises:
            StoreError: The store cannot be read, or its events are not as a manager writes them.
        """
        query = select(events).where(events.c.seq > seq).order_by(events.c.seq)
        for block in self.blocks(query):
            try:
                rows = _events.validate_python([tuple(row) for row in block], strict=True)
            except ValidationError as error:
                wrong = error.errors()[0]
                at, field = wrong["loc"][:2]
                raise self.damaged(
                    seq + 1 + int(at), f"{Event._fields[int(field)]} is {wrong['input']!r}"
                ) from None
            for row in rows:
                if row.seq != seq + 1 or row.time < time:
                    raise self.damaged(
                        seq + 1,
                        "it is missing" if row.seq != seq + 1 else "it is before the last one",
                    )
                seq, time = row.seq, row.time
                yield row

    def damaged(self, seq: int, why: str) -> StoreError:
        """Return the error of an event that no manager has written like that."""
        return StoreError(f"{self._shown} is damaged at event {seq:,}: {short(why)}")

    def last(self) -> int:
        """Return the number of the last event; 0 if there is none.

        Raises:
            StoreError: The store cannot be read.
        """
        return int(self.rows(select(func.coalesce(func.max(events.c.seq), 0)))[0][0])

    def rows(self, query: Select[Any]) -> list[Any]:
        """Return the rows of a query on `events`. Any thread may read.

        Raises:
            StoreError: The store cannot be read.
        """
        return [row for block in self.blocks(query) for row in block]

    def blocks(self, query: Select[Any]) -> Iterator[Sequence[Any]]:
        """Yield the rows of a query on `events` in blocks, see `rows`."""
        try:
            with self._engine.connect() as connection:
                yield from connection.execution_options(yield_per=BLOCK).execute(query).partitions()
        except SQLAlchemyError as error:
            raise self._failed("cannot be read", error) from None

    def close(self) -> None:
        """Release the store. A file then has all events, and no write-ahead log beside it."""
        self._release()
        self._engine.dispose()
        if self._file is not None:
            self._file.close()  # last: it would end the locks of SQLite
            self._file = None

    def _writer(self) -> Connection:
        """Return the connection of the manager, on which it keeps other managers out.

        Raises:
            StoreError: Another manager has the store.
        """
        if self._connection is None:
            self._connection = self._engine.connect()
            if self.path is None:
                self._lock(self._connection)
        return self._connection

    def _lock(self, connection: Connection) -> None:
        until = time.monotonic() + _WAIT_S
        while not connection.execute(
            text("select pg_try_advisory_lock(:key)"), {"key": _LOCK}
        ).scalar():
            if time.monotonic() > until:
                self._release()
                raise self._in_use()
            time.sleep(0.1)
        connection.commit()

    def _release(self) -> None:
        if self._connection is not None:
            with suppress(SQLAlchemyError):
                self._connection.invalidate()  # its end releases the lock
                self._connection.close()
            self._connection = None

    def _in_use(self) -> StoreError:
        return StoreError(f"{self._shown} is in use by a manager; a backup of it can be checked")

    def _failed(self, what: str, error: SQLAlchemyError) -> StoreError:
        reason = str(getattr(error, "orig", None) or error).strip().partition("\n")[0]
        return StoreError(f"{self._shown} {what}: {reason}")


def _durable(connection: Any, record: object) -> None:
    """Let each transaction of SQLite be on the disk at its end."""
    connection.execute("pragma synchronous = full")
