"""Trust curves of any game in one figure: lines for a few agents, bands for a crowd."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from roletrust_env import Game, Policy
from roletrust_env.evaluation.curves import Curves
from roletrust_env.evaluation.groups import attack_windows
from roletrust_env.metrics.confidence import Floats, over_games
from roletrust_env.metrics.score import mean_or_nan
from roletrust_experiments.paper.figures import loop_note
from roletrust_experiments.plots.style import (
    ATTACKED,
    ATTACKERS,
    DASHES,
    HONEST,
    INK,
    PERTURBED,
    QUIET,
    shade,
    tidy,
)

_FAINT = 0.3  # opacity
_VISIBLE = 0.005  # minimum width of a visible band
_FEW = 4  # maximum number of honest agents with a line each
_NAMED = 4  # maximum number of attackers with a name and a colour each


class _Line(NamedTuple):
    """Style of a line."""

    label: str
    colour: str
    width: float
    dashes: str | tuple[float, object]


def curve_figure(title: str, game: Game, curves: Curves, attackers: Mapping[str, Policy]) -> Figure:
    """Return a figure of the trust of raters, of providers, and of agents with both roles, against
    time.

    Each honest agent has a line; a crowd has its mean and a band with the middle 90%. Each attacker
    has a line. Over several games, a line is the mean with its 95% confidence interval. A line is
    faint where fewer than half of its agents are present, and its label counts them at the end.

    Args:
        title: Title of the figure.
        game: Game that was played.
        curves: Curves of the games.
        attackers: Policies of the attackers by agent.
    """
    roster, scenario = game.roster, game.scenario
    panels = [Panel("trust of providers, ToP", roster.provider_names, curves.top, curves.time_s)]
    if game.model.rates_raters:
        panels.insert(
            0, Panel("trust of raters, ToR", roster.rater_names, curves.tor, curves.time_s)
        )
    if roster.n_both:
        both = roster.n_agents - roster.n_both
        panels.append(
            Panel("trust of both, ToA", roster.names[both:], curves.trust[:, both:], curves.time_s)
        )
    period = scenario.period_s
    end = scenario.max_cycles * period
    perturbed = [
        (blow.start * period, blow.stop * period)
        for blow in scenario.perturbations
        if blow.start < scenario.max_cycles
    ]
    rounds = scenario.max_cycles
    windows = [(a * period, b * period) for a, b in attack_windows(attackers, rounds) if a < rounds]
    notes = [note for note in [loop_note(game)] if note]
    return trust_figure(
        title, panels, end, attackers=attackers, attacks=windows, perturbed=perturbed, notes=notes
    )


class Panel(NamedTuple):
    """Label, agents, trust, (T, agents, games), and times in seconds, (T,), of a panel."""

    label: str
    names: Sequence[str]
    trust: Floats
    time_s: Floats


def trust_figure(
    title: str,
    panels: Sequence[Panel],
    end: float,
    *,
    attackers: Collection[str] = (),
    attacks: Iterable[tuple[float, float]] = (),
    perturbed: Iterable[tuple[float, float]] = (),
    labels: tuple[str, str] = ("attack", "perturbed"),
    notes: Sequence[str] = (),
) -> Figure:
    """Return a figure of trust against time in one or more panels. Lines are as in `curve_figure`.

    Args:
        title: Title of the figure.
        panels: Panels from top to bottom.
        end: End of the axis in seconds.
        attackers: Names of the attackers.
        attacks: Intervals with an attack.
        perturbed: Intervals with a perturbation of services.
        labels: Labels of both kinds of intervals.
        notes: Notes below the figure.
    """
    figure = Figure(figsize=(9.6, 0.6 + 2.5 * len(panels)), layout="constrained")
    grid = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    faints = []
    for k, (axes, (label, names, trust, time_s)) in enumerate(zip(grid, panels, strict=True)):
        tidy(axes, label)
        shade(axes, attacks, ATTACKED, labels[0] if k == 0 else None)
        shade(axes, perturbed, PERTURBED, labels[1] if k == 0 else None)
        faints.append(_draw(axes, names, time_s, trust, attackers))
        axes.set_xlim(0, end)
        axes.legend(
            loc="center left",
            bbox_to_anchor=(1.005, 0.5),
            frameon=False,
            labelcolor=INK,
            handlelength=2.6,
        )
    grid[-1].set_xlabel("time (s)", color=INK)
    figure.suptitle(title, x=0.012, ha="left", fontsize=12.5, fontweight="bold", color=INK)
    games = panels[0].trust.shape[-1]
    remarks = [f"mean of {games} games, in its 95% confidence interval"] if games > 1 else []
    remarks += [*notes, *(["faint: more than half are absent"] if any(faints) else [])]
    if remarks:
        figure.supxlabel("; ".join(remarks), x=0.99, ha="right", fontsize=9, color=QUIET)
    return figure


def _draw(
    axes: Axes, names: Sequence[str], time_s: Floats, trust: Floats, attackers: Collection[str]
) -> bool:
    """Draw all agents of one panel, with trust (T, agents, games). Return whether some line is
    faint somewhere.
    """
    bad = [i for i, name in enumerate(names) if name in attackers]
    honest = [i for i in range(len(names)) if i not in bad]
    faint = False
    for k, i in enumerate(bad):
        if len(bad) <= _NAMED:
            line = _Line(f"{names[i]} (attacker)", ATTACKERS[k], 3.0, DASHES[k])
            faint |= _line(axes, time_s, trust[:, [i]], line)
        else:
            label = _counted(f"{len(bad)} attackers", trust[:, bad]) if k == 0 else None
            faint |= _thin(axes, time_s, trust[:, i], label)
    if len(honest) <= _FEW:
        for k, i in enumerate(honest):
            faint |= _line(axes, time_s, trust[:, [i]], _Line(names[i], HONEST[k], 1.6, DASHES[k]))
        return faint
    crowd = trust[:, honest]
    low, high = _middle(crowd.reshape(len(time_s), -1))
    if np.nanmax(high - low, initial=0.0) > _VISIBLE:
        axes.fill_between(
            time_s,
            low,
            high,
            color=HONEST[2],
            alpha=0.4,
            linewidth=0,
            zorder=2,
            label="90% of them",
        )
    return faint | _line(
        axes, time_s, crowd, _Line(f"mean of {len(honest)} honest", HONEST[0], 1.8, "-")
    )


def _line(axes: Axes, time_s: Floats, values: Floats, line: _Line) -> bool:
    """Draw the mean of agents over games, (T, agents, games), and its interval. Return whether it
    is faint somewhere.

    Lines of attackers are broad and lie under the others.
    """
    mean, half, games = over_games(mean_or_nan(values, axis=1))
    few = _few(values)
    order = 4.0 - line.width / 10
    style: Any = {"color": line.colour, "linestyle": line.dashes, "zorder": order}
    axes.plot(
        time_s,
        np.where(few, np.nan, mean),
        linewidth=line.width,
        label=_counted(line.label, values),
        **style,
    )
    axes.plot(
        time_s, np.where(_and_next(few), mean, np.nan), linewidth=line.width, alpha=_FAINT, **style
    )
    if values.shape[-1] > 1:
        low, high = np.clip(mean - half, 0, 1), np.clip(mean + half, 0, 1)
        axes.fill_between(
            time_s,
            low,
            high,
            where=~few,
            color=line.colour,
            alpha=0.25,
            linewidth=0,
            zorder=order - 0.5,
        )
    return bool((few & (games > 0)).any())


def _thin(axes: Axes, time_s: Floats, values: Floats, label: str | None) -> bool:
    """Draw one of many attackers, (T, games). Return whether its line is faint somewhere."""
    mean, _, games = over_games(values)
    few = _few(values[:, None])
    for shown, alpha, name in ((~few, 0.5, label), (_and_next(few), _FAINT / 2, None)):
        axes.plot(
            time_s,
            np.where(shown, mean, np.nan),
            color=ATTACKERS[0],
            linewidth=0.8,
            alpha=alpha,
            label=name,
        )
    return bool((few & (games > 0)).any())


def _few(values: Floats) -> npt.NDArray[np.bool_]:
    """Return where fewer than half of agents and games are present, (T,); values are (T, agents,
    games).
    """
    few: npt.NDArray[np.bool_] = (~np.isnan(values)).mean(axis=(1, 2)) < 0.5
    return few


def _and_next(mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Return the mask with its neighbours, so that a faint part of a line touches the next part."""
    wide = mask.copy()
    wide[1:] |= mask[:-1]
    wide[:-1] |= mask[1:]
    return wide


def _counted(label: str, values: Floats) -> str:
    """Return the label with the number of agents at the end, if some are absent; values are (T,
    agents, games).
    """
    present = ~np.isnan(values[-1])
    if present.all():
        return label
    agents, games = present.shape
    if agents > 1:
        return f"{label},\n{present.sum() / games:.3g} at the end"
    return f"{label},\n{f'in {present.sum()} of {games} games' if games > 1 else 'gone'} at the end"


def _middle(values: Floats) -> tuple[Floats, Floats]:
    """Return the 5% and 95% quantiles of each row without NaN; NaN for a row of NaN."""
    low, high = np.full((2, len(values)), np.nan)
    present = ~np.isnan(values).all(axis=1)
    low[present], high[present] = np.nanquantile(values[present], [0.05, 0.95], axis=1)
    return low, high
