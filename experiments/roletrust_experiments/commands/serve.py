"""`roletrust serve`: a trust model for programs in any language."""

import sys
from typing import Annotated

import typer

from roletrust_env.evaluation.specs import parse_named
from roletrust_env.trust.model import registry
from roletrust_env.trust.service import TrustService, http_server
from roletrust_experiments.commands.console import errors
from roletrust_experiments.commands.options import NAMED, OWN


def serve(
    model: Annotated[str, typer.Argument(metavar=NAMED, help="Trust model. " + OWN)],
    port: Annotated[
        int | None,
        typer.Option(min=0, max=65535, help="Port of an HTTP service, 0 for any; standard input if left out."),
    ] = None,
    host: Annotated[
        str, typer.Option(help="Address of the HTTP service; others than this machine reach it at 0.0.0.0 only.")
    ] = "127.0.0.1",
) -> None:
    r"""Answer [bold]ratings with trust[/], for programs in any language.

    The protocol is that of models outside: a line of JSON with the ratings of a round, and a line with the trust after
    it. So a system in another language can use a trust model of this package, and a model of another package can be
    measured in a process of its own, where it sees ratings and nothing else.

    [bold]Examples[/]

    [dim]# a game of two raters and one provider[/]
    [cyan]roletrust serve role-trust --port 8080[/]
    [cyan]curl localhost:8080 -d '{"game": 1, "round": 0, "raters": 2, "providers": 1, "ratings": \[]}'[/]
    [cyan]curl localhost:8080 -d '{"game": 1, "round": 1, "raters": 2, "providers": 1, "ratings": \[\[0, 0, 0.9]]}'[/]

    [dim]# a model in a process of its own[/]
    [cyan]roletrust benchmark --model 'exec:roletrust serve mypackage.mymodel:MyModel'[/]
    """
    service = TrustService(parse_named(registry, model))
    if port is None:
        for line in sys.stdin:
            if line.strip() and (answer := service.answer(line)) is not None:
                print(answer, flush=True)
        return
    with http_server(service, host, port) as server:
        errors.print(f"{model} answers at http://{host}:{server.server_port}; Ctrl-C ends it", soft_wrap=True)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            raise typer.Exit(130) from None
