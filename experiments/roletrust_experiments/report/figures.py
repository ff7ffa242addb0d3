"""Figures of a report, each drawn once, for the page and for files."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from roletrust_env.benchmarking.leaderboard import LeaderboardRow
from roletrust_env.metrics.confidence import Estimate
from roletrust_experiments.plots.charts import Panel, Series, panels_figure
from roletrust_experiments.plots.figure_files import write_figure
from roletrust_experiments.plots.learners import learners_figure
from roletrust_experiments.plots.style import ATTACKER, ATTACKERS, HONEST, INK, QUIET, quiet, tidy
from roletrust_experiments.report.content import Content
from roletrust_experiments.report.robustness import Robustness, Table

Rows = Sequence[Mapping[str, Any]]
"""Rows of a table by the names of its columns."""

_LINES = 6  # maximum number of models with lines; more would hide each other
_COLOURS = (HONEST[0], ATTACKERS[0], HONEST[1], ATTACKERS[2], ATTACKERS[1], HONEST[2], ATTACKERS[3])
_DASHES: tuple[Any, ...] = ("-", (0, (7, 3)), (0, (2, 2)), (0, (9, 3, 2, 3)))
_MARKS = ("o", "s", "^", "D", "v")
_WIDTH = 10  # of a figure, inches
_ROW, _PANEL = 0.3, 3.2  # heights of a row of the heat map, and of a panel with lines, inches
_NARROW = 0.19  # height of a row of the leaderboard, inches: it is seen at a glance
_PANELS = 2  # with lines side by side
_MARK = 22  # area, square points
_STYLE: Any = {  # Matplotlib's type of settings is a list of all their names
    # Text remains text, which can be searched and edited; the default of PDF is Type 3, which IEEE
    # refuses.
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "roletrust",
}
"""Settings of Matplotlib."""


def write_figures(folder: Path, content: Content, *suffixes: str) -> list[str]:
    """Write each figure of a report, and return their names, which are those of their tables.

    Args:
        folder: Folder of the files.
        content: Content of the report.
        suffixes: Suffixes of the files, which give their formats.
    """
    # Matplotlib makes labels of ticks when it draws, so that the style must hold until the file is
    # written.
    with rc_context(_STYLE):
        figures = _figures(content.robustness) if content.robustness else {}
        if learners := content.learners:
            figures["learners"] = learners_figure(
                learners.suite.title, learners.results, learners.scales
            )
        for name, figure in figures.items():
            for suffix in suffixes:
                write_figure(
                    folder / f"{name}{suffix}", figure, colours=256 if suffix == ".png" else None
                )
    return list(figures)


def _figures(robustness: Robustness) -> dict[str, Figure]:
    """Return the figures of trust models by the name of their table."""
    tables, styles = robustness.tables, _styles(robustness.order[:_LINES])
    alike = "alike" in robustness.leaderboard.columns
    return {
        "leaderboard": leaderboard_figure(
            robustness.leaderboard.rows, robustness.suite.score, alike
        ),
        "heatmap": _heatmap(robustness),
        "curves": _panels(tables["curves"], lambda axes, rows: _draw_curves(axes, rows, styles)),
        "breakdown": _breakdown(robustness),
        "tradeoff": _panels(
            tables["tradeoff"], lambda axes, rows: _draw_tradeoff(axes, rows, styles)
        ),
    }


def _styles(models: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Return colour, dash and mark of each model, so that colour is never the only difference."""
    return {
        model: {"color": _COLOURS[k % 7], "linestyle": _DASHES[k % 4], "marker": _MARKS[k % 5]}
        for k, model in enumerate(models)
    }


def leaderboard_figure(standings: Sequence[LeaderboardRow], score: str, alike: bool) -> Figure:
    """Return clean and worst-case score of each model, with their intervals.

    Args:
        standings: Rows of the leaderboard, from the best model to the worst.
        score: Name of the score.
        alike: True to draw the worst case of attacks that serve all raters alike, too.
    """
    figure = Figure(figsize=(_WIDTH, _NARROW * (len(standings) + 4)), layout="constrained")
    axes, places = figure.subplots(), np.arange(len(standings))
    marks = [("clean", "clean", HONEST[0], "o"), ("worst case", "worst", ATTACKER, "s")]
    if alike:
        marks.insert(1, ("of attacks that serve all raters alike", "alike", ATTACKERS[1], "D"))
    for name, field, colour, mark in marks:
        estimates = [getattr(row, field) for row in standings]
        halves = [0 if np.isnan(estimate.half) else estimate.half for estimate in estimates]
        axes.errorbar(
            [estimate.mean for estimate in estimates],
            places,
            xerr=halves,
            fmt=mark,
            color=colour,
            label=name,
            capsize=2.5,
        )
    ends = [(row.worst.mean, row.clean.mean) for row in standings]
    axes.hlines(places, *zip(*ends, strict=True), color="#9CA3AF", linewidth=1, zorder=0)
    axes.set_yticks(places, [f"{row.rank}  {row.model}" for row in standings], fontsize="small")
    for place, (above, below) in enumerate(pairwise(standings)):
        if above.tier != below.tier:
            axes.axhline(place + 0.5, color=QUIET, linestyle=":", linewidth=1)
    axes.set_ylim(len(standings) - 0.4, -0.6)
    axes.set_xlabel(
        f"{score} of going by trust, with 95% intervals; dotted lines between tiers", color=INK
    )
    quiet(axes, "x")
    axes.legend(
        frameon=False, loc="lower left", ncols=len(marks), bbox_to_anchor=(0, 1), labelcolor=INK
    )
    return figure


