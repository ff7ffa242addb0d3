"""Hears what a team says, for whoever looks on: trust, who speaks, what was refused, and pictures."""

import threading
import time
from collections import deque
from contextlib import suppress

import cv2
import numpy as np

from roletrust_env.live.journal import Published
from roletrust_env.live.nodes.topics import DIAGNOSTICS, IMAGES, RATINGS, TRUST, owner
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node, Reader

MANAGER = "manager"
"""What the manager is called among those who speak."""

_WAIT_S = 0.1
_WIDTH, _JPEG_QUALITY = 320, 80  # of the pictures that are kept: a page has several, and many look at it
_KINDS = {IMAGES: messages.IMAGE, RATINGS: messages.RATINGS}


class Watcher:
    """Listens in a thread of its own, and keeps the newest of what it heard.

    However many look on, the team notices one reader.

    Args:
        rounds: how many are kept.
        network: see `Node`.

    Attributes:
        heard: the last rounds, the newest last.
        pictures: the newest of each camera, small, as JPEG.
        spoke: when each camera, rater and the manager was heard last, seconds since 1970.
        reports: what the manager reported last, such as how often it refused what of whom.
    """

    def __init__(self, *, rounds: int = 600, network: bool = False) -> None:
        self.heard: deque[Published] = deque(maxlen=rounds)
        self.pictures: dict[str, bytes] = {}
        self.spoke: dict[str, float] = {}
        self.reports: dict[str, str] = {}
        self._node, self._on = Node("view", network=network), True
        self._trust = self._node.reader(TRUST, messages.TRUST)
        self._diagnostics = self._node.reader(DIAGNOSTICS, messages.DIAGNOSTICS)
        self._members: dict[tuple[str, str], Reader] = {}
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Listen no longer."""
        self._on = False
        self._thread.join()

    def _listen(self) -> None:
        while self._on:
            self._node.wait(_WAIT_S)
            self._meet()
            for raw in self._trust.take():
                with suppress(ValueError):
                    self.heard.append(messages.read_trust(raw))
                    self.spoke[MANAGER] = time.time()
            for raw in self._diagnostics.take():
                with suppress(ValueError):
                    self._report(raw)
            for (name, ending), reader in self._members.items():
                for raw in reader.take()[-1:]:
                    self.spoke[name] = time.time()
                    if ending == IMAGES:
                        with suppress(ValueError):
                            self._look(name, raw)

    def _report(self, raw: bytes) -> None:
        for status in messages.decode(raw, messages.DIAGNOSTICS).status:
            if status.name == MANAGER:
                self.reports = {pair.key: pair.value for pair in status.values}

    def _look(self, name: str, raw: bytes) -> None:
        if picture := _small(messages.decode(raw, messages.IMAGE).data):
            self.pictures[name] = picture

    def _meet(self) -> None:
        """Listen to newcomers, too."""
        for topic, kind in self._node.discover():
            for ending in _KINDS:
                name = owner(topic, ending)
                if name is not None and kind == _KINDS[ending] and (name, ending) not in self._members:
                    self._members[name, ending] = self._node.reader(topic, kind, depth=1)


def _small(jpeg: np.ndarray) -> bytes | None:
    """A picture of the width that is kept, or of that height if it is higher; None of what is no picture."""
    try:
        picture = cv2.imdecode(np.asarray(jpeg, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:  # it is empty, or far too large
        return None
    if picture is None:
        return None
    height, width = picture.shape[:2]
    part = _WIDTH / max(height, width)
    size = max(1, round(width * part)), max(1, round(height * part))
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return bytes(cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1])
