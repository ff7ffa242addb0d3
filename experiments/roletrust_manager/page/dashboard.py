"""The content of the live page in text and pictures, made once for all viewers."""

import base64
import time
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from jinja2 import Environment, PackageLoader

from roletrust_manager.admission.validation import MANAGER, RefusalReason
from roletrust_manager.team import PublishedTrust

if TYPE_CHECKING:  # which needs packages of its own
    from roletrust_manager.dds.nodes.team_listener import TeamListener

TEMPLATES = Environment(loader=PackageLoader("roletrust_manager.page", "template"), autoescape=True)
_PARTS: Any = TEMPLATES.get_template("parts.html").module

_GONE_PERIODS = 1.6  # periods without a message after which a robot is shown as gone
_MIN_GONE_S = 0.3  # no robot is gone sooner, however short the period


class PageParts(NamedTuple):
    """The parts of the page that are text and pictures, as HTML. The template has a place of each
    name.

    Attributes:
        state: State of the last round.
        cameras: Pictures of the cameras.
        raters: Table of the raters.
        refused: Table of the refused and unused messages.
    """

    state: str
    cameras: str
    raters: str
    refused: str


class Dashboard:
    """The current content of the page.

    Args:
        listener: Listener to the team.
        period_s: Time between rounds, seconds.
        speed: Speed relative to the scenario's clock.
        attackers: Names to mark as attackers.

    Attributes:
        attackers: Names to mark as attackers.
        refresh_s: Time between two refreshes of the page, seconds.
    """

    def __init__(
        self,
        listener: "TeamListener",
        period_s: float,
        speed: float = 1.0,
        attackers: Collection[str] = (),
    ) -> None:
        self._listener, self._period_s, self._speed, self.attackers = (
            listener,
            period_s,
            speed,
            attackers,
        )
        self.refresh_s = min(0.25, max(0.1, period_s / 4))
        self._parts, self._parts_at, self._origin = PageParts("", "", "", ""), 0.0, 0

    def close(self) -> None:
        """Stop listening."""
        self._listener.close()

    def rounds(self, after: int) -> list[PublishedTrust]:
        """Return the rounds with a stamp after the given one, nanoseconds."""
        return [published for published in list(self._listener.rounds) if published.stamp > after]

    def seconds(self, published: PublishedTrust) -> float:
        """Return the time of a round since the first received one, in seconds of the scenario's
        clock.
        """
        self._origin = self._origin or self._listener.rounds[0].stamp
        return (published.stamp - self._origin) / 1e9 * self._speed

    def parts(self) -> PageParts:
        """Return the parts of the page. Viewers that ask at about the same time get the same
        parts.
        """
        now = time.monotonic()
        if now - self._parts_at > self.refresh_s / 2:
            self._parts, self._parts_at = self._make_parts(now), now
        return self._parts

    def _make_parts(self, now: float) -> PageParts:
        listener = self._listener
        rounds, last_heard = list(listener.rounds), dict(listener.last_heard)
        gone_s = max(_GONE_PERIODS * self._period_s, _MIN_GONE_S)
        gone = {name for name, moment in last_heard.items() if now - moment > gone_s}
        tor, top = (rounds[-1].tor, rounds[-1].top) if rounds else ({}, {})
        silent = {name for name in tor if name not in last_heard} | gone
        pictures = {
            name: base64.b64encode(jpeg).decode() for name, jpeg in listener.pictures.copy().items()
        }
        return PageParts(
            _PARTS.state(*_state(rounds[-1:], MANAGER in gone)),
            _PARTS.cameras(pictures, top, gone),
            _PARTS.raters(tor, silent),
            _PARTS.refused(_refused(listener.reports.copy(), listener.refusals)),
        )


def _state(last: Sequence[PublishedTrust], silent: bool) -> tuple[str, str, str]:
    """Return the state of the last round: a class of the style sheet, a title and words."""
    if not last:
        return "none", "No round yet.", "Waiting for the first round."
    title = f"Round {last[0].round}"
    if silent:
        return "bad", title, "The manager has been silent since."
    if last[0].missing:
        return "partial", title, f"missing: {', '.join(last[0].missing)}"
    return "good", title, "nobody is missing"


def _refused(
    reports: Mapping[str, Mapping[str, str]], own: Mapping[tuple[str, RefusalReason], int]
) -> list[tuple[str, ...]]:
    """Return sender, reason and count of what the manager, the raters and this page have refused,
    and by whom.
    """
    counts = [
        (*key.split(": ", 1), count, node)
        for node, values in sorted(reports.items(), key=lambda entry: entry[0] != MANAGER)
        for key, count in values.items()
        if ": " in key
    ]
    return counts + [
        (sender or "unknown", reason, str(count), "this page")
        for (sender, reason), count in own.items()
    ]
