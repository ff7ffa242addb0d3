"""How often methods are right about a panel's items: by the number of own labels, and of bought judges."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from roletrust_baselines.panels.report import Row
from roletrust_experiments.plots.style import ATTACKERS, DASHES, HONEST, INK, QUIET, quiet

_NAMED = 6  # methods with a colour
_ALWAYS = ("majority", "labels-only")
_COLOURS = (QUIET, INK, *HONEST[:3], *ATTACKERS[:3])


def panel_figure(rows: Sequence[Row]) -> Figure:
    """Return a figure with a panel for each kind of items and labels, and one for bought judges if some are.

    The majority, labels alone and the best methods with few labels have a colour, others are faint.
    """
    accuracy = [row for row in rows if row.measure == "accuracy"]
    places = list(dict.fromkeys((row.scored, row.labelled) for row in accuracy))
    few = sorted({row.labels for row in accuracy})[:2][-1]
    best = sorted((row for row in accuracy if row[:2] == places[0] and row.labels == few), key=lambda row: -row.value)
    names = [name for name in _ALWAYS if any(row.method == name for row in best)]
    names += [row.method for row in best if row.method not in names][: _NAMED - len(names)]
    attacked = [row for row in rows if row.measure == "attacked"]
    many = len(places) + bool(attacked)
    figure = Figure(figsize=(3.2 * min(many, 3) + 1.6, 3.0 * -(-many // 3) + 0.4), layout="constrained")
    axes = figure.subplots(-(-many // 3), min(many, 3), sharey=True, squeeze=False).ravel()
    for ax, place in zip(axes, places, strict=False):
        ax.set_title(f"{place[0]} items" + f", labels of {place[1]} ones" * (place[0] != place[1]), fontsize=10)
        _lines(ax, [row for row in accuracy if row[:2] == place], names, "labels")
        ax.set_xlabel("own labels")
    if attacked:
        axes[many - 1].set_title("bought judges", fontsize=10)
        _lines(axes[many - 1], attacked, names, "bought")
        axes[many - 1].set_xlabel("bought judges")
    for ax in axes[many:]:
        ax.set_visible(False)
    axes[0].set_ylabel("share of items that are right")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", frameon=False, fontsize=8)
    return figure


def _lines(ax: Axes, rows: Sequence[Row], names: Sequence[str], along: str) -> None:
    """Draw a line for each method, with its interval if it has a colour; labels of attacked ones are the dashes."""
    ticks = sorted({getattr(row, along) for row in rows})
    for method, labels in dict.fromkeys((row.method, row.labels if along == "bought" else 0) for row in rows):
        line = [row for row in rows if row.method == method and (along == "labels" or row.labels == labels)]
        at = [ticks.index(getattr(row, along)) for row in line]
        named = method in names
        colour = _COLOURS[names.index(method)] if named else "#D1D5DB"
        dashes = DASHES[1] if along == "bought" and labels == 0 else DASHES[0]
        label = method if named and along == "labels" else None
        ax.plot(at, [row.value for row in line], color=colour, linestyle=dashes, label=label, zorder=2 + named)
        if named:
            ax.fill_between(at, [row.low for row in line], [row.high for row in line], color=colour, alpha=0.12)
    ax.set_xticks(range(len(ticks)), [f"{tick}" for tick in ticks])
    ax.set_ylim(0, 1.02)
    quiet(ax, "y")
