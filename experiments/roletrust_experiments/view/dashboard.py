"""The content of the live page in text and pictures, made once for all viewers."""

import base64
import html
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

from roletrust_env.live.nodes.team_listener import TeamListener
from roletrust_env.live.team import PublishedTrust
from roletrust_env.live.validation import MANAGER, RefusalReason

_GONE_PERIODS = 1.6  # periods without a message after which a robot is shown as gone
_MIN_GONE_S = 0.3  # no robot is gone sooner, however short the period


class PageParts(NamedTuple):
    """The parts of the page that are text and pictures, as HTML. The template has a place of each name.

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
    """The current content of the page of a team.

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
        self, listener: TeamListener, period_s: float, speed: float = 1.0, attackers: Collection[str] = ()
    ) -> None:
        self._listener, self._period_s, self._speed, self.attackers = listener, period_s, speed, attackers
        self.refresh_s = min(0.25, max(0.1, period_s / 4))
        self._parts, self._parts_at, self._origin = PageParts("", "", "", ""), 0.0, 0

    def rounds(self, after: int) -> list[PublishedTrust]:
        """Return the rounds with a stamp after the given one, nanoseconds."""
        return [one for one in list(self._listener.rounds) if one.stamp > after]

    def seconds(self, one: PublishedTrust) -> float:
        """Return the time of a round since the first received one, in seconds of the scenario's clock."""
        self._origin = self._origin or self._listener.rounds[0].stamp
        return (one.stamp - self._origin) / 1e9 * self._speed

    def parts(self) -> PageParts:
        """Return the parts of the page. Viewers that ask at about the same time get the same parts."""
        now = time.time()
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
        return PageParts(
            _state(rounds[-1:], MANAGER in gone),
            _cameras(dict(listener.pictures), top, gone),
            _raters(tor, silent),
            _refused(dict(listener.reports), listener.refusals),
        )


def _state(last: Sequence[PublishedTrust], silent: bool) -> str:
    if not last:
        return _state_line("none", "No round yet.", "Waiting for a manager on this machine.")
    title = f"Round {last[0].round}"
    if silent:
        return _state_line("bad", title, "The manager has been silent since.")
    if last[0].missing:
        return _state_line("partial", title, f"missing: {', '.join(last[0].missing)}")
    return _state_line("good", title, "nobody is missing")


def _state_line(kind: str, title: str, words: str) -> str:
    return f'<p class="state {kind}"><i></i><b>{html.escape(title)}</b> {html.escape(words)}</p>'


def _cameras(pictures: Mapping[str, bytes], top: Mapping[str, float], gone: Collection[str]) -> str:
    cards = []
    for name, jpeg in sorted(pictures.items()):
        label, state = html.escape(name), " gone" if name in gone else ""
        picture = base64.b64encode(jpeg).decode()
        value = f"ToP {top[name]:.2f}" if name in top and not state else ""
        cards.append(
            f'<figure class="card{state}"><img alt="picture of {label}" src="data:image/jpeg;base64,{picture}">'
            f"<figcaption><b>{label}{':' if state else ''}{state}</b><span>{value}</span></figcaption></figure>"
        )
    return f'<div class="cards">{"".join(cards)}</div>' if cards else '<p class="quiet">No camera yet.</p>'


def _raters(tor: Mapping[str, float], silent: Collection[str]) -> str:
    rows = []
    for name, value in tor.items():
        state = ": gone" if name in silent else ""
        bar = f'<td class="bar" style="--part:{min(max(value, 0.0), 1.0):.4f}">{value:.2f}</td>'
        rows.append(
            f'<tr class="{"gone" if state else "here"}"><th scope="row">{html.escape(name)}{state}</th>{bar}</tr>'
        )
    return _table(("rater", "ToR"), rows) if rows else '<p class="quiet">No rater yet.</p>'


def _refused(reports: Mapping[str, Mapping[str, str]], own: Mapping[tuple[str, RefusalReason], int]) -> str:
    """Return a table of the messages that the manager, the raters and this page have refused."""
    counts = [
        (*key.split(": ", 1), count, node)
        for node, values in sorted(reports.items(), key=lambda entry: entry[0] != MANAGER)
        for key, count in values.items()
        if ": " in key
    ]
    counts += [(sender or "unknown", reason, str(count), "this page") for (sender, reason), count in own.items()]
    rows = [
        f'<tr><th scope="row">{html.escape(sender)}</th>'
        + "".join(f"<td>{html.escape(text)}</td>" for text in further)
        + "</tr>"
        for sender, *further in counts
    ]
    headings = "sender", "reason", "count", "refused by"
    return _table(headings, rows) if rows else '<p class="quiet">Nothing was refused.</p>'


def _table(headings: Iterable[str], rows: Iterable[str]) -> str:
    head = "".join(f'<th scope="col">{heading}</th>' for heading in headings)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