def _breakdown(robustness: Robustness) -> Figure:
    """Return the worst-case score of each model by the share of compromised agents."""
    panels = []
    for where, rows in _groups(robustness.tables["breakdown"]).items():
        series = []
        for model in robustness.order[:_LINES]:
            mine = [row for row in rows if row["model"] == model]
            scores = [Estimate(row["score"], row["score_half_95"]).interval for row in mine]
            series.append(Series(model, [row["share"] for row in mine], scores))
        panels.append(
            Panel(where, "share of the compromised", f"worst-case {robustness.suite.score}", series)
        )
    return panels_figure("", panels, "95% intervals")


def _heatmap(robustness: Robustness) -> Figure:
    """Return the worst case of each model in each condition with attackers, in hundredths; dark is
    low.
    """
    table, models, lowest = robustness.tables["worst_cases"], robustness.order, robustness.lowest
    means = {
        (row["model"], f"{row['scenario']}, {row['track']} {_percent(row['share'])}"): row["score"]
        for rows in _groups(table).values()
        for row in rows
        if row["share"]
    }
    where = list(dict.fromkeys(condition for _, condition in means))
    values = np.array(
        [[means.get((model, condition), np.nan) for condition in where] for model in models]
    )
    figure = Figure(figsize=(_WIDTH, _ROW * (len(models) + 7)), layout="constrained")
    axes = figure.subplots()
    axes.imshow(values, cmap="cividis", vmin=lowest, vmax=1, aspect="auto", interpolation="none")
    axes.set_xticks(
        range(len(where)), where, fontsize="small", rotation=45, ha="right", rotation_mode="anchor"
    )
    axes.set_yticks(range(len(models)), models, fontsize="small")
    axes.tick_params(length=0, labelcolor=INK)
    axes.spines[:].set_visible(False)
    for (row, column), value in np.ndenumerate(values):
        if not np.isnan(value):
            ink = "white" if value - lowest < 0.5 * (1 - lowest) else "black"
            text = f"{100 * value:.0f}".replace("-", "\N{MINUS SIGN}")
            axes.text(column, row, text, color=ink, ha="center", va="center", fontsize="x-small")
    colours = ScalarMappable(Normalize(lowest, 1), "cividis")
    bar: Any = figure.colorbar(colours, ax=axes, label=robustness.suite.score, pad=0.01, aspect=25)
    bar.outline.set_visible(False)
    return figure


def _panels(table: Table, draw: Callable[[Axes, Rows], None]) -> Figure:
    """Return a figure with a panel for each value of the first column of a table."""
    groups = _groups(table)
    wide = min(_PANELS, max(1, len(groups)))
    many = -(-max(1, len(groups)) // wide)
    figure = Figure(figsize=(_WIDTH, 3 * _ROW + _PANEL * many), layout="constrained")
    panels = figure.subplots(many, wide, squeeze=False)
    for axes, (name, rows) in zip(panels.flat, groups.items(), strict=False):
        draw(axes, rows)
        axes.set_title(name, loc="left", color=INK)
    for axes in panels.flat[len(groups) :]:
        axes.set_visible(False)
    lines = {
        label: line
        for axes in panels.flat
        for line, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    if lines:
        columns = 3 * _PANELS
        figure.legend(
            lines.values(),
            lines,
            frameon=False,
            loc="outside lower center",
            ncols=columns,
            labelcolor=INK,
        )
    return figure


def _draw_curves(axes: Axes, rows: Rows, styles: Mapping[str, Mapping[str, Any]]) -> None:
    """Draw utility round by round in each model's worst case."""
    for row in rows:
        if row["worst"] and row["model"] in styles:
            axes.plot(
                row["rounds"],
                row["utility"],
                label=row["model"],
                **{**styles[row["model"]], "marker": ""},
            )
    tidy(axes, "utility")
    axes.set_xlabel("round", color=INK)


def _draw_tradeoff(axes: Axes, rows: Rows, styles: Mapping[str, Mapping[str, Any]]) -> None:
    """Draw a mark for each attack at its damage and detectability; the worst case has a large
    one.
    """
    for model, style in styles.items():
        mine = [row for row in rows if row["model"] == model]
        if mine:
            points = [row["auc"] for row in mine], [row["damage"] for row in mine]
            sizes = [4 * _MARK if row["worst"] else _MARK for row in mine]
            look = {"color": style["color"], "marker": style["marker"]}
            axes.scatter(*points, s=sizes, alpha=0.75, label=model, lw=0, **look)
    axes.axvline(0.5, color=QUIET, linestyle="--", lw=1)  # chance
    axes.set_xlim(-0.03, 1.03)
    axes.set_xlabel("detectability (AUC)", color=INK)
    axes.set_ylabel("damage", color=INK)
    quiet(axes, "both")


def _groups(table: Table) -> dict[Any, list[dict[str, Any]]]:
    """Return the rows of a table by the value of the first column."""
    groups: dict[Any, list[dict[str, Any]]] = {}
    for row in table.rows:
        groups.setdefault(row[0], []).append(dict(zip(table.header, row, strict=True)))
    return groups


def _percent(share: float) -> str:
    """Return a share for a label, different for different shares."""
    return f"{100 * share:.3g}%"
