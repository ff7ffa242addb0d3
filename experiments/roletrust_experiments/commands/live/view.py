"""`roletrust live view`: a page that shows a running team in the browser."""

from typing import TYPE_CHECKING

from roletrust_env import make_scenario
from roletrust_experiments.commands.console import console, errors
from roletrust_experiments.commands.extras import require, require_live
from roletrust_experiments.commands.live.options import Browser, Keys, Network, Port, Scenario, Speed

if TYPE_CHECKING:
    from bokeh.server.server import Server


def view(
    port: Port = 5006,
    scenario: Scenario = "paper-3x3",
    keys: Keys = None,
    speed: Speed = 1.0,
    browser: Browser = True,
    network: Network = False,
) -> None:
    """Show a running team [bold]in the browser[/]: trust, missing raters, refused ratings and the cameras' pictures.

    With --keys, the page shows nothing that is not signed, and counts what it refuses. It can be opened on this machine
    only. It ends with Ctrl-C.

    [bold]Examples[/]

    [dim]# beside nodes in other terminals[/]
    [cyan]roletrust live view --keys keys[/]
    """
    require_view()
    from roletrust_env.live.team import Team
    from roletrust_experiments.view.page import run_view_server

    def ready(server: "Server") -> None:
        console.print(f"{address(port)}, until Ctrl-C", soft_wrap=True)
        if browser:
            server.io_loop.add_callback(server.show, "/")

    rules = make_scenario(scenario)
    if keys is None:
        errors.print("view: WITHOUT KEYS: everybody on this network can forge what the page shows", soft_wrap=True)
    run_view_server(
        port, rules.period_s / speed, team=Team.of(rules), keys=keys, speed=speed, network=network, ready=ready
    )


def require_view() -> None:
    """Check before the work that the packages of the page are installed."""
    require_live()
    require("roletrust live view", "live", "bokeh")


def address(port: int) -> str:
    """Return the address of the page."""
    return f"http://localhost:{port}"
