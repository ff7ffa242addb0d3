"""What there is to see of a team, in words and pictures, made once for all who look on."""

import base64
import html
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

from roletrust_env.live.journal import Published
from roletrust_env.live.nodes.watch import MANAGER, Watcher

_GONE = 1.6  # periods without a word after which a robot is shown as gone
_GONE_S = 0.3  # no robot is gone sooner, however fast the rounds are


class Told(NamedTuple):
    """The parts of the page that are text and pictures, as HTML, by their place in the template."""

    state: str
    cameras: str
    raters: str
    refused: str


class Board:
    """What is to be seen now of a team.

    Args:
        watcher: that hears the team.
        period_s: between rounds, seconds.
        speed: seconds of the scenario's clock in a second.
        attackers: names to be marked.
    """

    def __init__(self, watcher: Watcher, period_s: float, speed: float = 1.0, attackers: Collection[str] = ()) -> None:
        self._watcher, self._period_s, self._speed, self.attackers = watcher, period_s, speed, attackers
        self.refreshed_s = min(0.25, max(0.1, period_s / 4))
        self._told, self._told_at, self._origin = Told("", "", "", ""), 0.0, 0

    def rounds(self, after: int) -> list[Published]:
        """The rounds with later stamps than this one, nanoseconds."""
        return [one for one in list(self._watcher.heard) if one.stamp > after]

    def seconds(self, one: Published) -> float:
        """When a round was, by the scenario's clock, from the first on that was heard."""
        self._origin = self._origin or self._watcher.heard[0].stamp
        return (one.stamp - self._origin) / 1e9 * self._speed

    def told(self) -> Told:
        """The parts that are text and pictures; all who ask at about the same time are told the same."""
        now = time.time()
        if now - self._told_at > self.refreshed_s / 2:
            self._told, self._told_at = self._tell(now), now
        return self._told

    def _tell(self, now: float) -> Told:
        watcher = self._watcher
        heard, spoke = list(watcher.heard), dict(watcher.spoke)
        gone_s = max(_GONE * self._period_s, _GONE_S)
        gone = {name for name, moment in spoke.items() if now - moment > gone_s}
        tor, top = (heard[-1].tor, heard[-1].top) if heard else ({}, {})
        silent = {name for name in tor if name not in spoke} | gone
        return Told(
            _state(heard[-1:], MANAGER in gone),
            _cameras(dict(watcher.pictures), top, gone),
            _raters(tor, silent),
            _refused(watcher.reports),
        )


def _state(last: Sequence[Published], silent: bool) -> str:
    if not last:
        return _state_line("none", "No round yet.", "Waiting for a manager on this machine.")
    title = f"Round {last[0].round}"
    if silent:
        return _state_line("bad", title, "and none since: the manager is silent")
    if last[0].missing:
        return _state_line("some", title, f"missing: {', '.join(last[0].missing)}")
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
            f'<figure class="card{state}"><img alt="what {label} sees" src="data:image/jpeg;base64,{picture}">'
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


def _refused(reports: Mapping[str, str]) -> str:
    rows = []
    for key, count in reports.items():
        who, colon, why = key.partition(": ")
        if colon:
            cells = "".join(f"<td>{html.escape(text)}</td>" for text in (why, count))
            rows.append(f'<tr><th scope="row">{html.escape(who)}</th>{cells}</tr>')
    return _table(("rater", "why", "how often"), rows) if rows else '<p class="quiet">Nothing was refused.</p>'


def _table(headings: Iterable[str], rows: Iterable[str]) -> str:
    head = "".join(f'<th scope="col">{heading}</th>' for heading in headings)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
