"""The page of a running team."""

from pathlib import Path

from roletrust_env import make_scenario
from roletrust_manager.dds.nodes.run_loop import SECOND, print_line, round_period
from roletrust_manager.page.browser import open_page
from roletrust_manager.page.page import run_view_server
from roletrust_manager.team import Team


def run_view(
    *,
    keys: Path | None = None,
    scenario: str = "paper-3x3",
    speed: float = 1.0,
    network: bool = False,
    port: int = 5006,
) -> None:
    """Show a running team in the browser until a signal ends the process.

    Args:
        keys: Folder with the public keys of the team and the manager; None shows unsigned messages.
        scenario: Name or file of the scenario, which sets the agents.
        speed: Speed relative to the scenario's clock, from 0.1 to 20.
        network: Whether to listen to other machines, too.
        port: Port of the page, from 0 to 65535; another one if it is taken.

    Raises:
        ValueError: An argument is not allowed, or a key does not exist.
    """
    rules = make_scenario(scenario)
    period_s = round_period(rules.period_s, speed) / SECOND
    if keys is None:
        print_line("view: WITHOUT KEYS: everybody on this network can forge what the page shows")
    with open_page(port, print_line) as listening:
        run_view_server(
            listening, period_s, team=Team.of(rules), keys=keys, speed=speed, network=network
        )
