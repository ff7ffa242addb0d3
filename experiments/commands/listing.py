"""`roletrust list`: the scenarios, trust models and attackers that there are."""

import inspect
from enum import StrEnum
from typing import Annotated, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

import baselines
from experiments.commands.console import console
from roletrust_env.trust.model import registry as models
from roletrust_env.world.presets import registry as scenarios


class Kind(StrEnum):
    """What can be listed."""

    SCENARIOS = "scenarios"
    MODELS = "models"
    ATTACKERS = "attackers"


def list_command(
    kind: Annotated[
        Kind | None, typer.Argument(help="What to list; everything if left out.", show_default=False)
    ] = None,
) -> None:
    """Show the [bold]scenarios, trust models and attackers[/] that can be played, also those of other packages.

    [bold]Examples[/]

    [dim]# everything[/]
    [cyan]roletrust list[/]

    [dim]# the attackers, with their parameters and defaults[/]
    [cyan]roletrust list attackers[/]
    """
    if kind in (None, Kind.SCENARIOS):
        console.print(_scenarios())
    if kind in (None, Kind.MODELS):
        console.print(_with_parameters("Trust models", models))
    if kind in (None, Kind.ATTACKERS):
        console.print(_with_parameters("Attackers", baselines.registry))
    if kind is not Kind.SCENARIOS:
        console.print("[dim]Your own: package.module:Class in place of a name, or an entry point (see the README).[/]")


def _scenarios() -> Table:
    table = _table("Scenarios")
    table.add_column("agents")
    table.add_column("rounds", justify="right")
    for name in scenarios.names():
        try:
            scenario = scenarios.make(name)
        except ValueError as error:
            table.add_row(name, escape(str(error)), "", "")
            continue
        count: dict[str, int] = {}
        for group in scenario.agents:
            count[group.role] = count.get(group.role, 0) + group.count
        agents = ", ".join(f"{n} {role}" for role, n in count.items())
        tags = f"[dim]tags: {escape(', '.join(scenario.tags))}[/]"
        table.add_row(name, f"{escape(scenario.description)}\n{tags}", agents, str(scenario.max_cycles))
    return table


def _with_parameters(title: str, registry: Any) -> Table:
    table = _table(title)
    table.add_column("parameters = defaults")
    for name, description in registry.describe().items():
        table.add_row(name, escape(description), escape(_parameters(registry, name)))
    return table


def _parameters(registry: Any, name: str) -> str:
    """The parameters of a factory; a plug-in that cannot be loaded says so and spoils nothing else."""
    try:
        parameters = inspect.signature(registry.factory(name)).parameters.values()
    except ValueError as error:
        return str(error)
    return ", ".join(p.name if p.default is p.empty else f"{p.name}={p.default!r}" for p in parameters)


def _table(title: str) -> Table:
    table = Table(title=title, title_justify="left", title_style="bold", show_lines=True, box=SIMPLE_HEAD)
    table.add_column("name", style="cyan", no_wrap=True)
    table.add_column("description", min_width=24)
    return table
