"""Hears what a team says, for whoever looks on: trust, who was missing, what was refused, and pictures."""

import threading
import time
from collections import deque
from typing import NamedTuple

from roletrust_env.live.nodes.topics import DIAGNOSTICS, IMAGES, TRUST, owner
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node, Reader

_WAIT_S = 0.1


class Heard(NamedTuple):
    """The trust after a round, by name, and who was missing.

    Attributes:
        round: its number.
        time_s: of its services, seconds since 1970.
        tor: of the raters.
        top: of the providers.
        missing: raters that were waited for, in vain.
    """

    round: int
    time_s: float
    tor: dict[str, float]
    top: dict[str, float]
    missing: tuple[str, ...]


class Picture(NamedTuple):
    """The newest picture of a camera, and when it came, seconds since 1970."""

    jpeg: bytes
    time_s: float


class Watcher:
    """Listens in a thread of its own, and keeps the newest of what it heard.

    However many look on, the team notices one reader.

    Args:
        rounds: how many are kept.
        network: see `Node`.

    Attributes:
        heard: the last rounds, the newest last.
        pictures: the newest of each camera.
        reports: what the manager reported last, such as how often it refused what of whom.
    """

    def __init__(self, *, rounds: int = 600, network: bool = False) -> None:
        self.heard: deque[Heard] = deque(maxlen=rounds)
        self.pictures: dict[str, Picture] = {}
        self.reports: dict[str, str] = {}
        self._node, self._on = Node("view", network=network), True
        self._trust = self._node.reader(TRUST, messages.TRUST)
        self._diagnostics = self._node.reader(DIAGNOSTICS, messages.DIAGNOSTICS)
        self._cameras: dict[str, Reader] = {}
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Listen no longer."""
        self._on = False
        self._thread.join()

    def _listen(self) -> None:
        while self._on:
            self._node.wait(_WAIT_S)
            for topic, kind in self._node.discover():
                camera = owner(topic, IMAGES)
                if camera is not None and kind == messages.IMAGE and camera not in self._cameras:
                    self._cameras[camera] = self._node.reader(topic, kind, depth=1)
            for raw in self._trust.take():
                self._take(raw)
            for raw in self._diagnostics.take():
                for status in messages.decode(raw, messages.DIAGNOSTICS).status:
                    if status.name == "manager":
                        self.reports = {pair.key: pair.value for pair in status.values}
            for camera, reader in self._cameras.items():
                for raw in reader.take()[-1:]:
                    self.pictures[camera] = Picture(bytes(messages.decode(raw, messages.IMAGE).data), time.time())

    def _take(self, raw: bytes) -> None:
        said = messages.decode(raw, messages.TRUST)
        tor = dict(zip(said.raters, said.tor.tolist(), strict=True))
        top = dict(zip(said.providers, said.top.tolist(), strict=True))
        self.heard.append(Heard(said.round, messages.stamp_of(said) / 1e9, tor, top, tuple(said.missing)))
