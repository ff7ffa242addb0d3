"""`roletrust serve`: a trust model for programs in any language, and a trust manager for agents."""

import gc
import signal
import socket
import sys
from contextlib import closing
from functools import partial
from typing import Annotated, Any

import typer

from roletrust_env.logs.models import make_log_model
from roletrust_env.trust.service import TrustService, http_server
from roletrust_experiments.commands.console import errors, tell
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.options import NAMED, OWN, given_options

_END_S = 2  # for answers that are on their way when the manager ends
_SWITCH_S = 5e-4  # for which one thread may keep the others waiting
_PANEL = "Manager of agents"
_manager = partial(typer.Option, rich_help_panel=_PANEL)


def serve(
    context: typer.Context,
    model: Annotated[str, typer.Argument(metavar=NAMED, help="Trust model. " + OWN)],
    port: Annotated[
        int | None,
        typer.Option(
            min=0, max=65535, help="Port, 0 for any; standard input if left out, with --store 8000."
        ),
    ] = None,
    host: Annotated[
        str,
        typer.Option(
            help="Address of the service; others than this machine reach it at 0.0.0.0 only."
        ),
    ] = "127.0.0.1",
    store: Annotated[
        str | None,
        _manager(
            metavar="FILE|URL",
            help="Be a manager: its journal, a file of SQLite or postgresql://...",
        ),
    ] = None,
    name: Annotated[
        str | None,
        _manager(
            help="Name of the manager, to which tokens are addressed; a new store makes one up."
        ),
    ] = None,
    every: Annotated[float, _manager(min=1, help="Length of a round, seconds.")] = 60.0,
    scale: Annotated[
        tuple[float, float], _manager(help="Worst and best rating.", metavar="WORST BEST")
    ] = (0.0, 1.0),
    same_agents: Annotated[
        bool,
        _manager(
            "--same-agents/--two-roles",
            help="Whether rater and provider of one name are one agent.",
        ),
    ] = True,
    work: Annotated[
        int, _manager(min=0, max=64, help="Zero bits of a newcomer's proof of work.")
    ] = 16,
    quota: Annotated[
        int, _manager(min=1, help="Number of ratings that an agent may send in a round.")
    ] = 1000,
    newcomers: Annotated[
        int, _manager(min=0, help="Number of agents that may register in a round.")
    ] = 100,
    tolerance: Annotated[
        float, _manager(min=0, help="Seconds between signing and the manager's clock.")
    ] = 60.0,
) -> None:
    r"""Answer [bold]ratings with trust[/], for programs in any language; with --store, [bold]for
    agents[/].

    The protocol is that of models outside: a line of JSON with the ratings of a round, and a line
    with the trust after it. So a system in another language can use a trust model of this package,
    and a model of another package can be measured in a process of its own, where it sees ratings
    and nothing else.

    With --store it is a trust manager: agents register, report signed ratings, and ask whom to
    trust. What it has acknowledged is in the store, and another model or length of a round is
    another start. /openapi.json has its HTTP.

    [bold]Examples[/]

    [dim]# a game of two raters and one provider[/]
    [cyan]roletrust serve role-trust --port 8080[/]
    [cyan]curl localhost:8080 -d
    '{"game": 1, "round": 0, "raters": 2, "providers": 1, "ratings": \[]}'[/]
    [cyan]curl localhost:8080 -d
    '{"game": 1, "round": 1, "raters": 2, "providers": 1, "ratings": \[\[0, 0, 0.9]]}'[/]

    [dim]# a model in a process of its own[/]
    [cyan]roletrust benchmark --model 'exec:roletrust serve mypackage.mymodel:MyModel'[/]

    [dim]# a manager of agents, with rounds of an hour[/]
    [cyan]roletrust serve role-trust --store trust.sqlite --every 3600[/]
    """
    if store is not None:
        settings = (every, scale, same_agents, work, quota, newcomers, tolerance)
        _manage(model, store, name, settings, host, 8000 if port is None else port)
        return
    of_manager = {
        parameter.opts[0]
        for parameter in context.command.params
        if getattr(parameter, "rich_help_panel", None) == _PANEL
    }
    if wrong := [name for name in given_options(context) if name in of_manager]:
        raise ValueError(f"{', '.join(wrong)}: only a trust manager has that; --store makes one")
    service = TrustService(make_log_model(model))
    if port is None:
        for line in sys.stdin or ():  # None where it is closed
            if line.strip() and (answer := service.answer(line)) is not None:
                print(answer, flush=True)
        return
    with http_server(service, host, port) as server:
        tell(f"{model} answers at http://{host}:{server.server_port}; Ctrl-C ends it", where=errors)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            raise typer.Exit(130) from None


def _manage(
    model: str,
    store: str,
    name: str | None,
    settings: tuple[Any, ...],
    host: str,
    port: int,
) -> None:
    """Be a trust manager, until a signal ends it."""
    require(
        "roletrust serve --store",
        "manager",
        "fastapi",
        "uvicorn",
        "sqlalchemy",
        "jwt",
        "cryptography",
        "pyarrow",
    )
    import uvicorn

    from roletrust_manager.admission.validation import RefusalReason
    from roletrust_manager.http.connections import limited_protocol
    from roletrust_manager.http.endpoints import make_app
    from roletrust_manager.http.manager import TrustManager
    from roletrust_manager.http.requests import Settings
    from roletrust_manager.journal.sql import JournalStore

    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))  # after the store is closed
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    journal = JournalStore(store, name)
    try:
        with (
            closing(journal),
            socket.create_server((host, port), family=family, backlog=1024) as listener,
            closing(
                TrustManager(journal, model, Settings(*settings), make=make_log_model)
            ) as manager,
        ):
            app = make_app(manager)
            url = f"http://{f'[{host}]' if ':' in host else host}:{listener.getsockname()[1]}"
            about = manager.about()
            kept = f"{about['agents']:,} agents and {about['ratings']:,} ratings"
            tell(
                f"{manager.name} answers with {model} at {url}, with {kept}; Ctrl-C ends it",
                where=errors,
            )
            sys.setswitchinterval(_SWITCH_S)
            gc.freeze()  # else each full collection looks at all modules, and all requests wait
            config = uvicorn.Config(
                app,
                http=limited_protocol(
                    lambda: manager.admission.refuse("", RefusalReason.TOO_LARGE)
                ),
                log_level="error",  # strangers must not fill the log
                access_log=False,
                timeout_graceful_shutdown=_END_S,
            )
            uvicorn.Server(config).run(sockets=[listener])
    except KeyboardInterrupt:
        raise typer.Exit(130) from None
