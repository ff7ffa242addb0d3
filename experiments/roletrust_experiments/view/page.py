"""The page in one browser: curves that grow, and the parts that are told to all."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bokeh.document import Document
from bokeh.models import ColumnDataSource, FactorRange, InlineStyleSheet, Range1d
from bokeh.models.widgets.markups import Div
from bokeh.plotting import figure
from jinja2 import Environment, PackageLoader

from roletrust_env.live.journal import Published
from roletrust_experiments.plots.style import ATTACKER, ATTACKERS, HONEST
from roletrust_experiments.view.board import Board, Told

_TEMPLATE = Path(__file__).parent / "template"
_COLOURS = (*HONEST[:3], *ATTACKERS[1:])
_DASHES = ("solid", (7, 3), (2, 2), (9, 3, 2, 3))
_KEPT = 600  # rounds that the curves show
_MATCHES = 60  # rounds of which is shown who was there
_NAMED = 8  # lines up to which there is a legend


def make_page(board: Board, document: Document) -> None:
    """Put the page into a document, and keep it up to date."""
    page = Page(board)
    for root in page.roots:
        document.add_root(root)
    environment = Environment(loader=PackageLoader("roletrust_experiments.view", "template"), autoescape=True)
    document.template = environment.get_template("page.html")
    document.title = "RoleTrust, live"
    document.add_periodic_callback(page.refresh, round(1000 * board.refreshed_s))


class Page:
    """What one browser shows.

    Args:
        board: what there is to see.

    Attributes:
        roots: the parts, by the names that the template has for them.
    """

    def __init__(self, board: Board) -> None:
        self._board, self._shown = board, 0
        self._tor, self._top = _Curves("tor", board), _Curves("top", board)
        self._matches = _Matches()
        sheet = InlineStyleSheet(css=(_TEMPLATE / "parts.css").read_text(encoding="utf-8"))
        self._told = {
            name: Div(name=name, stylesheets=[sheet], sizing_mode="stretch_width", margin=0, disable_math=True)
            for name in Told._fields  # a name from the network may look like TeX
        }
        self.roots: list[Any] = [self._tor.figure, self._top.figure, self._matches.figure, *self._told.values()]
        self.refresh()

    def refresh(self) -> None:
        """Show what came since the last time."""
        for name, text in self._board.told()._asdict().items():
            if self._told[name].text != text:
                self._told[name].text = text
        rounds = self._board.rounds(self._shown)
        if rounds:
            self._shown = rounds[-1].stamp
            self._tor.add(rounds)
            self._top.add(rounds)
            self._matches.add(rounds)


class _Curves:
    """The trust of raters, or of providers, against seconds."""

    def __init__(self, kind: str, board: Board) -> None:
        self._kind, self._board = kind, board
        self._names: list[str] = []
        self.source = ColumnDataSource({"time_s": []}, name=f"{kind}-source")
        self.figure = _figure(kind, 240, y_range=Range1d(start=-0.03, end=1.05), x_axis_label="time (s)")
        self.figure.yaxis.ticker = [0, 0.25, 0.5, 0.75, 1]

    def add(self, rounds: Sequence[Published]) -> None:
        """Go on with these rounds; a line begins for whoever is new."""
        trust = [getattr(one, self._kind) for one in rounds]
        for name in trust[-1]:
            if name not in self._names:
                self._begin(name)
        nan = float("nan")
        columns = {str(k): [values.get(name, nan) for values in trust] for k, name in enumerate(self._names)}
        self.source.stream({"time_s": [self._board.seconds(one) for one in rounds], **columns}, rollover=_KEPT)

    def _begin(self, name: str) -> None:
        """A line, in a column of its number: names from the network may be anything."""
        place = len(self._names)
        self._names.append(name)
        self.source.add([float("nan")] * len(self.source.data["time_s"]), str(place))
        bad = name in self._board.attackers
        colour = ATTACKER if bad else _COLOURS[place % len(_COLOURS)]
        look: dict[str, Any] = {"color": colour, "line_width": 3.4 if bad else 2, "line_dash": _DASHES[place % 4]}
        if bad:
            look["line_dash"] = "solid"
        label = {"legend_label": f"{name} (attacker)" if bad else name} if place < _NAMED else {}
        self.figure.line("time_s", str(place), source=self.source, name=name, **look, **label)
        legend: Any = self.figure.legend
        legend.location, legend.orientation = "bottom_left", "horizontal"
        legend.background_fill_alpha, legend.border_line_color = 0.0, None
        legend.visible = place < _NAMED


class _Matches:
    """Which raters were in the last rounds."""

    def __init__(self) -> None:
        self.source = ColumnDataSource({"round": [], "rater": [], "colour": []}, name="matches-source")
        self._raters = FactorRange()
        self.figure = _figure("matches", 150, y_range=self._raters, x_axis_label="round")
        self.figure.rect("round", "rater", 0.9, 0.8, color="colour", source=self.source)
        self.figure.ygrid.visible = False

    def add(self, rounds: Sequence[Published]) -> None:
        """Go on with these rounds."""
        raters = list(rounds[-1].tor)
        if self._raters.factors != raters[::-1]:
            self._raters.factors = raters[::-1]
            self.figure.height = max(150, 70 + 12 * len(raters))
        cells = [(one, name) for one in rounds[-_MATCHES:] for name in one.tor]
        new = {
            "round": [one.round for one, _ in cells],
            "rater": [name for _, name in cells],
            "colour": [ATTACKER if name in one.missing else HONEST[1] for one, name in cells],
        }
        self.source.stream(new, rollover=_MATCHES * len(raters))


def _figure(name: str, height: int, **options: Any) -> Any:
    """A quiet figure as wide as its place; `page.js` gives it the colours of light or dark."""
    found = figure(name=name, height=height, sizing_mode="stretch_width", toolbar_location=None, tools="", **options)
    found.xgrid.visible = False
    found.outline_line_color = found.background_fill_color = found.border_fill_color = None
    return found
