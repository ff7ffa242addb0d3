"""`roletrust live view`: a team in the browser, while it runs."""

from typing import Annotated

import typer

from experiments.commands.console import console
from experiments.commands.extras import require
from experiments.commands.live.options import Network, Scenario, Speed, require_live
from roletrust_env import make_scenario


def view(
    port: Annotated[int, typer.Option(min=1024, max=65535, help="Of the page, on this machine only.")] = 5006,
    scenario: Scenario = "paper-3x3",
    speed: Speed = 1.0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Whether to open the page.")] = True,
    network: Network = False,
) -> None:
    """Watch a team [bold]in the browser[/]: trust, who is missing, what was refused and why, and what cameras see.

    The page can be reached from this machine only, and until Ctrl-C.

    [bold]Examples[/]

    [dim]# beside a demo in another terminal[/]
    [cyan]roletrust live view[/]
    """
    require_live()
    require("roletrust live view", "live", "bokeh")
    from tornado.ioloop import PeriodicCallback

    from experiments.plots.live_page import serve
    from roletrust_env.live.nodes.running import running
    from roletrust_env.live.nodes.watch import Watcher

    watcher = Watcher(network=network)
    with running() as on:
        server = serve(watcher, make_scenario(scenario).period_s / speed, port)
        console.print(f"http://localhost:{port}, until Ctrl-C", soft_wrap=True)
        if browser:
            server.io_loop.add_callback(server.show, "/")
        PeriodicCallback(lambda: None if on else server.io_loop.stop(), 100).start()
        server.io_loop.start()
    server.stop()
    watcher.close()
