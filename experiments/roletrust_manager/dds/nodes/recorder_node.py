"""The recorder: records all messages of a team."""

from collections.abc import Callable
from pathlib import Path

from roletrust_env.parameters import truth_value
from roletrust_manager.admission import clock
from roletrust_manager.dds.nodes.inboxes import TopicReaders
from roletrust_manager.dds.nodes.run_loop import SECOND, print_line, run_until_signal
from roletrust_manager.dds.wire.dds import Node
from roletrust_manager.dds.wire.messages import typestore
from roletrust_manager.dds.wire.recording import RecordedMessage, Recorder

_FLUSH_INTERVAL = SECOND // 2
_DEPTH = 1000


def run_recorder_node(
    folder: Path,
    *,
    images: bool = True,
    network: bool = False,
    report: Callable[[str], object] = print_line,
) -> int:
    """Record every published topic until a signal ends the process, and return the number of
    messages.

    Args:
        folder: New folder.
        images: Whether to record pictures as well.
        network: See `Node`.
        report: Function that shows a line to the user.

    Raises:
        ValueError: The folder exists already, or a setting is no truth value.
    """
    images = truth_value("images", images)
    node = Node("record", network=network)
    readers, kinds = TopicReaders(node, _DEPTH), dict[str, str]()
    with run_until_signal() as active, Recorder(folder) as recorder:
        report(f"record: records into {folder}, until Ctrl-C")
        flushed = clock.now()
        while active:
            node.wait(0.1)
            for topic, kind, _ in node.discover():
                if (
                    topic not in readers
                    and kind in typestore().types
                    and (images or "image" not in topic)
                ):
                    readers.add(topic, kind)
                    kinds[topic] = kind
            readers.drop_silent()
            for topic, reader in readers.items():
                for raw in reader.take():
                    recorder.write(RecordedMessage(clock.now(), topic, kinds[topic], raw))
            if clock.now() - flushed > _FLUSH_INTERVAL:
                recorder.flush()
                flushed = clock.now()
    return recorder.count
