"""`roletrust list`: the scenarios, trust models and attackers that there are."""

from collections.abc import Callable, Iterator, Mapping
from enum import StrEnum
from typing import Annotated, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from roletrust_experiments.commands.catalogue import (
    Entry,
    all_attackers,
    all_models,
    all_scenarios,
    unfit,
    where_searched,
)
from roletrust_experiments.commands.console import console, print_json


class Kind(StrEnum):
    """What can be listed."""

    SCENARIOS = "scenarios"
    MODELS = "models"
    ATTACKERS = "attackers"


def list_command(
    kind: Annotated[
        Kind | None, typer.Argument(help="What to list; everything if left out.", show_default=False)
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document, with all there is to know, and nothing else.")
    ] = False,
) -> None:
    """Show the [bold]scenarios, trust models and attackers[/] that can be played, also those of other packages.

    Of trust models it says what they take and what they are unfit for, of attackers also where searches look for
    the best values of their parameters.

    [bold]Examples[/]

    [dim]# everything[/]
    [cyan]roletrust list[/]

    [dim]# the attackers, with their parameters and the ranges on which they are searched[/]
    [cyan]roletrust list attackers[/]

    [dim]# for scripts: the models on which gradients are of use[/]
    [cyan]roletrust list models --json | jq '.models | map_values(select(.differentiable)) | keys'[/]
    """
    kinds = Kind if kind is None else [kind]
    if as_json:
        print_json({one.value: _KINDS[one][0]() for one in kinds})
        return
    for one in kinds:
        entries, table = _KINDS[one]
        console.print(table(entries()))
    if kind in (None, Kind.ATTACKERS):
        console.print(
            "[dim]victims: some of the honest providers; identities: from 1 to all that are in reserve; "
            "told: what a command knows of the game it plays[/]"
        )
    if kind is not Kind.SCENARIOS:
        console.print(
            "[dim]Your own: package.module:Class in place of a name, or an entry point (docs/guide/extend.md).[/]"
        )


def _scenario_table(entries: Mapping[str, Entry]) -> Table:
    table = _table("Scenarios", "agents", "rounds")
    for name, entry in _readable(entries, table):
        count: dict[str, int] = {}
        for group in entry["agents"]:
            count[group["role"]] = count.get(group["role"], 0) + group["count"]
        agents = ", ".join(f"{n} {role}" for role, n in count.items())
        tags = f"tags: {', '.join(entry['tags'])}"
        table.add_row(name, _described(entry, tags), agents, str(entry["max_cycles"]))
    return table


def _model_table(entries: Mapping[str, Entry]) -> Table:
    table = _table("Trust models", "parameters = defaults, allowed values")
    for name, entry in _readable(entries, table):
        origin = ", ".join(part for part in (entry["family"], entry["source"]) if part)
        lacks = [f"unfit: {'; '.join(unfit(entry))}"] if unfit(entry) else []
        lines = [
            f"{_given(key, parameter)}  [dim]{escape(parameter['allowed'])}[/]"
            for key, parameter in entry["parameters"].items()
        ]
        table.add_row(name, _described(entry, origin, *lacks), "\n".join(lines))
    return table


def _attacker_table(entries: Mapping[str, Entry]) -> Table:
    table = _table("Attackers", "parameters = defaults, where searched")
    for name, entry in _readable(entries, table):
        channels = [f"by {' and '.join(entry['channels'])}"] if entry["channels"] else []
        where = {key: where_searched(parameter) for key, parameter in entry["parameters"].items()}
        given = {key: _given(key, parameter) for key, parameter in entry["parameters"].items()}
        lines = [f"{given[key]}  [dim]{escape(said)}[/]" for key, said in where.items() if said]
        lines.append(", ".join(given[key] for key, said in where.items() if not said))
        table.add_row(name, _described(entry, *channels), "\n".join(line for line in lines if line))
    return table


def _readable(entries: Mapping[str, Entry], table: Table) -> Iterator[tuple[str, Entry]]:
    """The entries with something to tell; of one that cannot be loaded or read, its row says why."""
    for name, entry in entries.items():
        if "error" in entry:
            table.add_row(name, escape(entry["error"]))
        else:
            yield name, entry


def _described(entry: Entry, *more: str) -> str:
    """The description, and quietly below what else there is to say."""
    return "\n".join([escape(entry["description"]), *(f"[dim]{escape(line)}[/]" for line in more)])


def _given(name: str, parameter: Mapping[str, Any]) -> str:
    return escape(name if parameter["required"] else f"{name}={parameter['default']}")


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", title_style="bold", show_lines=True, box=SIMPLE_HEAD)
    table.pad_edge = False
    table.add_column("name", style="cyan", no_wrap=True)
    table.add_column("description", min_width=24)
    for column in columns:
        table.add_column(column, justify="right" if column == "rounds" else "left", overflow="fold")
    return table


_KINDS: dict[Kind, tuple[Callable[[], dict[str, Entry]], Callable[[Mapping[str, Entry]], Table]]] = {
    Kind.SCENARIOS: (all_scenarios, _scenario_table),
    Kind.MODELS: (all_models, _model_table),
    Kind.ATTACKERS: (all_attackers, _attacker_table),
}
