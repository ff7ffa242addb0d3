"""The live page, for this machine only: growing curves in each browser, and the parts that all
viewers share.
"""

import os
import socket
from collections.abc import Collection, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.core.validation import silence
from bokeh.core.validation.warnings import MISSING_RENDERERS
from bokeh.document import Document
from bokeh.models import ColumnDataSource, FactorRange, InlineStyleSheet, Range1d
from bokeh.models.widgets.markups import Div
from bokeh.palettes import Colorblind8
from bokeh.plotting import figure
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop, PeriodicCallback

from roletrust_manager.admission.keys import PublicKeys
from roletrust_manager.admission.validation import MANAGER
from roletrust_manager.dds.nodes.run_loop import SECOND, run_until_signal
from roletrust_manager.dds.nodes.team_listener import TeamListener
from roletrust_manager.dds.rounds import RoundTiming
from roletrust_manager.page.dashboard import TEMPLATES, Dashboard, PageParts
from roletrust_manager.team import PublishedTrust, Team

_POLL_MS = 100  # time between two checks for a signal
_NICENESS = 10  # the server gives way to the robots
_TEMPLATE = Path(__file__).parent / "template"
_BLUE, _ORANGE, _, _GREEN, _SKY, _VERMILION, _PURPLE, _ = Colorblind8  # Okabe and Ito (2008)
_COLOURS = (_BLUE, _GREEN, _SKY, _PURPLE, _ORANGE)
_DASHES = ("solid", (7, 3), (2, 2), (9, 3, 2, 3))
_CURVE_ROUNDS = 600  # rounds in the curves
_MATCH_ROUNDS = 60  # rounds in the figure of arrived ratings
_MAX_LEGEND = 8  # more lines have no legend


def make_page(dashboard: Dashboard, document: Document) -> None:
    """Add the page to a document and refresh it periodically."""
    page = Page(dashboard)
    for root in page.roots:
        document.add_root(root)
    document.template = TEMPLATES.get_template("page.html")
    document.title = "RoleTrust, live"
    document.add_periodic_callback(page.refresh, round(1000 * dashboard.refresh_s))


class Page:
    """The page in one browser.

    Args:
        dashboard: Content of the page.

    Attributes:
        roots: Elements of the page, with the names of their places in the template.
    """

    def __init__(self, dashboard: Dashboard) -> None:
        self._dashboard, self._shown = dashboard, 0
        self._tor, self._top = _TrustPlot("tor", dashboard), _TrustPlot("top", dashboard)
        self._arrivals = _ArrivalPlot()
        sheet = InlineStyleSheet(css=(_TEMPLATE / "parts.css").read_text(encoding="utf-8"))
        self._parts = {
            name: Div(
                name=name,
                stylesheets=[sheet],
                sizing_mode="stretch_width",
                margin=0,
                disable_math=True,
            )
            for name in PageParts._fields  # a name from the network may look like TeX
        }
        self.roots: list[Any] = [
            self._tor.figure,
            self._top.figure,
            self._arrivals.figure,
            *self._parts.values(),
        ]
        self.refresh()

    def refresh(self) -> None:
        """Show the changes since the last call."""
        for name, text in self._dashboard.parts()._asdict().items():
            if self._parts[name].text != text:
                self._parts[name].text = text
        rounds = self._dashboard.rounds(self._shown)
        if rounds:
            self._shown = rounds[-1].stamp
            self._tor.add(rounds)
            self._top.add(rounds)
            self._arrivals.add(rounds)


class _TrustPlot:
    """Curves of the trust of raters, or of providers, over time."""

    def __init__(self, kind: str, dashboard: Dashboard) -> None:
        self._kind, self._dashboard = kind, dashboard
        self._names: list[str] = []
        self.source = ColumnDataSource({"time_s": []}, name=f"{kind}-source")
        self.figure = _figure(
            kind, 240, y_range=Range1d(start=-0.03, end=1.05), x_axis_label="time (s)"
        )
        self.figure.yaxis.ticker = [0, 0.25, 0.5, 0.75, 1]

    def add(self, rounds: Sequence[PublishedTrust]) -> None:
        """Append rounds; a new agent gets a new line."""
        trust = [getattr(published, self._kind) for published in rounds]
        for name in trust[-1]:
            if name not in self._names:
                self._add_line(name)
        nan = float("nan")
        columns = {
            str(k): [values.get(name, nan) for values in trust]
            for k, name in enumerate(self._names)
        }
        self.source.stream(
            {"time_s": [self._dashboard.seconds(published) for published in rounds], **columns},
            rollover=_CURVE_ROUNDS,
        )

    def _add_line(self, name: str) -> None:
        """Add a line. Its column is named by a number, since names from the network may be any
        text.
        """
        index = len(self._names)
        self._names.append(name)
        self.source.add([float("nan")] * len(self.source.data["time_s"]), str(index))
        bad = name in self._dashboard.attackers
        colour = _VERMILION if bad else _COLOURS[index % len(_COLOURS)]
        style: dict[str, Any] = {
            "color": colour,
            "line_width": 3.4 if bad else 2,
            "line_dash": _DASHES[index % 4],
        }
        if bad:
            style["line_dash"] = "solid"
        label = (
            {"legend_label": f"{name} (attacker)" if bad else name} if index < _MAX_LEGEND else {}
        )
        self.figure.line("time_s", str(index), source=self.source, name=name, **style, **label)
        legend: Any = self.figure.legend
        legend.location, legend.orientation = "bottom_left", "horizontal"
        legend.background_fill_alpha, legend.border_line_color = 0.0, None
        legend.visible = index < _MAX_LEGEND


