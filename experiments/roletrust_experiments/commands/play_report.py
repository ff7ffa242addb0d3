"""What played games came to: a table for people, notes on it, and plain data."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from roletrust_env import Policy
from roletrust_env.metrics.confidence import Estimate
from roletrust_experiments.playing.games import Played
from roletrust_experiments.playing.group_measures import AUC_FINALLY, AUC_MEANWHILE, MEASURES, measured_since

_EXPLAINED = {
    AUC_MEANWHILE: "AUC: the chance that an attacker has less trust than an honest agent of its role, by their mean "
    "trust while the attack is on (left) and by the final one",
    "false alarms": "false alarms: share of rounds and honest agents in which trust is below 0.5",
    "utility": "utility: what the most trusted provider delivers over the best that any does; one that serves nobody "
    "in a round delivers nothing",
    "recovery": "recovery: rounds after the attack until the mean trust of the honest is within 0.05 of that without "
    "it",
}


def as_data(played: Sequence[Played]) -> dict[str, Any]:
    """All that was measured, by trust model; what is undefined is None, with the reason."""
    return {
        one.model: {
            "groups": {
                group.label: {"agents": group.size, "present at the end": _plain(group.present)}
                | {name: _plain(estimate) for name, estimate in group.measures.items()}
                for group in one.groups
            },
            "damage": {who: _plain(estimate) for who, estimate in one.damage.items()},
            "metrics": {name: _plain(estimate) for name, estimate in one.metrics.items()},
        }
        for one in played
    }


def as_table(title: str, played: Sequence[Played], games: int) -> Table:
    """How every group of agents fared under each model, and what the attack came to."""
    table = Table(title=escape(title), title_justify="left", title_style="bold", box=SIMPLE_HEAD, pad_edge=False)
    table.padding = (0, 1, 0, 0)  # it fits into 80 columns
    table.add_column("agents")
    table.add_column("at end", justify="right", no_wrap=True)
    for name in MEASURES:
        table.add_column(name.replace(" ", "\n"), justify="right", no_wrap=True)
    for one in played:
        if len(played) > 1:
            table.add_row(f"[bold]{escape(one.model)}[/]")
        for group in one.groups:
            cells = [_shown(estimate) for estimate in group.measures.values()]
            here = f"{group.present.mean:.{0 if games == 1 else 1}f}".removesuffix(".0")
            style = None if group.honest else "dark_orange3"
            table.add_row(escape(group.label), f"{here}/{group.size}", *cells, style=style)
        for who, estimate in one.damage.items():
            table.add_row(f"damage, {who}", "", _shown(estimate), style="bold")
        for name, estimate in one.metrics.items():
            if name.startswith(AUC_MEANWHILE):
                role = name.removeprefix(AUC_MEANWHILE)
                table.add_row(f"AUC{role}", "", _shown(estimate), "", _shown(one.metrics[AUC_FINALLY + role]))
            elif not name.startswith(AUC_FINALLY) and not np.isnan(estimate.mean):
                table.add_row(name, "", _shown(estimate))
        table.add_section()
    return table


def notes(played: Sequence[Played], games: int, attackers: Mapping[str, Policy]) -> list[str]:
    """What the numbers of the table are."""
    rules = played[0].game.scenario
    since = measured_since(attackers, rules.max_cycles)
    start = f"round {since} ({(since + 1) * rules.period_s:g} s)"
    past = "the attack is on, the first rounds are past" if attackers else "the first rounds are past"
    said = [
        f"mean of {games} games ± half the 95% confidence interval, rounded up" if games > 1 else "one game",
        "at end: agents present in the last round / all of them; means are over those present",
        f"lowest trust: of the group's mean, from {start} on: {past}",
    ]
    if any(one.damage for one in played):
        said.append(
            "damage: mean trust of the honest in the same games without the attack, less that under it; "
            "who is gone in one of the two counts with its last trust"
        )
    if unrated := [one.model for one in played if not one.game.model.rates_raters]:
        said.append(f"no trust in raters: {', '.join(unrated)}: false alarms and recovery are those of providers alone")
    measured = [(one.model, name, estimate) for one in played for name, estimate in one.metrics.items()]
    shown = {name.partition(",")[0] for _, name, estimate in measured if not np.isnan(estimate.mean)}
    said += [explained for name, explained in _EXPLAINED.items() if name in shown]
    undefined: dict[str, list[str]] = {}
    for model, name, estimate in measured:
        if estimate.why:
            undefined.setdefault(f"{name}: undefined: {estimate.why}", []).append(model)
    said += [f"{why} ({', '.join(models)})" if len(played) > 1 else why for why, models in undefined.items()]
    return said


def _shown(estimate: Estimate) -> str:
    if np.isnan(estimate.mean):
        return "undefined" if estimate.why else "nobody there"
    half = estimate.half
    return f"{estimate.mean:.3f}" if np.isnan(half) else f"{estimate.mean:.3f}±{math.ceil(half * 1000) / 1000:.3f}"


def _plain(estimate: Estimate) -> dict[str, float | str | None]:
    """NaN is no JSON."""
    mean, half = (None if np.isnan(value) else value for value in (estimate.mean, estimate.half))
    return {"mean": mean, "half_95": half, **({"why": estimate.why} if estimate.why else {})}
