"""The figures of the page. They contain no data: `page.js` fills them with the selection of the reader."""

from typing import Any

from bokeh.models import (
    BasicTickFormatter,
    ColumnDataSource,
    FactorRange,
    HoverTool,
    LinearColorMapper,
    NumeralTickFormatter,
    Range1d,
)
from bokeh.models.annotations import ColorBar, Span, TeeHead, Whisker
from bokeh.palettes import Cividis256
from bokeh.plotting import figure

from roletrust_env.benchmarking.suite import Scale
from roletrust_experiments.report.content import Content
from roletrust_experiments.report.learners import Learners
from roletrust_experiments.report.robustness import HeatMap, Robustness

_TOOLS = "box_zoom,reset,save"


def figures(content: Content) -> dict[str, Any]:
    """Return the figures by the name of their table."""
    found: dict[str, Any] = {}
    if content.robustness:
        found |= {
            "heatmap": _heatmap(content.robustness),
            "worst_cases": _worst_cases(content.robustness),
            "curves": _curves(),
            "breakdown": _breakdown(content.robustness.suite.score),
            "tradeoff": _tradeoff(),
        }
    if content.learners:
        found["learners"] = _learners(content.learners)
    return found


def _heatmap(robustness: Robustness) -> Any:
    """Return a heat map of models and attacks; dark is a low score, and a frame marks a worst case."""
    heat = robustness.heat_maps["heatmap"]
    found = _figure(
        x_range=FactorRange(), y_range=FactorRange(), x_axis_location="above",
        height=190 + 24 * max(5, len(robustness.order)),
    )  # fmt: skip
    source = _source("cells", *robustness.tables["heatmap"].header, "column", "text", "ink", "frame")
    cells = _cells(found, source, "model", heat, robustness.suite.score)
    found.rect("column", "model", 0.86, 0.84, source=source, fill_color=None, line_color="frame", line_width=2)
    found.xaxis.major_label_orientation = 0.9
    _hover(found, cells, ("where", "@condition"), ("under", "@attack, @method"), _with_half(heat.column), _BLINDLY)
    return found


def _worst_cases(robustness: Robustness) -> Any:
    """Return a heat map of conditions for one model: scenarios and tracks by shares; dark is a low score."""
    table = robustness.tables["worst_cases"]
    columns = table.columns()
    many = len({*zip(columns["scenario"], columns["track"], strict=True)})
    found = _figure(x_range=FactorRange(), y_range=FactorRange(), x_axis_location="above", height=120 + 30 * many)
    source = _source("cells", *table.header, "column", "row", "text", "ink")
    cells = _cells(found, source, "row", robustness.heat_maps["worst_cases"], robustness.suite.score)
    found.xaxis.axis_label = "share of the compromised"
    _hover(
        found, cells, ("where", "@row, @column"), ("under", "@attack, @method"),
        _with_half("score", robustness.suite.score), _BLINDLY, ("games", "@games"),
    )  # fmt: skip
    return found


_BLINDLY = ("utility of a blind choice", "@blind{0.000}")


def _cells(found: Any, source: ColumnDataSource, row: str, heat: HeatMap, title: str) -> Any:
    """Draw the cells of a heat map, each with its number, and the bar of colours."""
    mapper = LinearColorMapper(palette=Cividis256, low=heat.lowest, high=1.0)
    fill: Any = {"field": heat.column, "transform": mapper}
    cells = found.rect("column", row, 1, 1, source=source, fill_color=fill, line_color=fill)
    found.text(
        "column", row, "text", source=source, text_color="ink", text_align="center", text_baseline="middle",
        text_font_size="11px",
    )  # fmt: skip
    found.grid.visible = False
    found.add_layout(ColorBar(color_mapper=mapper, title=title, width=12, background_fill_color=None), "right")
    return cells


def _curves() -> Any:
    """Return lines for each model, or for each attack on it."""
    found = _figure(x_axis_label="round", y_axis_label="utility in the round", height=400, **_ranges())
    lines = _lines(
        found, "lines", "model", "attack", "condition", "wide", "strength", line_width="wide", line_alpha="strength"
    )
    # A vertex of the line; $x and $y would be the place of the mouse.
    vertex = ("round", "$snap_x{0.[0]}"), ("utility", "$snap_y{0.000}")
    _hover(found, lines, ("where", "@condition"), ("under", "@attack"), *vertex)
    return found


