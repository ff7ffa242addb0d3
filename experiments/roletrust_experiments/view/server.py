"""The server of the page, for this machine only."""

import os
import socket
from collections.abc import Callable, Collection
from functools import partial

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.server.server import Server
from tornado.ioloop import PeriodicCallback

from roletrust_env.live.nodes.running import running
from roletrust_env.live.nodes.watch import Watcher
from roletrust_experiments.view.board import Board
from roletrust_experiments.view.page import make_page

_HERE = "127.0.0.1"
_LOOKED_MS = 100  # between two looks at whether it is to end
_YIELDS = 10  # to the robots, as `nice` has it


def serve(board: Board, port: int) -> Server:
    """A server of the page, for this machine only; its loop is still to be run.

    Raises:
        ValueError: the port is taken.
    """
    application = Application(FunctionHandler(partial(make_page, board)))
    origins = [f"localhost:{port}", f"{_HERE}:{port}"]
    try:
        server = Server({"/": application}, port=port, address=_HERE, allow_websocket_origin=origins)
    except OSError as error:
        raise _taken(port, error) from None
    server.start()
    return server


def check_port(port: int) -> None:
    """See before the work whether the page can have a port.

    Raises:
        ValueError: it cannot.
    """
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as the server does
        try:
            probe.bind((_HERE, port))
        except OSError as error:
            raise _taken(port, error) from None


def _taken(port: int, error: OSError) -> ValueError:
    return ValueError(f"port {port} cannot be had: {error}; give another with --port")


def run_view(
    port: int,
    period_s: float,
    *,
    speed: float = 1.0,
    attackers: Collection[str] = (),
    network: bool = False,
    ready: Callable[[Server], None] = lambda server: None,
) -> None:
    """Show a team until told to end. It comes after the robots in everything: they do not wait for who looks on.

    Args:
        port: of the page.
        period_s: between rounds, seconds.
        speed: seconds of the scenario's clock in a second.
        attackers: names to be marked.
        network: see `Node`.
        ready: is called when the page can be had.

    Raises:
        ValueError: the port is taken.
    """
    os.nice(_YIELDS)
    watcher = Watcher(network=network)
    try:
        server = serve(Board(watcher, period_s, speed, attackers), port)
        with running() as on:
            ready(server)
            PeriodicCallback(lambda: None if on else server.io_loop.stop(), _LOOKED_MS).start()
            server.io_loop.start()
        server.stop()
    finally:
        watcher.close()
