"""Results of played games: a table for people, notes on it, and plain data."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rich.markup import escape

from roletrust_env import Policy
from roletrust_env.metrics.confidence import Estimate
from roletrust_experiments.commands.console import FittedTable
from roletrust_experiments.playing.games import Played
from roletrust_experiments.playing.group_measures import AUC_FINALLY, AUC_MEANWHILE, MEASURES, measured_since

_EXPLAINED = {
    AUC_MEANWHILE: "AUC: the probability that an attacker has less trust than an honest agent of its role, by mean "
    "trust during the attack (left) and by final trust",
    "false alarms": "false alarms: share of rounds and honest agents in which trust is below 0.5",
    "utility": "utility: quality of the most trusted provider, as a share of the best quality in the round; a provider "
    "that serves nobody in a round delivers nothing",
    "recovery": "recovery: rounds after the attack until the mean trust of the honest agents is within 0.05 of that "
    "without the attack",
}


def as_data(played: Sequence[Played]) -> dict[str, Any]:
    """Return all measurements by trust model; an undefined value is None, with the reason."""
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


def as_table(title: str, played: Sequence[Played], games: int) -> FittedTable:
    """Return a table of the results of each group of agents under each model, and of the effects of the attack."""
    table = FittedTable(escape(title), needed=3)
    table.padding = (0, 1, 0, 0)  # it fits into 80 columns
    table.column("agents")
    table.column("at end", "right")
    for name in MEASURES:
        table.column(name.replace(" ", "\n"), "right")
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
    """Return explanations of the numbers in the table."""
    rules = played[0].game.scenario
    since = measured_since(attackers, rules.max_cycles)
    start = f"round {since} ({(since + 1) * rules.period_s:g} s)"
    past = "during the attack, without the first rounds" if attackers else "without the first rounds"
    lines = [
        f"mean of {games} games ± half the 95% confidence interval, rounded up" if games > 1 else "one game",
        "at end: agents present in the last round / all agents; means are over the agents present",
        f"lowest trust: lowest value of the group's mean trust, from {start} on: {past}",
    ]
    if any(one.damage for one in played):
        lines.append(
            "damage: mean trust of the honest agents in the same games without the attack, minus that under the "
            "attack; an agent that has left counts with its last trust"
        )
    if unrated := [one.model for one in played if not one.game.model.rates_raters]:
        lines.append(f"no trust in raters: {', '.join(unrated)}: false alarms and recovery are of providers only")
    measured = [(one.model, name, estimate) for one in played for name, estimate in one.metrics.items()]
    shown = {name.partition(",")[0] for _, name, estimate in measured if not np.isnan(estimate.mean)}
    lines += [explained for name, explained in _EXPLAINED.items() if name in shown]
    undefined: dict[str, list[str]] = {}
    for model, name, estimate in measured:
        if estimate.why:
            undefined.setdefault(f"{name}: undefined: {estimate.why}", []).append(model)
    lines += [f"{why} ({', '.join(models)})" if len(played) > 1 else why for why, models in undefined.items()]
    return lines


def _shown(estimate: Estimate) -> str:
    if np.isnan(estimate.mean):
        return "undefined" if estimate.why else "nobody present"
    half = estimate.half
    return f"{estimate.mean:.3f}" if np.isnan(half) else f"{estimate.mean:.3f}±{math.ceil(half * 1000) / 1000:.3f}"


def _plain(estimate: Estimate) -> dict[str, float | str | None]:
    """Return an estimate for JSON, which has no NaN."""
    mean, half = (None if np.isnan(value) else value for value in (estimate.mean, estimate.half))
    return {"mean": mean, "half_95": half, **({"why": estimate.why} if estimate.why else {})}
