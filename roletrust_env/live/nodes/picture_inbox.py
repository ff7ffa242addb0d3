"""Incoming pictures of all cameras, without those that are invalid or not signed by their camera."""

from collections.abc import Container, Iterable, Iterator

from roletrust_env.live.message_validation import Keyring, MessageValidator, RefusalReason, StampLimits
from roletrust_env.live.nodes.agent_readers import AgentReaders
from roletrust_env.live.nodes.run_loop import SECOND
from roletrust_env.live.nodes.signatures import Picture, read_picture
from roletrust_env.live.nodes.topics import IMAGES
from roletrust_env.live.rounds import RoundTiming
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node, Publication, Quota, Reader

_MAX_PER_PERIOD = 10  # messages that a camera may send in a period; it needs one
_DEPTH = 10


class PictureInbox:
    """Receives the pictures of cameras.

    With keys, a picture counts only if its camera has signed it, which is checked before it is decoded. Without keys,
    cameras that are not known are limited in number.

    Args:
        node: Node that subscribes.
        timing: Timing of the rounds, which limits the stamps as it does for ratings.
        keyring: Cameras that may send; None accepts every camera, without a signature.
        known: Cameras that are always received.

    Attributes:
        known: Cameras that are always received.
        validator: Refuses invalid messages and counts them.
    """

    def __init__(self, node: Node, timing: RoundTiming, keyring: Keyring | None, known: Container[str]) -> None:
        self.known, self._node, self._quota = (
            known,
            node,
            max(_MAX_PER_PERIOD, _MAX_PER_PERIOD * SECOND // timing.period),
        )
        self.validator = MessageValidator(StampLimits(timing.tolerance, timing.max_spread), keyring)
        self._cameras = AgentReaders(node, IMAGES, messages.IMAGE, known, strangers=keyring is None, make=self._make)

    def _make(self, topic: str, kind: str) -> Reader:
        return self._node.reader(topic, kind, depth=_DEPTH, quota=Quota(self._quota))

    def update(self, publications: Iterable[Publication]) -> None:
        """Subscribe to new cameras, and forget those that have gone."""
        self._cameras.update(publications)

    def take(self, now: int) -> Iterator[Picture]:
        """Iterate over the valid pictures since the last call; known cameras come first.

        Args:
            now: Time, nanoseconds.
        """
        for camera, reader in self._cameras:
            for raw in reader.take():
                try:
                    picture = read_picture(raw, camera)
                except ValueError:
                    self.validator.refuse(camera, RefusalReason.GARBAGE)
                    continue
                if self.validator.accepts(picture.envelope, now):
                    yield picture
            if reader.over_quota:
                self.validator.refuse(camera, RefusalReason.FLOOD, reader.over_quota)
                reader.over_quota = 0
