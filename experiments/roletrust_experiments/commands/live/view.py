"""`roletrust live view`: a team in the browser, while it runs."""

from typing import TYPE_CHECKING

from roletrust_env import make_scenario
from roletrust_experiments.commands.console import console
from roletrust_experiments.commands.extras import require
from roletrust_experiments.commands.live.options import Browser, Network, Port, Scenario, Speed, require_live

if TYPE_CHECKING:
    from bokeh.server.server import Server


def view(
    port: Port = 5006,
    scenario: Scenario = "paper-3x3",
    speed: Speed = 1.0,
    browser: Browser = True,
    network: Network = False,
) -> None:
    """Watch a team [bold]in the browser[/]: trust, who is missing, what was refused and why, and what cameras see.

    The page can be reached from this machine only, and until Ctrl-C.

    [bold]Examples[/]

    [dim]# beside nodes in other terminals[/]
    [cyan]roletrust live view[/]
    """
    require_view()
    from roletrust_experiments.view.server import run_view

    def ready(server: "Server") -> None:
        console.print(f"{address(port)}, until Ctrl-C", soft_wrap=True)
        if browser:
            server.io_loop.add_callback(server.show, "/")

    run_view(port, make_scenario(scenario).period_s / speed, speed=speed, network=network, ready=ready)


def require_view() -> None:
    """See before the work whether all is there that the page needs."""
    require_live()
    require("roletrust live view", "live", "bokeh")


def address(port: int) -> str:
    """Where the page is."""
    return f"http://localhost:{port}"
