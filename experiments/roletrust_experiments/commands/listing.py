"""`roletrust list`: the available scenarios, trust models, attackers, learners and trained
attackers.
"""

from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from roletrust_env.errors import suggest
from roletrust_env.memory import check_memory
from roletrust_env.metrics.confidence import estimate
from roletrust_experiments.commands.catalogue import (
    Entry,
    all_attackers,
    all_learners,
    all_models,
    all_scenarios,
    all_trained,
    unfit,
    where_searched,
)
from roletrust_experiments.commands.console import (
    console,
    errors,
    plain_table,
    print_json,
    progress_bar,
    short,
    tell_left_out,
)
from roletrust_experiments.commands.extras import require


class Kind(StrEnum):
    """Kind of things to list."""

    SCENARIOS = "scenarios"
    MODELS = "models"
    ATTACKERS = "attackers"
    LEARNERS = "learners"
    ZOO = "zoo"


def list_command(
    kind: Annotated[
        Kind | None, typer.Argument(help="Kind of things to list; all kinds if left out.")
    ] = None,
    names: Annotated[
        list[str] | None, typer.Argument(help="Names of trained attackers; all if left out.")
    ] = None,
    folder: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of trained attackers; the project's own if left out."
        ),
    ] = None,
    games: Annotated[
        int | None,
        typer.Option(
            min=2,
            help="Number of games in which saved scores are tested; with exit code 1 if one fails.",
        ),
    ] = None,
    as_json: Annotated[
        bool,
        typer.Option("--json", help="Print one JSON document with all details, and nothing else."),
    ] = False,
) -> None:
    """List the [bold]scenarios, trust models, attackers and learners[/], including those of other
    packages.

    Without a kind it shows the names. For trust models, the list shows parameters and limitations.
    For attackers, it shows parameters and the ranges in which searches look for their best values.
    The [bold]zoo[/] are trained attackers: their tasks, and their scores, the mean reward per round
    with its 95% confidence interval, beside that of honest play.

    [bold]Examples[/]

    [dim]# all names[/]
    [cyan]roletrust list[/]

    [dim]# the attackers, with their parameters and the ranges of searches[/]
    [cyan]roletrust list attackers[/]

    [dim]# the trained attackers that come with the project, and your own, with their scores
    measured again[/]
    [cyan]roletrust list zoo[/]
    [cyan]roletrust list zoo --folder results/train --games 256[/]

    [dim]# for scripts: the models with useful gradients[/]
    [cyan]roletrust list models
    --json | jq '.models | map_values(select(.differentiable)) | keys'[/]
    """
    if kind is not Kind.ZOO and (names or folder or games):
        raise ValueError(
            "names, --folder and --games are for trained attackers: roletrust list zoo"
        )
    asked = [
        listed_kind
        for listed_kind in Kind
        if kind in (None, listed_kind) and listed_kind is not Kind.ZOO
    ]
    by_kind: dict[Kind, dict[str, Entry]] = {
        listed_kind: _KINDS[listed_kind][0]() for listed_kind in asked
    }
    if kind is Kind.ZOO:
        require("a trained attacker", "train", "safetensors")
    if kind is Kind.ZOO or (kind is None and find_spec("safetensors")):
        by_kind[Kind.ZOO] = _trained(folder, names or [])
    holds = games is None or _measure_again(by_kind[Kind.ZOO], folder, games)
    if as_json:
        print_json({listed_kind.value: entries for listed_kind, entries in by_kind.items()})
    elif kind is None:
        _print_names(by_kind)
    else:
        _print(by_kind[kind], kind)
    if not holds:
        raise typer.Exit(1)


def _trained(folder: Path | None, names: Sequence[str]) -> dict[str, Entry]:
    """Return the trained attackers of a folder, or those with some names.

    Raises:
        ValueError: There is none, or none with such a name.
    """
    known = all_trained(folder)
    if not known:
        raise ValueError(
            f"there is no attacker in {folder}; one is a .json and a .safetensors file of one name"
        )
    for name in names:
        if name not in known:
            raise ValueError(f"there is no trained attacker {name!r}{suggest(name, known)}")
    return {name: known[name] for name in names or known}


def _measure_again(entries: dict[str, Entry], folder: Path | None, games: int) -> bool:
    """Add the scores of trained attackers, measured again in their own tasks.

    Returns:
        Whether each attacker was read, and has the score that was saved.
    """
    from roletrust_agents.learned.coalition_attacker import attacker_for
    from roletrust_agents.learned.policy import play_task
    from roletrust_agents.learned.saved import ZOO, load_attacker
    from roletrust_env.evaluation.measurement import task_memory

    attackers = {
        name: load_attacker((folder or ZOO) / name)
        for name, entry in entries.items()
        if "error" not in entry
    }
    for attacker in attackers.values():
        mind = attacker_for(attacker.network, attacker.card.task.knowledge)
        check_memory("--games", games, task_memory(attacker.task(), mind))
    with progress_bar(errors) as progress:
        for name, attacker in progress.track(attackers.items(), description="Playing"):
            saved = entries[name]["score"]
            measured = estimate(play_task(attacker.task(), attacker.network, games=games, seed=0))
            # Two equal means seldom have separate intervals; rounding differs between machines.
            holds = abs(measured.mean - saved["mean"]) <= measured.half + saved["half_95"] + 1e-4
            entries[name]["measured"] = {
                "mean": float(measured.mean),
                "half_95": float(measured.half),
                "holds": holds,
            }
    return all(entry.get("measured", {}).get("holds", False) for entry in entries.values())


