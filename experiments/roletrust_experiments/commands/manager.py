"""`roletrust manager`: a trust manager for agents, their tools, and checks of its journal."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from roletrust_experiments.commands.console import console, errors, number_table, shown, tell
from roletrust_experiments.commands.extras import require, require_robots
from roletrust_experiments.commands.group import command_group
from roletrust_experiments.commands.options import NAMED, OWN, keyword_option, parse_keywords

_HERE = "roletrust_experiments.commands.manager"
_PACKAGES = "cryptography", "jwt", "sqlalchemy", "pyarrow"
_SHOWN = 10  # agents
_TRUST = {
    "scale": "worst and best rating, by default [0, 1]",
    "same_agents": "false if rater and provider of one name are two agents",
}
_LIMITS = {
    "work": "zero bits of a newcomer's proof of work, from 0 to 64, by default 16",
    "quota": "ratings that an agent may send in a round, by default 1000",
    "newcomers": "agents that may register in a round, by default 100",
    "tolerance": "seconds between signing and the manager's clock, by default 60",
}
_SERVE = {**_TRUST, **_LIMITS}
_CHECK = {"every": "length of a round, seconds, by default 60", **_TRUST}

_MODEL_HELP = "Trust model. " + OWN
Journal = Annotated[
    Path, typer.Argument(metavar="JOURNAL", help="Journal of a manager, or its store, a file.")
]


@command_group(
    {name: f"{_HERE}:{name}" for name in ("serve", "mcp", "backup", "check")},
    add_completion=False,
)
def manager() -> None:
    """Run a [bold]trust manager[/] for agents, and check its journal.

    [bold]Examples[/]

    [dim]# a manager with rounds of an hour[/]
    [cyan]roletrust manager serve role-trust trust.sqlite --every 3600[/]

    [dim]# the tools of an agent[/]
    [cyan]roletrust manager mcp http://127.0.0.1:8000 --name ann --keys keys[/]
    """


def serve(
    model: Annotated[str, typer.Argument(metavar=NAMED, help=_MODEL_HELP)],
    store: Annotated[
        str,
        typer.Argument(metavar="STORE", help="Journal, a file of SQLite or postgresql://..."),
    ],
    host: Annotated[
        str, typer.Option(help="Address of the manager; other machines reach it at 0.0.0.0 only.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port, 0 for any.")] = 8000,
    every: Annotated[float, typer.Option(help="Length of a round, seconds.")] = 60.0,
    name: Annotated[
        str | None,
        typer.Option(
            help="Name of the manager, to which tokens are addressed; a new store makes one up."
        ),
    ] = None,
    settings: Annotated[list[str] | None, keyword_option("--set", _SERVE)] = None,
) -> None:
    """Be a [bold]trust manager[/]: agents register, report signed ratings, and ask which agents to
    trust.

    Acknowledged ratings are in the store, so you can restart it with another model or length of a
    round. /openapi.json describes its HTTP requests.

    [bold]Examples[/]

    [cyan]roletrust manager serve role-trust trust.sqlite --every 3600[/]

    [dim]# ratings from 1 to 5[/]
    [cyan]roletrust manager serve mean trust.sqlite --set 'scale=[1, 5]'[/]
    """
    require("roletrust manager serve", "manager", "fastapi", "uvicorn", *_PACKAGES)
    from roletrust_manager.http.requests import make_settings
    from roletrust_manager.http.serve import serve

    chosen = make_settings(every=every, **parse_keywords(settings, "--set", _SERVE))
    report = partial(tell, where=errors)
    serve(model, store, chosen, name=name, host=host, port=port, report=report)


def mcp(
    url: Annotated[
        str, typer.Argument(help="Address of the trust manager, such as http://127.0.0.1:8000.")
    ],
    name: Annotated[str, typer.Option(help="Name of the agent.")],
    keys: Annotated[
        Path, typer.Option(help="Folder with the agent's key, NAME.key; made if there is none.")
    ],
) -> None:
    """Give an agent [bold]tools to ask which agents to trust[/], and to rate others afterwards.

    The tools are register, ask, rate, list_agents and leave, by the Model Context Protocol (MCP) on
    standard input and output: an agent of any framework starts this command, and calls them.
    Ratings are signed with the agent's key, which no language model sees.

    [bold]Examples[/]

    [cyan]roletrust manager mcp http://127.0.0.1:8000 --name ann --keys keys[/]
    """
    require("roletrust manager mcp", "manager", "cryptography", "httpx2", "jwt", "mcp")
    from roletrust_manager.http.client import TrustClient
    from roletrust_manager.http.tools import make_tools

    with TrustClient(url, name, keys) as client:
        make_tools(client).run()


def backup(
    journal: Journal, file: Annotated[Path, typer.Argument(metavar="FILE", help="New file.")]
) -> None:
    """Copy the [bold]journal of a manager[/], also while it runs.

    The copy has everything that was acknowledged before the command. For a database of PostgreSQL
    use pg_dump.

    [bold]Examples[/]

    [cyan]roletrust manager backup trust.sqlite backup.sqlite[/]
    [cyan]roletrust manager backup team.journal backup.journal[/]
    """
    from roletrust_manager.journal.backup import back_up

    back_up(journal, file)
    tell(f"Copied {journal} to {file}")


def check(
    journal: Journal,
    model: Annotated[str, typer.Option(metavar=NAMED, help=_MODEL_HELP)] = "role-trust",
    keys: Annotated[
        Path | None, typer.Option(help="Folder with public keys of agents; robots need it.")
    ] = None,
    settings: Annotated[list[str] | None, keyword_option("--set", _CHECK)] = None,
) -> None:
    """Check a [bold]journal[/]: each rating was signed by its rater, none was altered, and trust
    follows.

    The journal of robots has the trust after each round, which is computed again and compared. A
    store has ratings, from which trust is computed with the model and the settings of the manager.
    No manager may use it: check a backup of one that runs.

    [bold]Examples[/]

    [cyan]roletrust manager check backup.sqlite --model role-trust --set every=3600[/]
    [cyan]roletrust manager check team.journal --keys keys[/]
    """
    from roletrust_env.logs.models import make_log_model
    from roletrust_manager.journal.backup import is_database

    given = parse_keywords(settings, "--set", _CHECK)
    if is_database(journal):
        require("roletrust manager check", "manager", *_PACKAGES)
        from roletrust_manager.admission.keys import PublicKeys
        from roletrust_manager.http.requests import make_settings
        from roletrust_manager.http.store_check import check_store

        known = {} if keys is None else PublicKeys(keys).by_name
        of_store = check_store(journal, make_log_model(model), make_settings(**given), known)
        tell(f"{of_store.events:,} events are signed; their root hash is {of_store.root.hex()}")
        trust = of_store.rankings["ratee"].trust
    else:
        require_robots()
        from roletrust_manager.admission.keys import PublicKeys
        from roletrust_manager.dds.journal_check import check_journal

        if keys is None:
            raise ValueError(f"{journal} is a journal of robots: --keys must have their keys")
        of_team = check_journal(journal, PublicKeys(keys), make_log_model(model), tell)
        tell(f"{of_team.messages:,} messages in {of_team.rounds:,} rounds are signed")
        trust = dict(zip(of_team.team.providers, of_team.trust.top, strict=True))
    table = number_table(f"Trust in {len(trust):,} providers", "", "rank", "trust")
    ranked = sorted(trust, key=lambda name: -trust[name])
    for rank, name in enumerate(ranked[:_SHOWN], 1):
        table.add_row(shown(name), f"{rank:,}", f"{trust[name]:.4f}")
    console.print(table)
