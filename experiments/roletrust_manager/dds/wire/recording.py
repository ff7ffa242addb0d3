"""Recordings of all messages with their times of arrival, as MCAP files in the folders of
rosbag2.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple, Self

from rosbags.rosbag2 import Reader, StoragePlugin, Writer

from roletrust_env.errors import short
from roletrust_manager.dds.wire.messages import typestore


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
        ValueError: The folder is not a recording, or it was not closed. `mcap recover` and `ros2
            bag reindex` repair the latter.
    """
    if not folder.is_dir():
        raise ValueError(f"{folder} cannot be read: a recording must be a folder")
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
            f"{folder} cannot be read: {why}; `mcap recover` repairs one that was not closed"
        ) from None
