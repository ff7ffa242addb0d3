"""Figures of the report as images for papers and slides: the best models, in the first condition of each."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from roletrust_env.benchmark.leaderboard import LeaderboardRow
from roletrust_env.benchmark.learners.leaderboard import title
from roletrust_env.benchmark.suite import Scale
from roletrust_experiments.plots.learners import learners_figure
from roletrust_experiments.plots.style import ATTACKER, HONEST, INK, QUIET, tidy
from roletrust_experiments.report.content import Content
from roletrust_experiments.report.looks import Look, looks
from roletrust_experiments.report.robustness import Robustness
from roletrust_experiments.report.table import Table

_MARKS = {"circle": "o", "square": "s", "triangle": "^", "diamond": "D", "inverted_triangle": "v"}
_LINES = 6
"""Maximum number of models with lines; more would hide each other."""


def pictures(content: Content) -> dict[str, Figure]:
    """Return an image for each table by name."""
    found = _of_models(content.robustness) if content.robustness else {}
    if learners := content.learners:
        found["learners"] = learners_figure(title(learners.suite), learners.found, learners.scales)
    return found


def _of_models(robustness: Robustness) -> dict[str, Figure]:
    styles = dict(list(looks(robustness.order).items())[:_LINES])
    heat = partial(_heat, lowest=_lowest(robustness))
    breakdown = partial(_breakdown, scale=robustness.suite.score)
    return {
        "leaderboard": _leaderboard(robustness.leaderboard.rows, robustness.suite.score),
        "heatmap": _panels(
            robustness.tables["heatmap"], heat, robustness.order, (10.4, 0.3 * len(robustness.order) + 2.2)
        ),
        "curves": _panels(robustness.tables["curves"], _curves, styles, (8.4, 3.2)),
        "breakdown": _panels(robustness.tables["breakdown"], breakdown, styles, (8.4, 3.2)),
        "tradeoff": _panels(robustness.tables["tradeoff"], _tradeoff, styles, (8.4, 3.6)),
    }


def _leaderboard(standings: Sequence[LeaderboardRow], scale: Scale) -> Figure:
    """Clean and worst-case score of each model, with their intervals."""
    figure = Figure(figsize=(8.4, 1.3 + 0.3 * len(standings)), layout="constrained")
    axes = figure.subplots()
    places = np.arange(len(standings))
    for name, field, colour, mark in (("clean", "clean", HONEST[0], "o"), ("worst case", "worst", ATTACKER, "s")):
        found = [getattr(row, field) for row in standings]
        halves = [0 if np.isnan(one.half) else one.half for one in found]
        axes.errorbar(
            [one.mean for one in found], places, xerr=halves, fmt=mark, color=colour, label=name, capsize=2.5, ms=6
        )
    ends = [(row.worst.mean, row.clean.mean) for row in standings]
    axes.hlines(places, *zip(*ends, strict=True), color="#9CA3AF", linewidth=1, zorder=0)
    axes.set_yticks(places, [f"{row.rank}  {row.model}" for row in standings])
    axes.invert_yaxis()
    axes.set_xlabel(f"{scale} of going by trust, with 95% intervals", color=INK)
    _quiet(axes, "x")
    axes.legend(frameon=False, loc="lower left", ncols=2, bbox_to_anchor=(0, 1), labelcolor=INK)
    return figure


def _panels(table: Table, draw: Any, how: Any, size: tuple[float, float]) -> Figure:
    """Return a figure with a panel for each value of the first column of a table."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in table.rows:
        groups.setdefault(row[0], []).append(dict(zip(table.header, row, strict=True)))
    figure = Figure(figsize=(size[0], size[1] * max(1, len(groups))), layout="constrained")
    for axes, (name, rows) in zip(np.ravel(figure.subplots(max(1, len(groups)))), groups.items(), strict=False):
        draw(axes, rows, how)
        axes.set_title(name, loc="left", fontsize=11, fontweight="bold", color=INK)
    return figure


def _lowest(robustness: Robustness) -> float:
    """Return the lowest utility, at which the colours of every panel begin."""
    table = robustness.tables["heatmap"]
    place = table.header.index("utility")
    return float(np.nanmin([row[place] for row in table.rows], initial=1.0))


def _heat(axes: Axes, rows: Sequence[Mapping[str, Any]], order: Sequence[str], lowest: float) -> None:
    attacks, models = list(dict.fromkeys(row["attack"] for row in rows)), list(order)
    left = np.full((len(models), len(attacks)), np.nan)
    for row in rows:
        place = models.index(row["model"]), attacks.index(row["attack"])
        left[place] = row["utility"]
        if row["worst"]:
            axes.plot(place[1], place[0], "o", color="white", mec="black", ms=5)
    shown = axes.imshow(left, cmap="cividis", vmin=lowest, vmax=1, aspect="auto", interpolation="none")
    axes.set_xticks(range(len(attacks)), attacks, rotation=60, ha="right", rotation_mode="anchor", fontsize=8.5)
    axes.set_yticks(range(len(models)), models, fontsize=8.5)
    axes.figure.colorbar(shown, ax=axes, label="utility", pad=0.01)


def _curves(axes: Axes, rows: Sequence[Mapping[str, Any]], styles: Mapping[str, Look]) -> None:
    for row in rows:
        if row["worst"] and row["model"] in styles:
            label = f"{row['model']}: {row['attack']}"
            axes.plot(row["rounds"], row["utility"], label=label, lw=1.7, **_line(styles[row["model"]]))
    tidy(axes, "utility")
    axes.set_xlabel("round", color=INK)
    _legend(axes)


def _breakdown(axes: Axes, rows: Sequence[Mapping[str, Any]], styles: Mapping[str, Look], scale: Scale) -> None:
    for model, look in styles.items():
        mine = [row for row in rows if row["model"] == model]
        halves = np.nan_to_num([row["score_half_95"] for row in mine])
        shares, means = [row["share"] for row in mine], [row["score"] for row in mine]
        mark = _MARKS[look.mark]
        axes.errorbar(shares, means, yerr=halves, label=model, capsize=3, marker=mark, lw=1.7, **_line(look))
    axes.set_xlabel("share of the compromised", color=INK)
    axes.set_ylabel(f"worst-case {scale}", color=INK)
    _quiet(axes, "y")
    _legend(axes)


def _tradeoff(axes: Axes, rows: Sequence[Mapping[str, Any]], styles: Mapping[str, Look]) -> None:
    for model, look in styles.items():
        mine = [row for row in rows if row["model"] == model]
        if mine:
            points = [row["auc"] for row in mine], [row["damage"] for row in mine]
            sizes = [90 if row["worst"] else 22 for row in mine]
            axes.scatter(*points, color=look.colour, marker=_MARKS[look.mark], s=sizes, alpha=0.75, label=model)
    axes.axvline(0.5, color=QUIET, linestyle="--", lw=1)  # chance
    axes.set_xlim(-0.03, 1.03)
    axes.set_xlabel("detectability (AUC)", color=INK)
    axes.set_ylabel("damage", color=INK)
    _quiet(axes, "both")
    _legend(axes)


def _line(look: Look) -> dict[str, Any]:
    return {"color": look.colour, "linestyle": (0, look.dash) if look.dash else "-"}


def _legend(axes: Axes) -> None:
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1, 0.5), fontsize=8.8, labelcolor=INK)


def _quiet(axes: Axes, grid: Any) -> None:
    axes.grid(axis=grid, color="#E5E7EB", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(colors=QUIET, labelcolor=INK, length=3)
    for side in axes.spines.values():
        side.set_visible(False)
