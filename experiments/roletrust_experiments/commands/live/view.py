"""`roletrust live view`: a page that shows a running team in the browser."""

import webbrowser

from roletrust_env import make_scenario
from roletrust_experiments.commands.console import errors, tell
from roletrust_experiments.commands.extras import require, require_live
from roletrust_experiments.commands.live.options import (
    Browser,
    Keys,
    Network,
    Port,
    Scenario,
    Speed,
)


def view(
    port: Port = 5006,
    scenario: Scenario = "paper-3x3",
    keys: Keys = None,
    speed: Speed = 1.0,
    browser: Browser = True,
    network: Network = False,
) -> None:
    """Show a running team [bold]in the browser[/]: trust, missing raters, refused ratings and the
    cameras' pictures.

    With --keys, the page shows nothing that is not signed, and counts what it refuses. It can be
    opened on this machine only. It ends with Ctrl-C.

    [bold]Examples[/]

    [dim]# beside nodes in other terminals[/]
    [cyan]roletrust live view --keys keys[/]
    """
    require_view()
    if keys is None:
        tell(
            "view: WITHOUT KEYS: everybody on this network can forge what the page shows",
            where=errors,
        )
    rules = make_scenario(scenario)
    from roletrust_manager.page.waiting import WaitingPage

    with WaitingPage(port) as page:
        tell(f"{address(port)}, until Ctrl-C")
        if browser:
            webbrowser.open(address(port))
        from roletrust_manager.page.page import run_view_server
        from roletrust_manager.team import Team

        run_view_server(
            page.listening,
            rules.period_s / speed,
            team=Team.of(rules),
            keys=keys,
            speed=speed,
            network=network,
            take=page.leave,
        )


def require_view() -> None:
    """Check before the work that the packages of the page are installed."""
    require_live()
    require("roletrust live view", "robots", "bokeh")


def address(port: int) -> str:
    """Return the address of the page."""
    return f"http://localhost:{port}"
