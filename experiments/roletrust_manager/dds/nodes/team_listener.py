"""The listener of the live page: trust, active agents, refusals and pictures of a team."""

import threading
import time
from collections import Counter, deque
from collections.abc import Mapping

import cv2
import numpy as np

from roletrust_manager.admission import clock
from roletrust_manager.admission.validation import (
    MANAGER,
    Admission,
    Keyring,
    RefusalReason,
    keys_by_role,
)
from roletrust_manager.dds.nodes.inboxes import (
    camera_inbox,
    diagnostics_inbox,
    rating_inbox,
    trust_inbox,
    trust_limits,
)
from roletrust_manager.dds.rounds import RoundTiming
from roletrust_manager.dds.wire.dds import Node
from roletrust_manager.team import PublishedTrust, Team

_WAIT_S = 0.1
_ROUNDS = 600  # that are remembered
_FORGET_S = 60.0  # strangers are forgotten that long after their last message
_WIDTH, _JPEG_QUALITY = 320, 80  # small pictures: a page shows several, to many viewers


class TeamListener:
    """Listens in a thread and keeps the newest messages. The team has one more reader, however many
    viewers there are.

    With keys, nothing counts that is not signed by the name it claims. Refused messages are
    counted.

    Args:
        team: Agents of the scenario.
        timing: Timing of the rounds, which limits the stamps.
        keyring: Keys of the team, with the manager's; None accepts every message.
        network: See `Node`.

    Attributes:
        rounds: Last rounds, the newest last.
        pictures: Newest picture of each camera, scaled down, as JPEG.
        last_heard: Time of the last message of each camera, of each rater and of the manager,
            monotonic seconds.
        reports: Last diagnostics of each node, such as the number of refusals by sender and reason.
    """

    def __init__(
        self,
        team: Team,
        timing: RoundTiming,
        *,
        keyring: Keyring | None = None,
        network: bool = False,
    ) -> None:
        self.rounds: deque[PublishedTrust] = deque(maxlen=_ROUNDS)
        self.pictures: dict[str, bytes] = {}
        self.last_heard: dict[str, float] = {}
        self.reports: dict[str, dict[str, str]] = {}
        self._known = {MANAGER, *team.raters, *team.providers}
        rating, _ = keys_by_role(keyring, team)
        self._node, self._active = Node("view", network=network), True
        self._trust = trust_inbox(self._node, keyring, trust_limits(timing))
        self._diagnostics = diagnostics_inbox(self._node, keyring, self._is_of_team)
        self._cameras = camera_inbox(self._node, timing, keyring, team)
        known = team.raters if rating is None else rating
        admission = Admission(timing.limits, rating, members=team.raters)
        self._raters = rating_inbox(self._node, timing, admission, known, strangers=rating is None)
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    @property
    def refusals(self) -> Mapping[tuple[str, RefusalReason], int]:
        """Number of messages that this listener refused, by sender and reason."""
        inboxes = self._trust, self._diagnostics, self._cameras, self._raters
        return sum(
            (inbox.admission.refusals for inbox in inboxes), Counter[tuple[str, RefusalReason]]()
        )

    def close(self) -> None:
        """Stop listening."""
        self._active = False
        self._thread.join()

    def _listen(self) -> None:
        while self._active:
            self._node.wait(_WAIT_S)
            publications = self._node.discover()
            self._cameras.update(publications)
            self._raters.update(publications)
            for message in self._trust.take(clock.now()):
                self.rounds.append(message.trust)
                self.last_heard[MANAGER] = time.monotonic()
            for report in self._diagnostics.take(clock.now()):
                self.reports[report.envelope.sender] = report.values
            newest = {
                picture.envelope.sender: picture.jpeg for picture in self._cameras.take(clock.now())
            }
            for camera, jpeg in newest.items():
                self.last_heard[camera] = time.monotonic()
                if small := _scaled_down(np.frombuffer(jpeg, np.uint8)):
                    self.pictures[camera] = small
            for ratings in self._raters.take(clock.now()):
                self.last_heard[ratings.envelope.sender] = time.monotonic()
            self._forget_strangers()

    def _is_of_team(self, node: str) -> bool:
        """Return whether diagnostics are of the manager or of an active agent, and not of another
        program.
        """
        return node == MANAGER or node in self.last_heard

    def _forget_strangers(self) -> None:
        """Forget agents that are not known and have gone, so that fresh names do not fill the
        memory.
        """
        for name, moment in list(self.last_heard.items()):
            if time.monotonic() - moment > _FORGET_S and name not in self._known:
                self.last_heard.pop(name)
                self.pictures.pop(name, None)
                self.reports.pop(name, None)


def _scaled_down(jpeg: np.ndarray) -> bytes | None:
    """Return a picture scaled so that its longer side has the width of the page's pictures; None if
    it is invalid.
    """
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
