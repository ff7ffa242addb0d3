"""Figure of an attack of a benchmark: what consumers receive, and which agents have their trust,
round by round.
"""

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from roletrust_env.benchmarking.replay import Replay
from roletrust_env.metrics.confidence import over_games
from roletrust_experiments.plots.style import ATTACKER, HONEST, INK, tidy

Floats = npt.NDArray[np.float64]


def replay_figure(replay: Replay) -> Figure:
    """Return a figure of services and trust by round, means over the games with 95% intervals.

    Panels without a line are left out: services from the attacker where it has no provider, and
    trust in raters under a trust model that does not rate raters.
    """
    attacked, honest = replay.attacked, replay.honest
    sides = [
        [(side.label, side.attacks, side.trust) for side in attacked.sides if side.rates == rates]
        for rates in (True, False)
    ]
    has_providers = any(side.attacks and not side.rates for side in attacked.sides)
    panels = {
        "quality received": [
            ("all agents honest", False, honest.received),
            ("attack", True, attacked.received),
        ],
        "share of services": [("from compromised providers", True, attacked.from_attacker)]
        if has_providers
        else [],
        "trust in raters": sides[0],
        "trust in providers": sides[1],
    }
    shown = {label: lines for label, lines in panels.items() if lines}
    figure = Figure(figsize=(4 * len(shown), 3.5), layout="constrained")
    figure.suptitle(replay.title, x=0.01, ha="left", fontsize=11, color=INK)
    grid = figure.subplots(1, len(shown), squeeze=False)[0]
    for axes, (label, lines) in zip(grid, shown.items(), strict=True):
        _panel(axes, label, lines)
    return figure


def _panel(axes: Axes, label: str, lines: Iterable[tuple[str, bool, Floats]]) -> None:
    tidy(axes, label)
    for name, attacks, values in lines:
        mean, half, _ = over_games(values)
        rounds = np.arange(1, 1 + len(mean))
        colour, dash = (ATTACKER, "-") if attacks else (HONEST[0], "--")
        axes.plot(rounds, mean, label=name, linewidth=2, color=colour, linestyle=dash)
        axes.fill_between(rounds, mean - half, mean + half, color=colour, alpha=0.15, linewidth=0)
    axes.set_xlabel("round", color=INK)
    axes.legend(frameon=False, labelcolor=INK, fontsize=9)
