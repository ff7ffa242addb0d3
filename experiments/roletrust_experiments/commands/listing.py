"""`roletrust list`: the available scenarios, trust models, attackers, learners and trained
attackers.
"""

from collections.abc import Mapping
from importlib.util import find_spec
from typing import Annotated, Any, Literal

import typer
from rich.markup import escape
from rich.table import Table

from roletrust_env.benchmarking.learners.learner import registry as learners
from roletrust_env.evaluation.search import search_methods
from roletrust_experiments.catalogue import CATALOGUE, Entry, unfit, where_searched
from roletrust_experiments.commands.console import (
    console,
    plain_table,
    print_json,
    short,
    tell_left_out,
)
from roletrust_experiments.commands.extras import require

Kind = Literal["scenarios", "models", "attackers", "learners", "zoo"]


def list_command(
    kind: Annotated[
        Kind | None, typer.Argument(help="Kind of things to list; the names of all if left out.")
    ] = None,
    as_json: Annotated[
        bool,
        typer.Option("--json", help="Print one JSON document with all details, and nothing else."),
    ] = False,
) -> None:
    """List the [bold]scenarios, trust models, attackers and learners[/], including those of other
    packages.

    For trust models, the list shows parameters and limitations. For attackers, it shows parameters
    and the ranges in which searches look for their best values. The [bold]zoo[/] are trained
    attackers: their tasks, and their scores, the mean reward per round with its 95% confidence
    interval, beside that of honest play.

    [bold]Examples[/]

    [dim]# all names; the attackers with their parameters[/]
    [cyan]roletrust list[/]
    [cyan]roletrust list attackers[/]

    [dim]# for scripts: the models with useful gradients[/]
    [cyan]roletrust list models
    --json | jq '.models | map_values(select(.differentiable)) | keys'[/]
    """
    if kind in ("learners", "zoo"):
        require(f"roletrust list {kind}", "train", "safetensors", "stable_baselines3")
    kinds = [each for each in CATALOGUE if each != "zoo" or find_spec("safetensors")]
    if kind:
        kinds = [kind]
    if as_json:
        print_json({each: CATALOGUE[each]() for each in kinds})
    elif kind:
        console.print(_table(CATALOGUE[kind](), kind))
    else:
        _print_names(kinds)


def _print_names(kinds: list[str]) -> None:
    """Print the names of each kind, and why an entry cannot be read."""
    for kind in kinds:
        entries: Mapping[str, Entry] = (
            {name: {} for name in [*search_methods.names(), *learners.names()]}  # which import much
            if kind == "learners"
            else CATALOGUE[kind]()
        )
        names = "trained attackers" if kind == "zoo" else escape(", ".join(entries))
        console.print(f"[bold]{kind}[/] ({len(entries)}): [cyan]{names}[/]")
        for name, entry in entries.items():
            if "error" in entry:
                tell_left_out(f"{name}: {entry['error']}")
    console.print("[dim]What they are: roletrust list models, and so for each kind.[/]")


def _table(entries: Mapping[str, Entry], kind: Kind) -> Table:
    """Return the table of a kind; an entry that cannot be read has the reason."""
    table = plain_table(kind.capitalize())
    table.show_lines = True
    table.add_column("name", style="cyan", no_wrap=True)
    for column in ("description", _DETAILS[kind]):
        table.add_column(column, overflow="fold")
    for name, entry in entries.items():
        if "error" in entry:
            table.add_row(escape(name), escape(entry["error"]))
            continue
        more, details = _described(entry, kind)
        lines = [escape(entry["description"]), *(f"[dim]{escape(line)}[/]" for line in more)]
        table.add_row(escape(name), "\n".join(lines), "\n".join(details))
    return table


_DETAILS: dict[Kind, str] = {
    "scenarios": "agents",
    "models": "parameters = defaults, allowed values",
    "attackers": "parameters = defaults, where searched",
    "learners": "parameters = defaults",
    "zoo": "score",
}


def _described(entry: Entry, kind: Kind) -> tuple[list[str], list[str]]:
    """Return further lines of the description, and the details."""
    if kind == "scenarios":
        count: dict[str, int] = {}
        for group in entry["agents"]:
            count[group["role"]] = count.get(group["role"], 0) + group["count"]
        details = [*(f"{n} {role}" for role, n in count.items()), f"{entry['max_cycles']} rounds"]
        return [f"tags: {', '.join(entry['tags'])}"], details
    if kind == "zoo":
        mean, half, honest = (entry["score"][key] for key in ("mean", "half_95", "honest"))
        return [], [short(f"{mean:.4f} ± {half:.4f}"), short(f"honest play {honest:.4f}")]
    parameters = {_given(key, one): one for key, one in entry["parameters"].items()}
    if kind == "models":
        origin = ", ".join(part for part in (entry["family"], entry["source"]) if part)
        limits = [f"unfit: {'; '.join(unfit(entry))}"] if unfit(entry) else []
        allowed = [f"{name}  [dim]{escape(one['allowed'])}[/]" for name, one in parameters.items()]
        return [origin, *limits], allowed
    if kind == "learners":
        known = ["starts from known attackers"] if entry["known_start"] else []
        return [f"knowledge: {entry['knowledge']}", *known], list(parameters)
    where = {name: where_searched(one) for name, one in parameters.items()}
    searched = [f"{name}  [dim]{escape(range)}[/]" for name, range in where.items() if range]
    others = ", ".join(name for name, range in where.items() if not range)
    channels = [f"by {' and '.join(entry['channels'])}"] if entry["channels"] else []
    return channels, [*searched, others] if others else searched


def _given(name: str, parameter: Mapping[str, Any]) -> str:
    return escape(name if parameter["required"] else f"{name}={parameter['default']}")
