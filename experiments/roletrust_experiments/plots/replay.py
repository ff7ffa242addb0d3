"""Figure of an attack of a benchmark: what consumers get, and whom trust believes, round by
round.
"""

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from roletrust_env.metrics.confidence import over_games
from roletrust_experiments.playing.replay import Replay
from roletrust_experiments.plots.style import ATTACKER, HONEST, INK, tidy

Floats = npt.NDArray[np.float64]


def replay_figure(title: str, replay: Replay) -> Figure:
    """Return a figure with a panel for consumers and one for each role, means over the games with
    95% intervals.
    """
    sides = [
        [(side.label, side.attacks, side.trust) for side in replay.sides if side.rates == rates]
        for rates in (True, False)
    ]
    panels = (
        (
            "utility of consumers",
            2,
            [("everybody honest", False, replay.honest), ("attack", True, replay.utility)],
        ),
        ("trust in raters (ToR)", 1, sides[0]),
        ("trust in providers (ToP)", 1, sides[1]),
    )
    figure = Figure(figsize=(12, 3.5), layout="constrained")
    figure.suptitle(title, x=0.01, ha="left", fontsize=11, color=INK)
    for axes, (label, first, lines) in zip(figure.subplots(1, 3), panels, strict=True):
        _panel(axes, label, first, lines)
    return figure


def _panel(axes: Axes, label: str, first: int, lines: Iterable[tuple[str, bool, Floats]]) -> None:
    tidy(axes, label)
    for name, attacks, values in lines:
        mean, half, _ = over_games(values)
        rounds = np.arange(first, first + len(mean))
        colour, dash = (ATTACKER, "-") if attacks else (HONEST[0], "--")
        axes.plot(rounds, mean, label=name, linewidth=2, color=colour, linestyle=dash)
        axes.fill_between(rounds, mean - half, mean + half, color=colour, alpha=0.15, linewidth=0)
    axes.set_xlabel("round", color=INK)
    axes.legend(frameon=False, labelcolor=INK, fontsize=9)
