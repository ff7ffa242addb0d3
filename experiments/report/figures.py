"""The figures of the page. They come without data: `page.js` fills them with what the reader chose."""

from typing import Any

from bokeh.models import ColumnDataSource, FactorRange, HoverTool, LinearColorMapper, NumeralTickFormatter, Range1d
from bokeh.models.annotations import ColorBar, TeeHead, Whisker
from bokeh.palettes import Cividis256
from bokeh.plotting import figure

from experiments.report.content import Content

_TOOLS = "box_zoom,reset,save"


def figures(content: Content) -> dict[str, Any]:
    """The figures by the name of their table."""
    return {
        "heatmap": _heatmap(content),
        "curves": _curves(),
        "breakdown": _breakdown(),
        "tradeoff": _tradeoff(),
    }


def _heatmap(content: Content) -> Any:
    """A row for each model, a column for each attack, the darker the less is left."""
    table = content.tables["heatmap"]
    source = _source("cells", *table.header, "mark", "ink")
    left = [row[table.header.index("utility")] for row in table.rows]
    mapper = LinearColorMapper(palette=Cividis256, low=min(left, default=0.0), high=1.0)
    found = _figure(
        x_range=FactorRange(), y_range=FactorRange(), x_axis_location="above", height=150 + 26 * len(content.order)
    )
    fill: Any = {"field": "utility", "transform": mapper}
    cells = found.rect("attack", "model", 1, 1, source=source, fill_color=fill, line_color=fill)
    found.text("attack", "model", "mark", source=source, text_color="ink", text_align="center", text_baseline="middle")
    found.xaxis.major_label_orientation = 1.1
    found.grid.visible = False
    said = [
        ("under", "@attack, @rung"),
        ("utility", "@utility{0.000} ± @utility_half_95{0.000}"),
        ("blindly", "@blind"),
    ]
    _hover(found, cells, *said)
    found.add_layout(ColorBar(color_mapper=mapper, title="utility", width=12, background_fill_color=None), "right")
    return found


def _curves() -> Any:
    """A line for each model."""
    found = _figure(x_axis_label="round", y_axis_label="utility in the round", height=380)
    lines = _lines(found, "lines", "attack")
    _hover(found, lines, ("under", "@attack"), ("round", "$x{0}"), ("utility", "$y{0.000}"))
    return found


def _breakdown() -> Any:
    """A line for each model from share to share, with intervals."""
    found = _figure(x_axis_label="share of the compromised", y_axis_label="utility in the worst case", height=380)
    found.xaxis.formatter = NumeralTickFormatter(format="0%")
    _lines(found, "lines")
    points = _source(
        "points", "share", "utility", "utility_half_95", "low", "high", "model", "attack", "colour", "mark"
    )
    heads: Any = [TeeHead(size=7, line_color="colour") for _ in range(2)]
    ends: Any = {"base": "share", "lower": "low", "upper": "high", "lower_head": heads[0], "upper_head": heads[1]}
    found.add_layout(Whisker(source=points, line_color="colour", **ends))
    marks = _marks(found, "share", "utility", points)
    _hover(found, marks, ("share", "@share{0%}"), ("under", "@attack"), _with_half("utility"))
    return found


def _tradeoff() -> Any:
    """A mark for each attack on each model."""
    found = _figure(x_axis_label="detectability (AUC)", y_axis_label="damage to the honest", height=420)
    found.x_range = Range1d(start=-0.03, end=1.03)
    points = _source("points", "auc", "auc_half_95", "damage", "damage_half_95", "model", "attack", "colour", "mark")
    marks = _marks(found, "auc", "damage", points)
    _hover(found, marks, ("under", "@attack"), _with_half("damage"), _with_half("auc"))
    return found


def _figure(**options: Any) -> Any:
    found = figure(
        sizing_mode="stretch_width", tools=_TOOLS, active_drag=None, toolbar_location="below", min_width=280, **options
    )
    found.toolbar.logo = None
    found.outline_line_color = None
    return found


def _source(name: str, *columns: str) -> ColumnDataSource:
    return ColumnDataSource({column: [] for column in columns}, name=name)


def _lines(found: Any, name: str, *more: str) -> Any:
    source = _source(name, "xs", "ys", "model", "colour", "dash", *more)
    return found.multi_line("xs", "ys", source=source, line_color="colour", line_dash={"field": "dash"}, line_width=2.2)


def _marks(found: Any, x: str, y: str, source: ColumnDataSource) -> Any:
    return found.scatter(x, y, source=source, marker="mark", size=9, color="colour", fill_alpha=0.75)


def _hover(found: Any, renderer: Any, *said: tuple[str, str]) -> None:
    found.add_tools(HoverTool(renderers=[renderer], tooltips=[("", "@model"), *said]))


def _with_half(name: str) -> tuple[str, str]:
    return name, f"@{name}{{0.000}} ± @{name}_half_95{{0.000}}"
