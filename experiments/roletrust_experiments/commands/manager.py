"""The subcommands of `roletrust manager`."""

from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from roletrust_env.logs.models import make_log_model
from roletrust_experiments.commands.console import console, number_table, shown, tell
from roletrust_experiments.commands.extras import require, require_live
from roletrust_experiments.commands.group import command_group
from roletrust_experiments.commands.options import NAMED, OWN

_HERE = "roletrust_experiments.commands.manager"
_SHOWN = 10  # agents
Journal = Annotated[
    Path, typer.Argument(metavar="JOURNAL", help="Journal of a manager, or its store, a file.")
]


@command_group({"backup": f"{_HERE}:backup", "check": f"{_HERE}:check"}, add_completion=False)
def manager() -> None:
    """Care for the journal of a trust manager.

    [bold]Examples[/]

    [dim]# copy the store of a manager that runs[/]
    [cyan]roletrust manager backup trust.sqlite backup.sqlite[/]

    [dim]# check all signatures, and compute trust[/]
    [cyan]roletrust manager check backup.sqlite --model role-trust[/]
    """


def backup(
    journal: Journal, file: Annotated[Path, typer.Argument(metavar="FILE", help="New file.")]
) -> None:
    """Copy the [bold]journal of a manager[/], also while it runs.

    The copy has all that was acknowledged before the command. For a database of PostgreSQL use
    pg_dump.

    [bold]Examples[/]

    [cyan]roletrust manager backup trust.sqlite backup.sqlite[/]
    [cyan]roletrust manager backup team.jsonl backup.jsonl[/]
    """
    from roletrust_manager.journal.backup import back_up

    back_up(journal, file)
    tell(f"Copied {journal} to {file}")


def check(
    journal: Journal,
    model: Annotated[str, typer.Option(metavar=NAMED, help="Trust model. " + OWN)] = "role-trust",
    keys: Annotated[
        Path | None, typer.Option(help="Folder with public keys of agents; robots need it.")
    ] = None,
    every: Annotated[float, typer.Option(min=1, help="Length of a round, seconds.")] = 60.0,
    scale: Annotated[
        tuple[float, float], typer.Option(help="Worst and best rating.", metavar="WORST BEST")
    ] = (0.0, 1.0),
    same_agents: Annotated[
        bool,
        typer.Option(
            "--same-agents/--two-roles",
            help="Whether rater and provider of one name are one agent.",
        ),
    ] = True,
) -> None:
    """Check a [bold]journal[/]: each rating was signed by its rater, none was altered, and trust
    follows.

    The journal of robots has the trust after each round, which is computed anew and compared. A
    store has ratings, from which trust is computed with the model and the settings of the manager.
    No manager may use it: check a backup of one that runs.

    [bold]Examples[/]

    [cyan]roletrust manager check backup.sqlite --model role-trust --every 60[/]
    [cyan]roletrust manager check team.jsonl --keys keys[/]
    """
    from roletrust_manager.journal.backup import is_database

    if is_database(journal):
        require("roletrust manager check", "manager", "sqlalchemy", "jwt", "pyarrow")
        settings = {"every": every, "scale": scale, "same_agents": same_agents}
        _check_store(journal, model, settings, keys)
        return
    require_live()
    if keys is None:
        raise ValueError(f"{journal} is a journal of robots: --keys has the keys of its raters")
    from roletrust_manager.admission.keys import PublicKeys
    from roletrust_manager.dds.journal_check import check_journal

    found = check_journal(journal, PublicKeys(keys), make_log_model(model), tell)
    tell(f"{found.messages:,} messages in {found.rounds:,} rounds are signed, and trust follows")
    trust = dict(zip(found.team.providers, found.trust.top, strict=True))
    console.print(_trust_table(sorted(trust, key=lambda name: -trust[name]), trust))


def _check_store(path: Path, model: str, settings: dict[str, Any], keys: Path | None) -> None:
    from roletrust_manager.admission.keys import PublicKeys
    from roletrust_manager.http.requests import Settings
    from roletrust_manager.http.store_check import check_store
    from roletrust_manager.journal.sql import JournalStore

    known = {} if keys is None else PublicKeys(keys).by_name
    with closing(JournalStore(str(path))) as store:
        found = check_store(store, make_log_model(model), Settings(**settings), known)
    tell(f"{found.events:,} events are signed and complete; their root hash is {found.root.hex()}")
    ranking = found.rankings["ratee"]
    console.print(_trust_table(ranking.names, ranking.trust))


def _trust_table(names: Sequence[str], trust: Mapping[str, float]) -> Table:
    """Return the trust in some providers, the best first."""
    table = number_table(f"Trust in {len(names):,} providers", "", "rank", "trust")
    for place, name in enumerate(names[:_SHOWN]):
        table.add_row(shown(name), f"{place + 1:,}", f"{trust[name]:.4f}")
    return table