def _breakdown(scale: Scale) -> Any:
    """Return a line for each model by share, with intervals."""
    found = _figure(
        x_axis_label="share of the compromised", y_axis_label=f"{scale} in the worst case", height=400, **_ranges()
    )
    found.xaxis.formatter = NumeralTickFormatter(format="0%")
    _lines(found, "lines", "model", line_width=2.2)
    points = _source("points", "share", "score", "score_half_95", "low", "high", "model", "attack", *_LOOK)
    marks = _marks_with_ends(found, "share", "score", points)
    _hover(found, marks, ("share", "@share{0%}"), ("under", "@attack"), _with_half("score", scale))
    return found


def _tradeoff() -> Any:
    """Return a mark for each attack on each model; the worst case has a large one."""
    found = _figure(x_axis_label="detectability (AUC)", y_axis_label="damage to the honest", height=440, **_ranges())
    found.x_range.update(start=-0.03, end=1.03)
    found.yaxis.formatter = BasicTickFormatter(use_scientific=False)
    more = ("auc_half_95", "damage_half_95", "attack", "size")
    points = _source("points", "auc", "damage", "model", *more, *_LOOK)
    marks = found.scatter(
        "auc", "damage", source=points, marker="mark", size="size", color="colour", fill_alpha=0.75, line_alpha=1
    )
    found.add_layout(_level(0.5, "height"))
    _hover(found, marks, ("under", "@attack"), _with_half("damage"), _with_half("auc"))
    return found


def _learners(learners: Learners) -> Any:
    """Return a line for each learner by budget, with intervals."""
    budgets = learners.suite.budgets
    found = _figure(
        x_axis_label="rounds of play", y_axis_label="share of the optimum", height=400, x_axis_type="log", **_ranges()
    )
    found.x_range.update(start=0.8 * min(budgets), end=1.25 * max(budgets))
    found.xaxis.ticker = list(budgets)
    found.xaxis.formatter = NumeralTickFormatter(format="0,0")
    for level in (0, 1):
        found.add_layout(_level(level, "width"))
    _lines(found, "lines", "learner", line_width=2.2)
    points = _source("points", "budget", "share", "low", "high", "runs", "score", "task", "learner", *_LOOK)
    marks = _marks_with_ends(found, "budget", "share", points)
    _hover(
        found, marks, ("on", "@task"), ("rounds", "@budget{0,0}"), ("runs", "@runs"),
        ("share", "@share{0.000}, from @low{0.000} to @high{0.000}"), who="@learner",
    )  # fmt: skip
    return found


_LOOK = ("colour", "mark")


def _figure(**options: Any) -> Any:
    found = figure(
        sizing_mode="stretch_width", tools=_TOOLS, active_drag=None, toolbar_location="below", min_width=280, **options
    )
    found.toolbar.logo = None
    # Never white, not even at first, of which a dark page would keep a thin line.
    found.update(outline_line_color=None, background_fill_color=None, border_fill_color=None)
    return found


def _ranges() -> dict[str, Any]:
    """Return ranges that `page.js` sets, since Bokeh's own do not see the ends of intervals."""
    return {"x_range": Range1d(), "y_range": Range1d()}


def _level(value: float, along: Any) -> Span:
    """Return a reference line: chance, honest play or the optimum."""
    return Span(location=value, dimension=along, line_color="#8b949e", line_dash="dashed", line_width=1)


def _source(name: str, *columns: str) -> ColumnDataSource:
    return ColumnDataSource({column: [] for column in columns}, name=name)


def _lines(found: Any, name: str, *more: str, **how: Any) -> Any:
    source = _source(name, "xs", "ys", "colour", "dash", *more)
    return found.multi_line("xs", "ys", source=source, line_color="colour", line_dash={"field": "dash"}, **how)


def _marks_with_ends(found: Any, x: str, y: str, source: ColumnDataSource) -> Any:
    """Draw marks with their intervals."""
    heads: Any = [TeeHead(size=7, line_color="colour") for _ in range(2)]
    ends: Any = {"base": x, "lower": "low", "upper": "high", "lower_head": heads[0], "upper_head": heads[1]}
    found.add_layout(Whisker(source=source, line_color="colour", **ends))
    return found.scatter(x, y, source=source, marker="mark", size=9, color="colour", fill_alpha=0.75)


def _hover(found: Any, renderer: Any, *rows: tuple[str, str], who: str = "@model") -> None:
    found.add_tools(HoverTool(renderers=[renderer], tooltips=[("", who), *rows]))


def _with_half(name: str, label: str = "") -> tuple[str, str]:
    return label or name, f"@{name}{{0.000}} ± @{name}_half_95{{0.000}}"
