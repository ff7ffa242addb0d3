"""Panels of means with 95% intervals, along an axis of numbers or in a row for each name."""

from collections.abc import Sequence
from textwrap import fill
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from roletrust_env.metrics.confidence import Interval
from roletrust_experiments.plots.style import ATTACKERS, DASHES, HONEST, INK, QUIET, quiet

_COLOURS = (
    HONEST[0],
    ATTACKERS[0],
    HONEST[1],
    ATTACKERS[1],
    ATTACKERS[2],
    HONEST[2],
    HONEST[3],
    QUIET,
)
_MARKS = ("o", "s", "^", "D", "v", "P", "X", "*")
_WIDE, _HIGH, _ROW = 4.7, 3.1, 0.175  # inches of a panel, and of a row of names
_APART = 0.34  # of a row, between series
_FAR = 0.6  # share of the highest value above which the lowest value needs no line at 0
_LONGEST = 96  # letters of a line of the title


class Series(NamedTuple):
    """Values with their intervals.

    Attributes:
        label: Label in the legend.
        at: Position of each value: numbers, or names of rows.
        values: Values, one for each position.
        known: True for a closed form, which is drawn as a thin grey line.
    """

    label: str
    at: Sequence[float] | Sequence[str]
    values: Sequence[Interval]
    known: bool = False


class Panel(NamedTuple):
    """A panel of a figure.

    Attributes:
        title: Title of the panel.
        along: Label of the positions; unused for names.
        what: Label of the values.
        series: Series to draw, all at numbers or all at the same names.
        scale: Scale of an axis of numbers; `symlog` is linear up to the first number above 0.
    """

    title: str
    along: str
    what: str
    series: Sequence[Series]
    scale: Literal["linear", "log", "symlog"] = "linear"


