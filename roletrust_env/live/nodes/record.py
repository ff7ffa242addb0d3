"""Records all that a team says."""

import time
from pathlib import Path

from roletrust_env.live.nodes.running import SECOND, running
from roletrust_env.live.wire.dds import Node, Reader
from roletrust_env.live.wire.messages import typestore
from roletrust_env.live.wire.recording import Recorded, Recorder

_FLUSHED = SECOND // 2  # between two moments in which all is on the disk
_DEPTH = 1000


def run_record(folder: Path, *, images: bool = True, network: bool = False) -> int:
    """Record every topic that is published, until told to stop, and return the number of messages.

    Args:
        folder: a new one.
        images: whether pictures are recorded, too.
        network: see `Node`.

    Raises:
        ValueError: there is such a folder already.
    """
    node = Node("record", network=network)
    readers: dict[str, tuple[str, Reader]] = {}
    with running() as on, Recorder(folder) as recorder:
        flushed = time.time_ns()
        while on:
            node.wait(0.1)
            for topic, kind in node.discover():
                if topic not in readers and kind in typestore().types and (images or "image" not in topic):
                    readers[topic] = kind, node.reader(topic, kind, depth=_DEPTH)
            for topic, (kind, reader) in readers.items():
                for raw in reader.take():
                    recorder.write(Recorded(time.time_ns(), topic, kind, raw))
            if time.time_ns() - flushed > _FLUSHED:
                recorder.flush()
                flushed = time.time_ns()
    return recorder.count
