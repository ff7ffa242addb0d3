"""The trust curves of any game, in one picture: lines for a few agents, bands for a crowd."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from baselines.window import WindowedAttack
from experiments.confidence import Floats, mean_where, over_games
from experiments.recording import Curves
from experiments.style import ATTACKED, ATTACKERS, DASHES, HONEST, INK, PERTURBED, QUIET, shade, tidy
from roletrust_env import Game, Policy

_FEW = 4  # up to as many honest agents get a line each
_NAMED = 4  # up to as many attackers are named and coloured one by one


def curve_figure(title: str, game: Game, curves: Curves, attackers: Mapping[str, Policy]) -> Figure:
    """The trust of raters, of providers, and of agents that are both, against seconds.

    Honest agents get a line each, or in a crowd the mean over them and a band that holds the middle 90 of 100.
    Attackers always have lines of their own. Over several games a line is the mean, in its 95% confidence interval.

    Args:
        title: of the picture.
        game: that was played.
        curves: what it left behind.
        attackers: who attacks, and how.
    """
    roster, scenario = game.roster, game.scenario
    panels = [("trust of raters, ToR", roster.rater_names, curves.tor)] if game.model.rates_raters else []
    panels.append(("trust of providers, ToP", roster.provider_names, curves.top))
    if roster.n_both:
        both = roster.n_agents - roster.n_both
        panels.append(("trust of both, ToA", roster.names[both:], curves.trust[:, both:]))
    figure = Figure(figsize=(9.6, 0.6 + 2.5 * len(panels)), layout="constrained")
    grid = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    end = scenario.max_cycles * scenario.period_s
    perturbed = [
        (blow.start * scenario.period_s, blow.stop * scenario.period_s)
        for blow in scenario.perturbations
        if blow.start < scenario.max_cycles
    ]
    for k, (axes, (label, names, trust)) in enumerate(zip(grid, panels, strict=True)):
        tidy(axes, label)
        shade(axes, _windows(attackers, scenario.period_s, end), ATTACKED, "attack" if k == 0 else None)
        shade(axes, perturbed, PERTURBED, "perturbed" if k == 0 else None)
        _draw(axes, names, curves.time_s, trust, attackers)
        axes.set_xlim(0, end)
        axes.legend(loc="center left", bbox_to_anchor=(1.005, 0.5), frameon=False, labelcolor=INK, handlelength=2.6)
    grid[-1].set_xlabel("time (s)", color=INK)
    figure.suptitle(title, x=0.012, ha="left", fontsize=12.5, fontweight="bold", color=INK)
    games = curves.trust.shape[-1]
    if games > 1:
        note = f"mean of {games} games, in its 95% confidence interval"
        figure.supxlabel(note, x=0.99, ha="right", fontsize=9, color=QUIET)
    return figure


def _draw(axes: Axes, names: Sequence[str], time_s: Floats, trust: Floats, attackers: Mapping[str, Policy]) -> None:
    """All agents of one panel; trust is (T, agents, games)."""
    bad = [i for i, name in enumerate(names) if name in attackers]
    honest = [i for i in range(len(names)) if i not in bad]
    for k, i in enumerate(bad):
        if len(bad) <= _NAMED:
            _line(axes, time_s, trust[:, i], f"{names[i]} (attacker)", ATTACKERS[k], 3.0, DASHES[k])
        else:
            label = f"{len(bad)} attackers" if k == 0 else None
            axes.plot(time_s, over_games(trust[:, i]).mean, color=ATTACKERS[0], linewidth=0.8, alpha=0.5, label=label)
    if len(honest) <= _FEW:
        for k, i in enumerate(honest):
            _line(axes, time_s, trust[:, i], names[i], HONEST[k], 1.6, DASHES[k])
        return
    crowd = trust[:, honest]
    low, high = _middle(crowd.reshape(len(time_s), -1))
    axes.fill_between(time_s, low, high, color=HONEST[2], alpha=0.4, linewidth=0, zorder=2, label="90% of them")
    _line(axes, time_s, mean_where(crowd, axis=1), f"mean of {len(honest)} honest", HONEST[0], 1.8, "-")


def _line(
    axes: Axes,
    time_s: Floats,
    values: Floats,
    label: str,
    colour: str,
    width: float,
    dashes: str | tuple[float, object],
) -> None:
    """The mean over games, (T, games), and its interval; attackers, who are broad, lie under the others."""
    mean, half, _ = over_games(values)
    order = 4.0 - width / 10
    axes.plot(time_s, mean, color=colour, linewidth=width, linestyle=dashes, label=label, zorder=order)
    if values.shape[-1] > 1:
        low, high = np.clip(mean - half, 0, 1), np.clip(mean + half, 0, 1)
        axes.fill_between(time_s, low, high, color=colour, alpha=0.25, linewidth=0, zorder=order - 0.5)


def _middle(values: Floats) -> tuple[Floats, Floats]:
    """The 5% and the 95% quantile of each row, of what is not NaN; NaN where nothing is."""
    low, high = np.full((2, len(values)), np.nan)
    some = ~np.isnan(values).all(axis=1)
    low[some], high[some] = np.nanquantile(values[some], [0.05, 0.95], axis=1)
    return low, high


def _windows(attackers: Mapping[str, Policy], period_s: float, end: float) -> list[tuple[float, float]]:
    """When anybody attacks, in stretches of time; none if somebody always does."""
    merged: list[tuple[float, float]] = []
    for policy in sorted((p for p in attackers.values() if isinstance(p, WindowedAttack)), key=lambda p: p.start):
        start, stop = policy.start * period_s, end if policy.stop is None else min(policy.stop * period_s, end)
        if merged and start <= merged[-1][1]:
            start, stop = merged[-1][0], max(stop, merged.pop()[1])
        merged.append((start, stop))
    return [] if merged == [(0.0, end)] else [(start, stop) for start, stop in merged if start < end]
