"""The server of the live page, for this machine only."""

import os
import socket
from collections.abc import Callable, Collection
from functools import partial
from pathlib import Path

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.server.server import Server
from tornado.ioloop import PeriodicCallback

from roletrust_env.live.nodes.run_loop import SECOND, run_until_signal
from roletrust_env.live.nodes.team_listener import TeamListener
from roletrust_env.live.rounds import RoundTiming
from roletrust_env.live.team import Team
from roletrust_env.live.validation import MANAGER
from roletrust_env.live.wire.keys import PublicKeys
from roletrust_experiments.view.dashboard import Dashboard
from roletrust_experiments.view.page import make_page

_HERE = "127.0.0.1"
_POLL_MS = 100  # time between two checks for a signal
_NICENESS = 10  # the server gives way to the robots


def serve(dashboard: Dashboard, port: int) -> Server:
    """Return a started server of the page, for this machine only. The caller runs its loop.

    Raises:
        ValueError: The port is not available.
    """
    application = Application(FunctionHandler(partial(make_page, dashboard)))
    origins = [f"localhost:{port}", f"{_HERE}:{port}"]
    try:
        server = Server({"/": application}, port=port, address=_HERE, allow_websocket_origin=origins)
    except OSError as error:
        raise _port_error(port, error) from None
    server.start()
    return server


def check_port(port: int) -> None:
    """Check before the work that a port is available.

    Raises:
        ValueError: The port is not available.
    """
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as the server does
        try:
            probe.bind((_HERE, port))
        except OSError as error:
            raise _port_error(port, error) from None


def _port_error(port: int, error: OSError) -> ValueError:
    return ValueError(f"port {port} is not available: {error}; choose another with --port")


def run_view_server(
    port: int,
    period_s: float,
    *,
    team: Team,
    keys: Path | None = None,
    speed: float = 1.0,
    attackers: Collection[str] = (),
    network: bool = False,
    ready: Callable[[Server], None] = lambda server: None,
) -> None:
    """Serve the page of a team until a signal ends the process. The process has a lower priority than the robots.

    Args:
        port: Port of the page.
        period_s: Time between rounds, seconds.
        team: Agents of the scenario.
        keys: Folder with the public keys of the team and the manager; None shows unsigned messages.
        speed: Speed relative to the scenario's clock.
        attackers: Names to mark as attackers.
        network: See `Node`.
        ready: Function that is called once the page is available.

    Raises:
        ValueError: The port is not available, or a key does not exist.
    """
    os.nice(_NICENESS)
    keyring = None if keys is None else PublicKeys(keys, [MANAGER])
    listener = TeamListener(team, RoundTiming(round(period_s * SECOND)), keyring=keyring, network=network)
    try:
        server = serve(Dashboard(listener, period_s, speed, attackers), port)
        with run_until_signal() as active:
            ready(server)
            PeriodicCallback(lambda: None if active else server.io_loop.stop(), _POLL_MS).start()
            server.io_loop.start()
        server.stop()
    finally:
        listener.close()
