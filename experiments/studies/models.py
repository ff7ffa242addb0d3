"""Every trust model under the same three attacks, in one row each, with the same random numbers.

Ten raters rate ten providers for a minute. The attacks last from 15 s to 45 s: a provider that
alternates between bad and good service every 5 s; four raters that rate everybody 0; and a ring of
four raters and two providers that serves badly, praises its own members and rates all others 0.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D

from roletrust_env import Game, JointPolicy, make_scenario
from roletrust_env.evaluation.curves import Curves, record_curves
from roletrust_env.evaluation.groups import attack_rounds
from roletrust_env.evaluation.specs import parse_attacks, parse_trust_model
from roletrust_env.metrics.confidence import Floats
from roletrust_env.metrics.score import mean_or_nan
from roletrust_env.trust import Traits, trust_models
from roletrust_env.world.roster import Roster
from roletrust_experiments.plots.style import (
    ATTACKED,
    ATTACKER,
    DASHES,
    HONEST,
    INK,
    QUIET,
    shade,
    tidy,
)
from studies.study import Recipe, Study


class Options(NamedTuple):
    """Trust models, all that are installed if left out, and the number of games whose mean is
    drawn.
    """

    model: tuple[str, ...] = ()
    games: int = 8


SCENARIO, ROUNDS = "crowd-10x10", 120
"""Scenario of the comparison, and its number of rounds."""

_WINDOW = "start=30,stop=90"
ATTACKS = {
    "one provider is on-off": [f"sp_0=on-off:period=20,{_WINDOW}"],
    "4 of 10 raters bad-mouth": [f"sr_[0-3]=bad-mouthing:level=0,{_WINDOW}"],
    "a ring: 4 raters, 2 providers": [
        f"sr_[0-3]=collusion:{_WINDOW}",
        f"sp_[01]=collusion:{_WINDOW}",
    ],
}
"""Attacks as `--attack` takes them, by their titles on the page."""

_ROW, _HEAD = 0.82, 1.5  # inches
_COLOURS = {"honest": HONEST[0], "attackers": ATTACKER}
_TRUSTS: dict[str, tuple[Any, float]] = {"ToP": ("-", 1.7), "ToR": (DASHES[2], 1.5)}
WORDS = {
    ("ToP", "honest"): "honest providers",
    ("ToR", "honest"): "honest raters",
    ("ToP", "attackers"): "attacking providers",
    ("ToR", "attackers"): "attacking raters",
}

RECIPES = {"models": Recipe(Options(), {"models.png": "models.png"})}


class Panel(NamedTuple):
    """One model under one attack.

    Attributes:
        time_s: seconds, (T,).
        lines: mean trust over agents and games, (T,), by the trust, `"ToR"` or `"ToP"`, and whose,
            `"honest"` or `"attackers"`, as far as there are such agents and the model rates them.
        attacked: seconds from and to which the attack lasts.
    """

    time_s: Floats
    lines: Mapping[tuple[str, str], Floats]
    attacked: tuple[float, float]


def main(study: Study[Options]) -> None:
    """Play all models under all attacks, and draw them."""
    rules = make_scenario(SCENARIO).change(max_cycles=ROUNDS)
    attacks = {name: parse_attacks(texts, rules) for name, texts in ATTACKS.items()}
    games = study.options.games
    models = {
        name: Game(rules, parse_trust_model(name, rules))
        for name in study.options.model or trust_models()
    }
    panels = {
        name: {
            attack: play_panel(JointPolicy(game, attackers), study.seed, games=games)
            for attack, attackers in attacks.items()
        }
        for name, game in models.items()
    }
    note = (
        f"shaded: during the attack; means over agents and {games} game{'s' * (games > 1)} of "
        f"{rules.name}"
    )
    families = {name: Traits.of(game.model).family for name, game in models.items()}
    study.figure("models.png", models_figure(panels, families, note))
    rows = [
        (name, attack, *line, *point)
        for name, by_attack in panels.items()
        for attack, panel in by_attack.items()
        for line, values in panel.lines.items()
        for point in zip(panel.time_s.tolist(), values.tolist(), strict=True)
    ]
    study.csv("models.csv", ("trust_model", "attack", "trust", "whose", "time_s", "mean"), rows)


def play_panel(joint_policy: JointPolicy, seed: int, *, games: int) -> Panel:
    """Return a panel from games of one model under one attack."""
    game = joint_policy.game
    curves = record_curves(joint_policy, seed, games=games)
    lines = mean_lines(game.roster, curves, joint_policy.attackers, game.model.rates_raters)
    start, stop = (
        r * game.scenario.period_s
        for r in attack_rounds(joint_policy.policies, game.scenario.max_cycles)
    )
    return Panel(curves.time_s, lines, (start, stop))


def mean_lines(
    roster: Roster, curves: Curves, attackers: Sequence[str], rates_raters: bool
) -> dict[tuple[str, str], Floats]:
    """Return the lines of a panel from the curves of games; `rates_raters` says whether the model
    does.
    """
    sides = [("ToP", roster.provider_names, curves.top)]
    sides += [("ToR", roster.rater_names, curves.tor)] if rates_raters else []
    lines = {}
    for trust, names, values in sides:
        bad = np.array([name in attackers for name in names])
        for whose, places in (("honest", ~bad), ("attackers", bad)):
            if places.any():
                lines[trust, whose] = mean_or_nan(values[:, places], axis=(1, 2))
    return lines


def models_figure(
    panels: Mapping[str, Mapping[str, Panel]], families: Mapping[str, str], note: str
) -> Figure:
    """Return small multiples: a row for each model, a column for each attack, and what is shown at
    the foot.
    """
    attacks = list(next(iter(panels.values())))
    size = 2.6 + 2.5 * len(attacks), _HEAD + _ROW * len(panels)
    figure = Figure(figsize=size, layout=ConstrainedLayoutEngine(h_pad=0.03, hspace=0.02))
    grid = figure.subplots(len(panels), len(attacks), sharex=True, sharey=True, squeeze=False)
    for row, (model, by_attack) in zip(grid, panels.items(), strict=True):
        for axes, attack in zip(row, attacks, strict=True):
            draw_panel(axes, by_attack[attack])
        row[0].set_ylabel(
            model, rotation=0, ha="right", va="center", labelpad=12, color=INK, fontweight="bold"
        )
        row[0].annotate(
            families[model],
            (0, 0.5),
            xytext=(-33, -12),
            xycoords="axes fraction",
            textcoords="offset points",
            ha="right",
            va="center",
            fontsize=8,
            color=QUIET,
        )
    for axes, attack in zip(grid[0], attacks, strict=True):
        axes.set_title(attack, color=INK, fontsize=10)
    for axes in grid[-1]:
        axes.set_xlabel("time (s)", color=INK, fontsize=9)
    shown = [panel for by_attack in panels.values() for panel in by_attack.values()]
    figure.legend(
        handles=legend_keys(shown),
        loc="outside upper right",
        ncols=4,
        frameon=False,
        fontsize=9,
        labelcolor=INK,
    )
    figure.supxlabel(note, x=0.99, ha="right", fontsize=9, color=QUIET)
    return figure


def draw_panel(axes: Axes, panel: Panel) -> None:
    """Draw the lines of a panel, and shade the time of the attack."""
    tidy(axes, "")
    axes.tick_params(labelsize=8)
    shade(axes, [panel.attacked], ATTACKED)
    for (trust, whose), values in panel.lines.items():
        dashes, width = _TRUSTS[trust]
        axes.plot(panel.time_s, values, color=_COLOURS[whose], linestyle=dashes, linewidth=width)
    axes.set_xlim(0, panel.time_s[-1])


def legend_keys(panels: Iterable[Panel]) -> list[Line2D]:
    """Return an entry of the legend for each kind of line."""
    shown = {key for panel in panels for key in panel.lines}
    return [
        Line2D(
            [],
            [],
            color=colour,
            linestyle=dashes,
            linewidth=width,
            label=f"{WORDS[trust, whose]}, {trust}",
        )
        for whose, colour in _COLOURS.items()
        for trust, (dashes, width) in _TRUSTS.items()
        if (trust, whose) in shown
    ]