def panels_figure(title: str, panels: Sequence[Panel], note: str, columns: int = 2) -> Figure:
    """Return a figure with panels side by side.

    Args:
        title: Title, such as the question that the panels answer.
        panels: Panels, at least one.
        note: Note below the panels, above the legend if there is one.
        columns: Number of panels side by side, at most.
    """
    looks, columns = _looks(panels), min(len(panels), columns)
    down = -(-len(panels) // columns)
    high = max(_high(panel) for panel in panels)
    figure = Figure(
        figsize=(_WIDE * max(columns, 1.7 if panels[0].along else 2), down * high + 1.1),
        layout="constrained",
    )
    for k, (axes, panel) in enumerate(
        zip(figure.subplots(down, columns, squeeze=False).flat, panels, strict=False)
    ):
        if names := _names(panel):
            _rows(axes, panel, looks)
            axes.set_yticks(range(len(names)), names if k % columns == 0 else [], fontsize=9)
        else:
            _lines(axes, panel, looks)
        axes.set_title(panel.title, loc="left", fontsize=10.5, color=INK)
        quiet(axes, "x" if names else "y")
        axes.spines[["left", "bottom"]].set_color("#9CA3AF")
    for axes in figure.axes[len(panels) :]:
        axes.set_visible(False)
    figure.suptitle(
        fill(title, _LONGEST), x=0.012, ha="left", fontsize=12.5, fontweight="bold", color=INK
    )
    keys: dict[str, Any] = {}
    for axes in figure.axes:
        keys |= {
            label: handle for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
    if len(keys) > 1:
        place: Any = {"loc": "outside lower left", "ncols": 4, "alignment": "left"}
        look: Any = {"frameon": False, "fontsize": 9, "title_fontsize": 8.5, "labelcolor": INK}
        figure.legend(
            keys.values(), keys.keys(), title=note, **place, **look
        ).get_title().set_color(QUIET)
    else:
        figure.supxlabel(note, x=0.99, ha="right", fontsize=8.5, color=QUIET)
    return figure


def _high(panel: Panel) -> float:
    """Return the height of a panel in inches."""
    names = len(_names(panel))
    return 1.0 + names * _ROW * max(1, 0.4 + _APART * len(panel.series)) if names else _HIGH


def _looks(panels: Sequence[Panel]) -> dict[str, dict[str, Any]]:
    """Return a style for each label, the same in all panels; a closed form is a thin grey line."""
    labels = list(
        dict.fromkeys(
            series.label for panel in panels for series in panel.series if not series.known
        )
    )
    looks: dict[str, dict[str, Any]] = {
        label: {
            "color": _COLOURS[k % len(_COLOURS)],
            "marker": _MARKS[k % len(_MARKS)],
            "linestyle": DASHES[k % 4],
        }
        for k, label in enumerate(labels)
    }
    known = dict.fromkeys(
        series.label for panel in panels for series in panel.series if series.known
    )
    return looks | {
        label: {"color": QUIET, "linestyle": (0, (1, 1.5)), "linewidth": 1.3} for label in known
    }


def _lines(axes: Axes, panel: Panel, looks: dict[str, dict[str, Any]]) -> None:
    """Draw a line for each series."""
    for series in panel.series:
        value, low, high = np.array(series.values, float).reshape(-1, 3).T
        at = np.array(series.at, float)
        if series.known:
            axes.plot(at, value, label=series.label, zorder=1.5, **looks[series.label])
            continue
        axes.plot(
            at,
            value,
            label=series.label,
            linewidth=1.6,
            markersize=5,
            zorder=3,
            **looks[series.label],
        )
        axes.errorbar(
            at,
            value,
            yerr=_bars(value, low, high),
            fmt="none",
            ecolor=looks[series.label]["color"],
            capsize=2.5,
        )
    numbers = sorted({float(x) for series in panel.series if not series.known for x in series.at})
    if panel.scale == "symlog":
        axes.set_xscale("symlog", linthresh=min(x for x in numbers if x > 0), linscale=0.6)
    elif panel.scale == "log":
        axes.set_xscale("log")
    axes.set_xticks(numbers, [_short(x) for x in numbers])
    axes.set_xticks([], minor=True)
    if axes.get_ylim()[0] < _FAR * axes.get_ylim()[1]:
        axes.axhline(0, color=QUIET, linewidth=0.8, zorder=1)
    axes.set_xlabel(panel.along, color=INK)
    axes.set_ylabel(panel.what, color=INK)


def _rows(axes: Axes, panel: Panel, looks: dict[str, dict[str, Any]]) -> None:
    """Draw a row for each name, with a mark for each series."""
    names = _names(panel)
    for k, series in enumerate(panel.series):
        value, low, high = np.array(series.values, float).reshape(-1, 3).T
        places = [
            names.index(str(name)) + (k - (len(panel.series) - 1) / 2) * _APART
            for name in series.at
        ]
        look = {**looks[series.label], "linestyle": ""}
        axes.plot(value, places, label=series.label, markersize=5.5, zorder=3, **look)
        axes.errorbar(
            value,
            places,
            xerr=_bars(value, low, high),
            fmt="none",
            ecolor=look["color"],
            capsize=2.5,
        )
    axes.set_ylim(len(names) - 0.5, -0.5)
    if axes.get_xlim()[0] < _FAR * axes.get_xlim()[1]:
        axes.axvline(0, color=QUIET, linewidth=0.8, zorder=1)
    axes.set_xlabel(panel.what, color=INK)


def _bars(value: Any, low: Any, high: Any) -> Any:
    """Return the lengths of error bars below and above; 0 without an interval."""
    return np.nan_to_num(np.maximum([value - low, high - value], 0))


def _names(panel: Panel) -> list[str]:
    """Return the names of the rows; none for an axis of numbers."""
    return list(
        dict.fromkeys(at for series in panel.series for at in series.at if isinstance(at, str))
    )


def _short(x: float) -> str:
    """Return the label of a number on an axis, such as `0.3`, `30k` or `2M`."""
    return f"{x:g}" if x < 10_000 else f"{x / 1e3:g}k" if x < 1e6 else f"{x / 1e6:g}M"
