"""A page that shows a team while it runs: trust, who is missing, what was refused, and pictures. Needs Bokeh."""

import base64
import html
import time
from collections.abc import Mapping, Sequence
from typing import Any

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.document import Document
from bokeh.layouts import column, row
from bokeh.models import ColumnDataSource, FactorRange, Range1d
from bokeh.models.widgets.markups import Div
from bokeh.plotting import figure
from bokeh.server.server import Server

from experiments.plots.style import ATTACKER, HONEST, INK, QUIET
from roletrust_env.live.nodes.watch import Heard, Picture, Watcher

_COLOURS = (*HONEST, ATTACKER, "#CC79A7", "#E69F00", "#8C510A")
_REFRESHED_MS = 250
_MATCHES = 60  # rounds of which is shown who was there
_WIDTH = 760
_GONE = 2.5  # periods after which a camera that shows nothing is gone


def serve(watcher: Watcher, period_s: float, port: int) -> Server:
    """A server of the page, for this machine only; its loop is still to be run.

    Args:
        watcher: that hears the team.
        period_s: between rounds, seconds.
        port: of the page.

    Raises:
        ValueError: the port is taken.
    """

    def make(document: Document) -> None:
        page = _Page(watcher, period_s)
        document.title = "RoleTrust, live"
        document.add_root(page.layout)
        document.add_periodic_callback(page.refresh, _REFRESHED_MS)

    origins = [f"localhost:{port}", f"127.0.0.1:{port}"]
    application = Application(FunctionHandler(make))
    try:
        server = Server({"/": application}, port=port, address="127.0.0.1", allow_websocket_origin=origins)
    except OSError as error:
        raise ValueError(f"port {port} cannot be had: {error}; give another with --port") from None
    server.start()
    return server


class _Page:
    """One page, in one browser."""

    def __init__(self, watcher: Watcher, period_s: float) -> None:
        self._watcher, self._period_s, self._shown = watcher, period_s, -1
        self._tor, self._top = _Curves("trust of raters, ToR"), _Curves("trust of providers, ToP")
        self._matches = ColumnDataSource({"round": [], "rater": [], "colour": []})
        self._raters = FactorRange()
        self._grid = figure(
            width=_WIDTH, height=150, y_range=self._raters, toolbar_location=None, title="ratings in a round"
        )
        self._grid.rect("round", "rater", 0.9, 0.8, color="colour", source=self._matches)
        _tidy(self._grid)
        self._state, self._pictures, self._refused = Div(name="state"), Div(name="pictures"), Div(name="refused")
        left = column(self._state, self._tor.figure, self._top.figure, self._grid)
        self.layout = row(left, column(self._pictures, self._refused), name="page")
        self.refresh()

    def refresh(self) -> None:
        """Show what came since the last time."""
        heard, now = list(self._watcher.heard), time.time()
        self._pictures.text = _pictures(dict(self._watcher.pictures), now, _GONE * self._period_s)
        self._refused.text = _refused(self._watcher.reports)
        self._state.text = _state(heard, now, self._period_s)
        if heard and heard[-1].round != self._shown:
            self._shown = heard[-1].round
            self._tor.show(heard, [one.tor for one in heard])
            self._top.show(heard, [one.top for one in heard])
            self._match(heard[-_MATCHES:])

    def _match(self, heard: Sequence[Heard]) -> None:
        raters = list(heard[-1].tor)
        self._raters.factors = raters[::-1]
        cells = [(one.round, name, ATTACKER if name in one.missing else HONEST[1]) for one in heard for name in raters]
        rounds, names, colours = zip(*cells, strict=True)
        self._matches.data = {"round": list(rounds), "rater": list(names), "colour": list(colours)}


class _Curves:
    """The trust of some, against rounds."""

    def __init__(self, title: str) -> None:
        self.figure = figure(
            width=_WIDTH, height=230, y_range=Range1d(start=-0.03, end=1.05), toolbar_location=None, title=title
        )
        _tidy(self.figure)
        self._sources: dict[str, ColumnDataSource] = {}

    def show(self, heard: Sequence[Heard], trust: Sequence[Mapping[str, float]]) -> None:
        """Show the trust of all names after these rounds."""
        for name in trust[-1]:
            if name not in self._sources:
                self._sources[name] = source = ColumnDataSource({"round": [], "trust": []}, name=name)
                colour = _COLOURS[(len(self._sources) - 1) % len(_COLOURS)]
                self.figure.line("round", "trust", source=source, color=colour, line_width=2, legend_label=name)
                self.figure.legend.location = "bottom_left"
                self.figure.legend.orientation = "horizontal"
            rounds = [one.round for one in heard]
            self._sources[name].data = {"round": rounds, "trust": [by_name.get(name) for by_name in trust]}


def _tidy(axes: Any) -> None:
    axes.title.text_color = INK
    axes.axis.major_label_text_color = axes.axis.axis_line_color = QUIET
    axes.xgrid.visible = False
    axes.outline_line_color = None


def _state(heard: Sequence[Heard], now: float, period_s: float) -> str:
    if not heard:
        return "<b>No round yet.</b> Waiting for a manager on this machine."
    last = heard[-1]
    missing = f"missing: {', '.join(map(html.escape, last.missing))}" if last.missing else "nobody is missing"
    silent = now - last.time_s > 3 * period_s
    return f"<b>Round {last.round}</b>, {missing}" + (
        ", and none since: <b>the manager is silent</b>" if silent else ""
    )


def _pictures(pictures: Mapping[str, Picture], now: float, gone_s: float) -> str:
    shown = []
    for camera, picture in sorted(pictures.items()):
        gone = now - picture.time_s > gone_s
        encoded = base64.b64encode(picture.jpeg).decode()
        label = f"{html.escape(camera)}{': gone' if gone else ''}"
        style = f"width:240px;opacity:{0.35 if gone else 1}"
        shown.append(f'<figure style="margin:4px"><img alt="{label}" style="{style}" src="data:image/jpeg;base64,')
        shown[-1] += f'{encoded}"><figcaption style="color:{INK}">{label}</figcaption></figure>'
    return "".join(shown)


def _refused(reports: Mapping[str, str]) -> str:
    counts = {key: value for key, value in reports.items() if ": " in key}
    rows = "".join(
        f"<tr><td>{html.escape(key)}</td><td>{html.escape(value)}</td></tr>" for key, value in counts.items()
    )
    return f"<b>Refused or unused</b><table>{rows}</table>" if rows else "<b>Nothing was refused.</b>"