class _ArrivalPlot:
    """Figure of the raters whose ratings arrived in the last rounds."""

    def __init__(self) -> None:
        self.source = ColumnDataSource(
            {"round": [], "rater": [], "colour": []}, name="matches-source"
        )
        self._raters = FactorRange()
        self.figure = _figure("matches", 150, y_range=self._raters, x_axis_label="round")
        self.figure.rect("round", "rater", 0.9, 0.8, color="colour", source=self.source)
        self.figure.ygrid.visible = False

    def add(self, rounds: Sequence[PublishedTrust]) -> None:
        """Append rounds."""
        raters = list(rounds[-1].tor)
        if self._raters.factors != raters[::-1]:
            self._raters.factors = raters[::-1]
            self.figure.height = max(150, 70 + 12 * len(raters))
        cells = [
            (published, name) for published in rounds[-_MATCH_ROUNDS:] for name in published.tor
        ]
        new = {
            "round": [published.round for published, _ in cells],
            "rater": [name for _, name in cells],
            "colour": [
                _VERMILION if name in published.missing else _GREEN for published, name in cells
            ],
        }
        self.source.stream(new, rollover=_MATCH_ROUNDS * len(raters))


def _figure(name: str, height: int, **options: Any) -> Any:
    """Return a plain figure of full width; `page.js` sets the colours for light or dark mode."""
    plain = figure(
        name=name,
        height=height,
        sizing_mode="stretch_width",
        toolbar_location=None,
        tools="",
        **options,
    )
    plain.xgrid.visible = False
    plain.outline_line_color = plain.background_fill_color = plain.border_fill_color = None
    return plain


def serve(dashboard: Dashboard, listening: socket.socket) -> BaseServer:
    """Return a started server of the page on a listening socket. The caller runs its loop."""
    silence(MISSING_RENDERERS)  # there are no curves before the first round
    host, port = listening.getsockname()
    pages = {"/": Application(FunctionHandler(partial(make_page, dashboard)))}
    tornado = BokehTornado(pages, extra_websocket_origins=[f"localhost:{port}", f"{host}:{port}"])
    http = HTTPServer(tornado)
    listening.setblocking(False)
    http.add_socket(listening)
    server = BaseServer(IOLoop.current(), tornado, http)
    server.start()
    return server


def run_view_server(
    listening: socket.socket,
    period_s: float,
    *,
    team: Team,
    keys: Path | None = None,
    speed: float = 1.0,
    attackers: Collection[str] = (),
    network: bool = False,
) -> None:
    """Serve the page of a team until a signal ends the process. The process has a lower priority
    than the robots.

    Args:
        listening: Listening socket, see `open_page`.
        period_s: Time between rounds, seconds.
        team: Agents of the scenario.
        keys: Folder with the public keys of the team and the manager; None shows unsigned messages.
        speed: Speed relative to the scenario's clock.
        attackers: Names to mark as attackers.
        network: See `Node`.

    Raises:
        ValueError: A key does not exist.
    """
    os.nice(_NICENESS)
    keyring = None if keys is None else PublicKeys(keys, [MANAGER])
    listener = TeamListener(
        team, RoundTiming(round(period_s * SECOND)), keyring=keyring, network=network
    )
    dashboard = Dashboard(listener, period_s, speed, attackers)
    try:
        server = serve(dashboard, listening)
        with run_until_signal() as active:
            PeriodicCallback(lambda: None if active else server.io_loop.stop(), _POLL_MS).start()
            server.io_loop.start()
        server.stop()
    finally:
        dashboard.close()
