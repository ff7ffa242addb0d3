"""The listener of the live page: trust, active agents, refusals and pictures of a team."""

import threading
import time
from collections import deque
from contextlib import suppress

import cv2
import numpy as np

from roletrust_env.live.journal import PublishedTrust
from roletrust_env.live.nodes.topics import DIAGNOSTICS, IMAGES, RATINGS, TRUST, owner
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node, Reader

MANAGER = "manager"
"""Name of the manager in `TeamListener.last_heard`."""

_WAIT_S = 0.1
_WIDTH, _JPEG_QUALITY = 320, 80  # small pictures: a page shows several, to many viewers
_KINDS = {IMAGES: messages.IMAGE, RATINGS: messages.RATINGS}


class TeamListener:
    """Listens in a thread and keeps the newest messages. The team has one more reader, however many viewers there are.

    Args:
        rounds: Number of rounds to keep.
        network: See `Node`.

    Attributes:
        rounds: Last rounds, the newest last.
        pictures: Newest picture of each camera, scaled down, as JPEG.
        last_heard: Time of the last message of each camera, of each rater and of the manager, seconds since 1970.
        diagnostics: Last report of the manager, such as the number of refusals by rater and reason.
    """

    def __init__(self, *, rounds: int = 600, network: bool = False) -> None:
        self.rounds: deque[PublishedTrust] = deque(maxlen=rounds)
        self.pictures: dict[str, bytes] = {}
        self.last_heard: dict[str, float] = {}
        self.diagnostics: dict[str, str] = {}
        self._node, self._active = Node("view", network=network), True
        self._trust = self._node.reader(TRUST, messages.TRUST)
        self._diagnostics = self._node.reader(DIAGNOSTICS, messages.DIAGNOSTICS)
        self._members: dict[tuple[str, str], Reader] = {}
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop listening."""
        self._active = False
        self._thread.join()

    def _listen(self) -> None:
        while self._active:
            self._node.wait(_WAIT_S)
            self._subscribe_to_new_agents()
            for raw in self._trust.take():
                with suppress(ValueError):
                    self.rounds.append(messages.read_trust(raw))
                    self.last_heard[MANAGER] = time.time()
            for raw in self._diagnostics.take():
                with suppress(ValueError):
                    self._read_diagnostics(raw)
            for (name, ending), reader in self._members.items():
                for raw in reader.take()[-1:]:
                    self.last_heard[name] = time.time()
                    if ending == IMAGES:
                        with suppress(ValueError):
                            self._read_picture(name, raw)

    def _read_diagnostics(self, raw: bytes) -> None:
        for status in messages.decode(raw, messages.DIAGNOSTICS).status:
            if status.name == MANAGER:
                self.diagnostics = {pair.key: pair.value for pair in status.values}

    def _read_picture(self, name: str, raw: bytes) -> None:
        if picture := _scaled_down(messages.decode(raw, messages.IMAGE).data):
            self.pictures[name] = picture

    def _subscribe_to_new_agents(self) -> None:
        for topic, kind in self._node.discover():
            for ending in _KINDS:
                name = owner(topic, ending)
                if name is not None and kind == _KINDS[ending] and (name, ending) not in self._members:
                    self._members[name, ending] = self._node.reader(topic, kind, depth=1)


def _scaled_down(jpeg: np.ndarray) -> bytes | None:
    """Return a picture scaled so that its longer side has the width of the page's pictures; None if it is invalid."""
    try:
        picture = cv2.imdecode(np.asarray(jpeg, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:  # empty, or far too large
        return None
    if picture is None:
        return None
    height, width = picture.shape[:2]
    scale = _WIDTH / max(height, width)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return bytes(cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1])