def _print_names(by_kind: Mapping[Kind, dict[str, Entry]]) -> None:
    """Print the names of each kind, and why an entry cannot be read."""
    for kind, entries in by_kind.items():
        names = "trained attackers" if kind is Kind.ZOO else escape(", ".join(entries))
        console.print(f"[bold]{kind.value}[/] ({len(entries)}): [cyan]{names}[/]")
        for name, entry in entries.items():
            if "error" in entry:
                tell_left_out(f"{name}: {entry['error']}")
    if Kind.ZOO not in by_kind:
        console.print(
            "[dim]Trained attackers need safetensors: pip install 'roletrust-env\\[train]'[/]"
        )
    console.print("[dim]What they are: roletrust list models, and so for each kind.[/]")


def _print(entries: Mapping[str, Entry], kind: Kind) -> None:
    """Print the table of a kind, and what its words mean."""
    console.print(_table(entries, kind))
    if kind not in (Kind.SCENARIOS, Kind.ZOO):
        console.print(
            "[dim]Your own: package.module:Class in place of a name, or an entry point "
            "(docs/guide/extend.md).[/]"
        )


def _table(entries: Mapping[str, Entry], kind: Kind) -> Table:
    """Return the table of a kind; an entry that cannot be read has the reason."""
    _, title, columns, row = _KINDS[kind]
    if any("measured" in entry for entry in entries.values()):
        columns = ("score", "honest", "measured", "holds")
    table = plain_table(title)
    table.show_lines = True
    table.add_column("name", style="cyan", no_wrap=True)
    for column in columns:
        table.add_column(column, justify="right" if column in _NUMBERS else "left", overflow="fold")
    for name, entry in entries.items():
        table.add_row(escape(name), *([escape(entry["error"])] if "error" in entry else row(entry)))
    return table


def _scenario(entry: Entry) -> tuple[str, ...]:
    count: dict[str, int] = {}
    for group in entry["agents"]:
        count[group["role"]] = count.get(group["role"], 0) + group["count"]
    agents = ", ".join(f"{n} {role}" for role, n in count.items())
    return _described(entry, f"tags: {', '.join(entry['tags'])}"), agents, str(entry["max_cycles"])


def _model(entry: Entry) -> tuple[str, ...]:
    origin = ", ".join(part for part in (entry["family"], entry["source"]) if part)
    lacks = [f"unfit: {'; '.join(unfit(entry))}"] if unfit(entry) else []
    lines = [
        f"{_given(key, parameter)}  [dim]{escape(parameter['allowed'])}[/]"
        for key, parameter in entry["parameters"].items()
    ]
    return _described(entry, origin, *lacks), "\n".join(lines)


def _attacker(entry: Entry) -> tuple[str, ...]:
    channels = [f"by {' and '.join(entry['channels'])}"] if entry["channels"] else []
    where = {
        _given(key, parameter): where_searched(parameter)
        for key, parameter in entry["parameters"].items()
    }
    lines = [f"{given}  [dim]{escape(range)}[/]" for given, range in where.items() if range]
    lines.append(", ".join(given for given, range in where.items() if not range))
    return _described(entry, *channels), "\n".join(line for line in lines if line)


def _learner(entry: Entry) -> tuple[str, ...]:
    return _described(entry), "\n".join(
        _given(key, parameter) for key, parameter in entry["parameters"].items()
    )


def _trained_attacker(entry: Entry) -> tuple[str, ...]:
    texts = _score(entry["score"]), short(f"{entry['score']['honest']:.4f}")
    if measured := entry.get("measured"):
        return *texts, _score(measured), "yes" if measured["holds"] else "[red]no[/]"
    return _described(entry), *texts


def _score(score: Mapping[str, float]) -> str:
    return short(f"{score['mean']:.4f} ± {score['half_95']:.4f}")


def _described(entry: Entry, *more: str) -> str:
    """Return the description, with further lines dimmed below it."""
    return "\n".join([escape(entry["description"]), *(f"[dim]{escape(line)}[/]" for line in more)])


def _given(name: str, parameter: Mapping[str, Any]) -> str:
    return escape(name if parameter["required"] else f"{name}={parameter['default']}")


_NUMBERS = ("rounds", "honest", "score", "measured")
_KINDS: dict[
    Kind,
    tuple[Callable[[], dict[str, Entry]], str, tuple[str, ...], Callable[[Entry], tuple[str, ...]]],
] = {
    Kind.SCENARIOS: (all_scenarios, "Scenarios", ("description", "agents", "rounds"), _scenario),
    Kind.MODELS: (
        all_models,
        "Trust models",
        ("description", "parameters = defaults, allowed values"),
        _model,
    ),
    Kind.ATTACKERS: (
        all_attackers,
        "Attackers",
        ("description", "parameters = defaults, where searched"),
        _attacker,
    ),
    Kind.LEARNERS: (all_learners, "Learners", ("description", "parameters = defaults"), _learner),
    Kind.ZOO: (
        all_trained,
        "Trained attackers",
        ("description", "score", "honest"),
        _trained_attacker,
    ),
}
"""Of each kind its entries, the title and the columns of its table, and the row of an entry."""
