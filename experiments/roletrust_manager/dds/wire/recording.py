"""Recordings of all messages with their times of arrival, as MCAP files in the folders of
rosbag2.
"""

import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple, Self

from rosbags.rosbag2 import Reader, StoragePlugin, Writer

from roletrust_env.errors import short
from roletrust_manager.dds.wire.messages import typestore

_MAGIC = b"\x89MCAP0\r\n"
_DAMAGED = struct.error, KeyError, UnicodeDecodeError  # errors of a damaged record
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 0x03, 0x04, 0x05, 0x06  # records, https://mcap.dev/spec


class RecordedMessage(NamedTuple):
    """A message of a recording.

    Attributes:
        time: Time of arrival, nanoseconds.
        topic: Name of the topic in ROS 2, such as `/trust`.
        kind: Type of the message.
        raw: Message, as CDR.
    """

    time: int
    topic: str
    kind: str
    raw: bytes


class Recorder:
    """Writes a recording. If the process is killed, only the messages since the last `flush` are
    lost.

    Args:
        folder: New folder.

    Attributes:
        count: Number of messages so far.

    Raises:
        ValueError: The folder exists already.
        OSError: The folder cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        if folder.exists():
            raise ValueError(f"{folder} exists already; a recording needs a new folder")
        self._writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        self._connections: dict[str, Any] = {}
        self.count = 0

    def write(self, message: RecordedMessage) -> None:
        """Write a message."""
        if message.topic not in self._connections:
            connection = self._writer.add_connection(
                message.topic, message.kind, typestore=typestore()
            )
            self._connections[message.topic] = connection
        self._writer.write(self._connections[message.topic], message.time, message.raw)
        self.count += 1

    def flush(self) -> None:
        """Write all messages so far to the disk."""
        storage: Any = self._writer.storage
        if storage.chunk.msgs:
            storage.close_chunk()
        storage.bio.flush()

    def close(self) -> None:
        """Write the index, which ordinary readers need."""
        self._writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self.close()


def read_recording(
    folder: Path, advance: Callable[[int, int], object] = lambda done, total: None
) -> Iterator[RecordedMessage]:
    """Iterate over the messages of a recording, in order of arrival.

    Args:
        folder: Folder of the recording.
        advance: Function that is called with the number of messages so far, and with that of all.

    Raises:
        ValueError: The folder is not a recording, or it was not closed. `recover_recording` repairs
            the latter.
    """
    if not folder.is_dir():
        raise ValueError(
            f"{folder} cannot be read: it is no folder; `roletrust live record --recover` makes "
            "one of an MCAP file"
        )
    with _one_line_errors(folder):
        reader = Reader(folder)
        reader.open()
    messages = iter(reader.messages())
    try:
        for done in count(1):
            with _one_line_errors(folder):
                connection, time, raw = next(messages, (None, 0, b""))
                if connection is None:
                    return
                message = RecordedMessage(time, connection.topic, connection.msgtype, bytes(raw))
            yield message
            advance(done, reader.message_count)
    finally:
        with _one_line_errors(folder):
            reader.close()


@contextmanager
def _one_line_errors(folder: Path) -> Iterator[None]:
    """Turn every error of rosbags on a damaged file into a message of one line."""
    try:
        yield
    except Exception as error:  # of many kinds
        why = short(" ".join(str(error).split())) or "out of memory"
        raise ValueError(
            f"{folder} cannot be read: {why}; `roletrust live record --recover` may help"
        ) from None


def recover_recording(damaged: Path, folder: Path) -> int:
    """Write the readable messages of a damaged recording, such as that of a killed process, to a
    new one.

    Args:
        damaged: Folder of the recording, or its MCAP file.
        folder: New folder.

    Returns:
        The number of messages.

    Raises:
        ValueError: The recording does not exist, has no readable message, or the new folder exists
            already.
    """
    path = damaged
    if damaged.is_dir():
        path = next(iter(sorted(damaged.glob("*.mcap"))), damaged)
    if not path.is_file() or not path.read_bytes()[: len(_MAGIC)] == _MAGIC:
        raise ValueError(f"{damaged} is no recording; give an MCAP file, or a folder with one")
    readable = [
        item
        for item in _readable_messages(path.read_bytes()[len(_MAGIC) :])
        if item.kind in typestore().types
    ]
    if not readable:
        raise ValueError(
            f"{damaged} has no readable message; recordings of other programs may be compressed"
        )
    with Recorder(folder) as recorder:
        for message in readable:
            recorder.write(message)
        return recorder.count


def _readable_messages(data: bytes) -> Iterator[RecordedMessage]:
    """Iterate over the readable messages of an MCAP file, given without its magic bytes."""
    kinds: dict[int, str] = {}
    topics: dict[int, tuple[str, str]] = {}
    for code, content in _records(data):
        with suppress(*_DAMAGED):
            if code == _SCHEMA:
                kinds[struct.unpack_from("<H", content)[0]] = _text(content, 2)
            elif code == _CHANNEL:
                number, schema = struct.unpack_from("<HH", content)
                topics[number] = _text(content, 4), kinds[schema]
            elif code == _MESSAGE:
                number, _, time = struct.unpack_from("<HIQ", content)
                yield RecordedMessage(time, *topics[number], content[22:])


def _records(data: bytes, *, chunked: bool = False) -> Iterator[tuple[int, bytes]]:
    """Iterate over the codes and contents of the complete records in some bytes, and of those in
    their chunks.

    The records of a chunk are never chunks themselves.
    """
    at = 0
    while at + 9 <= len(data):
        code, length = struct.unpack_from("<BQ", data, at)
        content = data[at + 9 : at + 9 + length]
        if len(content) < length:
            return
        if code != _CHUNK or chunked:
            yield code, content
        else:
            with suppress(*_DAMAGED):
                if not _text(content, 28):  # this project does not compress
                    yield from _records(content[28 + 4 + 8 :], chunked=True)
        at += 9 + length


def _text(content: bytes, at: int) -> str:
    (length,) = struct.unpack_from("<I", content, at)
    return content[at + 4 : at + 4 + length].decode()
