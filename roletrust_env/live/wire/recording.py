"""Recordings of what was said, as MCAP in rosbag2's folders: every message with its time of arrival, as it came."""

import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple, Self

from rosbags.rosbag2 import Reader, ReaderError, StoragePlugin, Writer

from roletrust_env.live.wire.messages import typestore

_MAGIC = b"\x89MCAP0\r\n"
_DAMAGED = struct.error, KeyError, UnicodeDecodeError  # what a record that is not as it was leads to
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 0x03, 0x04, 0x05, 0x06  # records, https://mcap.dev/spec


class Recorded(NamedTuple):
    """A message that was recorded.

    Attributes:
        time: of its arrival, nanoseconds.
        topic: in ROS 2, such as `/trust`.
        kind: its type.
        raw: CDR.
    """

    time: int
    topic: str
    kind: str
    raw: bytes


class Recorder:
    """Writes a recording, of which no more than the time between two calls of `flush` is lost if it is killed.

    Args:
        folder: a new one.

    Raises:
        ValueError: there is such a folder or file already.
        OSError: it cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        if folder.exists():
            raise ValueError(f"{folder} is there already; a recording needs a new folder")
        self._writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        self._connections: dict[str, Any] = {}
        self.count = 0

    def write(self, message: Recorded) -> None:
        """Write a message."""
        if message.topic not in self._connections:
            connection = self._writer.add_connection(message.topic, message.kind, typestore=typestore())
            self._connections[message.topic] = connection
        self._writer.write(self._connections[message.topic], message.time, message.raw)
        self.count += 1

    def flush(self) -> None:
        """Put what was written so far on the disk."""
        storage: Any = self._writer.storage
        if storage.chunk.msgs:
            storage.close_chunk()
        storage.bio.flush()

    def close(self) -> None:
        """Write the index, without which ordinary readers do not read a recording."""
        self._writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self.close()


def read_recording(folder: Path) -> Iterator[Recorded]:
    """The messages of a recording, in order of arrival.

    Raises:
        ValueError: it is none, or was not closed: `recover` makes one that is.
    """
    if not folder.is_dir():
        raise ValueError(
            f"{folder} cannot be read: it is no folder; `roletrust live recover` makes one of an MCAP file"
        )
    with _readable(folder):
        reader = Reader(folder)
        reader.open()
    messages = iter(reader.messages())
    try:
        while True:
            with _readable(folder):
                connection, time, raw = next(messages, (None, 0, b""))
                if connection is None:
                    return
                one = Recorded(time, connection.topic, connection.msgtype, bytes(raw))
            yield one
    finally:
        reader.close()


@contextmanager
def _readable(folder: Path) -> Iterator[None]:
    """Whatever rosbags stumbles over in a damaged file is told in one line."""
    try:
        yield
    except (
        ReaderError,
        OSError,
        ValueError,
        OverflowError,
        MemoryError,
        struct.error,
        LookupError,
        TypeError,
    ) as error:
        why = " ".join(str(error).split()) or "out of memory"
        raise ValueError(f"{folder} cannot be read: {why}; `roletrust live recover` may help") from None


def recover(damaged: Path, folder: Path) -> int:
    """Write anew what can be read of a recording whose process was killed.

    Args:
        damaged: its folder, or the MCAP file.
        folder: a new one.

    Returns:
        How many messages it has.

    Raises:
        ValueError: there is no such recording, or the folder is there already.
    """
    path = damaged
    if damaged.is_dir():
        path = next(iter(sorted(damaged.glob("*.mcap"))), damaged)
    if not path.is_file() or not path.read_bytes()[: len(_MAGIC)] == _MAGIC:
        raise ValueError(f"{damaged} is no recording; allowed are an MCAP file, and a folder with one")
    salvaged = [one for one in _salvaged(path.read_bytes()[len(_MAGIC) :]) if one.kind in typestore().types]
    if not salvaged:
        raise ValueError(f"{damaged} holds no message that can be read; one of another program may be compressed")
    with Recorder(folder) as recorder:
        for message in salvaged:
            recorder.write(message)
        return recorder.count


def _salvaged(data: bytes) -> Iterator[Recorded]:
    """The messages of an MCAP file without its magic, as far as it is whole."""
    kinds: dict[int, str] = {}
    channels: dict[int, tuple[str, str]] = {}
    for code, content in _records(data):
        with suppress(*_DAMAGED):
            if code != _CHUNK:
                yield from _message(code, content, kinds, channels)
            elif not _text(content, 28):  # our own are not compressed
                yield from _messages(content[28 + 4 + 8 :], kinds, channels)


def _messages(data: bytes, kinds: dict[int, str], channels: dict[int, tuple[str, str]]) -> Iterator[Recorded]:
    for code, content in _records(data):
        with suppress(*_DAMAGED):
            yield from _message(code, content, kinds, channels)


def _message(
    code: int, content: bytes, kinds: dict[int, str], channels: dict[int, tuple[str, str]]
) -> Iterator[Recorded]:
    """A record: a type or a topic, which is kept, or a message."""
    if code == _SCHEMA:
        kinds[struct.unpack_from("<H", content)[0]] = _text(content, 2)
    elif code == _CHANNEL:
        number, schema = struct.unpack_from("<HH", content)
        channels[number] = _text(content, 4), kinds[schema]
    elif code == _MESSAGE:
        number, _, time = struct.unpack_from("<HIQ", content)
        yield Recorded(time, *channels[number], content[22:])


def _records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """The records of some bytes, the code of each and what is in it; one that is cut off is none."""
    at = 0
    while at + 9 <= len(data):
        code, length = struct.unpack_from("<BQ", data, at)
        if at + 9 + length > len(data):
            return
        yield code, data[at + 9 : at + 9 + length]
        at += 9 + length


def _text(content: bytes, at: int) -> str:
    (length,) = struct.unpack_from("<I", content, at)
    return content[at + 4 : at + 4 + length].decode()
