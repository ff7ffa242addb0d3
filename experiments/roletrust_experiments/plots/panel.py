"""How often methods are right about a panel's items: by the number of own labels, and of bought
judges.
"""

from collections.abc import Sequence

from matplotlib.figure import Figure

from roletrust_baselines.panels.report import Row
from roletrust_env.metrics.confidence import Interval
from roletrust_experiments.plots.charts import Panel, Series, panels_figure

_NAMED = 6  # methods with a line
_ALWAYS = ("majority", "labels-only")


def panel_figure(rows: Sequence[Row]) -> Figure:
    """Return a figure with a panel for each kind of items and labels, and for bought judges if
    there are some.

    Lines are of the majority, of labels alone, and of the best methods with few labels.
    """
    accuracy = [row for row in rows if row.measure == "accuracy"]
    attacked = [row for row in rows if row.measure == "attacked"]
    few = sorted({row.labels for row in accuracy})[:2][-1]
    best = sorted(
        (row for row in accuracy if row[:2] == accuracy[0][:2] and row.labels == few),
        key=lambda r: -r.value,
    )
    names = [name for name in _ALWAYS if any(row.method == name for row in best)]
    names += [row.method for row in best if row.method not in names][: _NAMED - len(names)]

    def panel(title: str, along: str, mine: Sequence[Row], field: str) -> Panel:
        lines = [[row for row in mine if row.method == name] for name in names]
        series = [
            Series(
                line[0].method,
                [getattr(row, field) for row in line],
                [Interval(row.value, row.low, row.high) for row in line],
            )
            for line in lines
            if line
        ]
        return Panel(title, along, "share of items that are right", series, "symlog")

    panels = []
    for place in dict.fromkeys(row[:2] for row in accuracy):
        title = f"{place[0]} items" + f", labels of {place[1]} ones" * (place[0] != place[1])
        panels.append(
            panel(title, "own labels", [row for row in accuracy if row[:2] == place], "labels")
        )
    for labels in sorted({row.labels for row in attacked}):
        mine = [row for row in attacked if row.labels == labels]
        panels.append(panel(f"{labels} own labels", "bought judges", mine, "bought"))
    return panels_figure("", panels, "95% intervals", columns=3)
