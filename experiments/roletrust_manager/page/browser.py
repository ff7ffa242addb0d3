"""The address of the page, on this machine only."""

import socket
import webbrowser
from collections.abc import Callable

from roletrust_env.parameters import whole_number

_HERE = "127.0.0.1"


def open_page(port: int, report: Callable[[str], object]) -> socket.socket:
    """Open a page in the browser, and return its listening socket. The browser waits until a server
    answers there.

    Args:
        port: Port, from 0 to 65535; another one if it is taken.
        report: Function that shows the address to the user.

    Raises:
        ValueError: There is no such port.
    """
    if whole_number("port", port) > 65535:
        raise ValueError(f"port is {port}; it must be a whole number from 0 to 65535")
    try:
        listening = socket.create_server((_HERE, port))
    except OSError:  # taken, or of the system
        listening = socket.create_server((_HERE, 0))
    address = f"http://localhost:{listening.getsockname()[1]}"
    report(f"Watch the team on {address}")
    webbrowser.open(address)
    return listening
