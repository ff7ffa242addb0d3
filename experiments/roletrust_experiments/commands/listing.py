"""`roletrust list`: the available scenarios, trust models, attackers and learners."""

from collections.abc import Callable, Iterator, Mapping
from enum import StrEnum
from typing import Annotated, Any

import typer
from rich.markup import escape

from roletrust_experiments.commands.catalogue import (
    Entry,
    all_attackers,
    all_learners,
    all_models,
    all_scenarios,
    unfit,
    where_searched,
)
from roletrust_experiments.commands.console import FittedTable, console, print_json, print_next


class Kind(StrEnum):
    """Kind of things to list."""

    SCENARIOS = "scenarios"
    MODELS = "models"
    ATTACKERS = "attackers"
    LEARNERS = "learners"


def list_command(
    kind: Annotated[
        Kind | None, typer.Argument(help="Kind of things to list; all kinds if left out.", show_default=False)
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document with all details, and nothing else.")
    ] = False,
) -> None:
    """List the [bold]scenarios, trust models, attackers and learners[/], including those of other packages.

    For trust models, the list shows parameters and limitations. For attackers, it shows parameters and the ranges in
    which searches look for their best values.

    [bold]Examples[/]

    [dim]# everything[/]
    [cyan]roletrust list[/]

    [dim]# the attackers, with their parameters and the ranges of searches[/]
    [cyan]roletrust list attackers[/]

    [dim]# for scripts: the models with useful gradients[/]
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
            "[dim]victims: some of the honest providers; identities: from 1 to all identities in reserve; "
            "given: set by the command, from the game[/]"
        )
    if kind is not Kind.SCENARIOS:
        console.print(
            "[dim]Your own: package.module:Class in place of a name, or an entry point (docs/guide/extend.md).[/]"
        )
    print_next(*_NEXT.get(kind, _NEXT[None]))


def _scenario_table(entries: Mapping[str, Entry]) -> FittedTable:
    table = _table("Scenarios", "agents", "rounds")
    for name, entry in _readable(entries, table):
        count: dict[str, int] = {}
        for group in entry["agents"]:
            count[group["role"]] = count.get(group["role"], 0) + group["count"]
        agents = ", ".join(f"{n} {role}" for role, n in count.items())
        tags = f"tags: {', '.join(entry['tags'])}"
        table.add_row(name, _described(entry, tags), agents, str(entry["max_cycles"]))
    return table


def _model_table(entries: Mapping[str, Entry]) -> FittedTable:
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


def _attacker_table(entries: Mapping[str, Entry]) -> FittedTable:
    table = _table("Attackers", "parameters = defaults, where searched")
    for name, entry in _readable(entries, table):
        channels = [f"by {' and '.join(entry['channels'])}"] if entry["channels"] else []
        where = {key: where_searched(parameter) for key, parameter in entry["parameters"].items()}
        given = {key: _given(key, parameter) for key, parameter in entry["parameters"].items()}
        lines = [f"{given[key]}  [dim]{escape(range)}[/]" for key, range in where.items() if range]
        lines.append(", ".join(given[key] for key, range in where.items() if not range))
        table.add_row(name, _described(entry, *channels), "\n".join(line for line in lines if line))
    return table


def _learner_table(entries: Mapping[str, Entry]) -> FittedTable:
    table = _table("Learners", "parameters = defaults")
    for name, entry in _readable(entries, table):
        lines = [_given(key, parameter) for key, parameter in entry["parameters"].items()]
        table.add_row(name, _described(entry), "\n".join(lines))
    return table


def _readable(entries: Mapping[str, Entry], table: FittedTable) -> Iterator[tuple[str, Entry]]:
    """Yield the entries that can be read; add a row with the reason for each other entry."""
    for name, entry in entries.items():
        if "error" in entry:
            table.add_row(escape(name), escape(entry["error"]))
        else:
            yield escape(name), entry


def _described(entry: Entry, *more: str) -> str:
    """Return the description, with further lines dimmed below it."""
    return "\n".join([escape(entry["description"]), *(f"[dim]{escape(line)}[/]" for line in more)])


def _given(name: str, parameter: Mapping[str, Any]) -> str:
    return escape(name if parameter["required"] else f"{name}={parameter['default']}")


def _table(title: str, *columns: str) -> FittedTable:
    table = FittedTable(title, needed=2 + len(columns))
    table.show_lines = True
    table.column("name", style="cyan")
    table.column("description")
    for column in columns:
        table.column(column, "right" if column == "rounds" else "left")
    return table


_NEXT: dict[Kind | None, tuple[str, ...]] = {
    Kind.SCENARIOS: ("play", "crowd-10x10"),
    Kind.MODELS: ("play", "--model", "beta", "--attack", "sr_2=bad-mouthing"),
    Kind.LEARNERS: ("benchmark", "--suite", "learners-quick", "--learner", "PPO"),
    None: ("play", "--attack", "sr_2=bad-mouthing"),
}

_KINDS: dict[Kind, tuple[Callable[[], dict[str, Entry]], Callable[[Mapping[str, Entry]], FittedTable]]] = {
    Kind.SCENARIOS: (all_scenarios, _scenario_table),
    Kind.MODELS: (all_models, _model_table),
    Kind.ATTACKERS: (all_attackers, _attacker_table),
    Kind.LEARNERS: (all_learners, _learner_table),
}
