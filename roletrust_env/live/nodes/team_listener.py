"""The listener of the live page: trust, active agents, refusals and pictures of a team."""

import threading
import time
from collections import Counter, deque
from collections.abc import Mapping

import cv2
import numpy as np

from roletrust_env.live.journal import PublishedTrust
from roletrust_env.live.manager import keys_by_role
from roletrust_env.live.message_validation import (
    MANAGER,
    Envelope,
    Keyring,
    MessageValidator,
    RefusalReason,
    StampLimits,
)
from roletrust_env.live.nodes.agent_readers import AgentReaders
from roletrust_env.live.nodes.diagnostics import LIMITS, MAX_PER_SECOND
from roletrust_env.live.nodes.picture_inbox import PictureInbox
from roletrust_env.live.nodes.signatures import read_diagnostics
from roletrust_env.live.nodes.subscriptions import TrustInbox
from roletrust_env.live.nodes.topics import DIAGNOSTICS, RATINGS
from roletrust_env.live.rounds import RoundTiming
from roletrust_env.live.trust_tracker import Team
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node, Quota

_WAIT_S = 0.1
_FORGET_S = 60.0  # strangers are forgotten that long after their last message
_WIDTH, _JPEG_QUALITY = 320, 80  # small pictures: a page shows several, to many viewers


class TeamListener:
    """Listens in a thread and keeps the newest messages. The team has one more reader, however many viewers there are.

    With keys, nothing counts that is not signed by the name it claims. Refused messages are counted.

    Args:
        team: Agents of the scenario.
        timing: Timing of the rounds, which limits the stamps.
        keyring: Keys of the team, with the manager's; None accepts every message.
        rounds: Number of rounds to keep.
        network: See `Node`.

    Attributes:
        rounds: Last rounds, the newest last.
        pictures: Newest picture of each camera, scaled down, as JPEG.
        last_heard: Time of the last message of each camera, of each rater and of the manager, seconds since 1970.
        reports: Last diagnostics of each node, such as the number of refusals by sender and reason.
    """

    def __init__(
        self,
        team: Team,
        timing: RoundTiming,
        *,
        keyring: Keyring | None = None,
        rounds: int = 600,
        network: bool = False,
    ) -> None:
        self.rounds: deque[PublishedTrust] = deque(maxlen=rounds)
        self.pictures: dict[str, bytes] = {}
        self.last_heard: dict[str, float] = {}
        self.reports: dict[str, dict[str, str]] = {}
        self._known = {MANAGER, *team.raters, *team.providers}
        rating, serving = keys_by_role(keyring, team)
        self._node, self._active = Node("view", network=network), True
        self._trust = TrustInbox(self._node, keyring)
        self._diagnostics = self._node.reader(DIAGNOSTICS, messages.DIAGNOSTICS, depth=100, quota=Quota(MAX_PER_SECOND))
        self._cameras = PictureInbox(self._node, timing, serving, team.providers if serving is None else serving)
        known = team.raters if rating is None else rating
        self._raters = AgentReaders(self._node, RATINGS, messages.RATINGS, known, strangers=rating is None)
        limits = StampLimits(timing.tolerance, timing.max_spread)
        self._reports, self._ratings = MessageValidator(LIMITS, keyring), MessageValidator(limits, rating)
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    @property
    def refusals(self) -> Mapping[tuple[str, RefusalReason], int]:
        """Number of messages that this listener refused, by sender and reason."""
        validators = self._trust.validator, self._reports, self._ratings, self._cameras.validator
        return sum((one.refusals for one in validators), Counter[tuple[str, RefusalReason]]())

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
            for trust in self._trust.take():
                self.rounds.append(trust)
                self.last_heard[MANAGER] = time.time()
            for raw in self._diagnostics.take():
                self._read_diagnostics(raw)
            newest = {one.camera: one.jpeg for one in self._cameras.take(time.time_ns())}
            for camera, jpeg in newest.items():
                self.last_heard[camera] = time.time()
                if small := _scaled_down(np.frombuffer(jpeg, np.uint8)):
                    self.pictures[camera] = small
            for rater, reader in self._raters:
                for raw in reader.take():
                    self._read_ratings(rater, raw)
            self._forget_strangers()

    def _forget_strangers(self) -> None:
        """Forget agents that are not known and have gone, so that fresh names do not fill the memory."""
        for name, moment in list(self.last_heard.items()):
            if time.time() - moment > _FORGET_S and name not in self._known:
                self.last_heard.pop(name)
                self.pictures.pop(name, None)
                self.reports.pop(name, None)

    def _read_diagnostics(self, raw: bytes) -> None:
        try:
            report = read_diagnostics(raw)
        except ValueError:
            self._reports.refuse("", RefusalReason.GARBAGE)
            return
        if report is None or not (report.node == MANAGER or report.node in self.last_heard):
            return  # of another program
        if self._reports.accepts(report.envelope, time.time_ns()):
            self.reports[report.node] = report.values

    def _read_ratings(self, rater: str, raw: bytes) -> None:
        try:
            one = messages.read_ratings(raw)
        except ValueError:
            self._ratings.refuse(rater, RefusalReason.GARBAGE)
            return
        if one.rater != rater:
            self._ratings.refuse(rater, RefusalReason.ELSEWHERE)
        elif self._ratings.accepts(Envelope(one.rater, one.stamp, one.signed, one.signature), time.time_ns()):
            self.last_heard[rater] = time.time()


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
