"""The page before the live page: it answers from the first second, and says what the command is
doing.
"""

import socket
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Self

from roletrust_manager.page.dashboard import TEMPLATES

_HERE = "127.0.0.1"
_POLL_S = 0.05


class WaitingPage:
    """Answers on a port, for this machine only, until the live page takes its place; no request is
    refused meanwhile.

    Args:
        port: Port of both pages.

    Attributes:
        text: What the command is doing; a browser asks for it every second.

    Raises:
        ValueError: The port is not available.
    """

    def __init__(self, port: int) -> None:
        self.text = "Starting."
        try:
            self._server = _Server((_HERE, port), _Answer)
        except OSError as error:
            raise ValueError(
                f"port {port} is not available: {error}; choose another with --port"
            ) from None
        self._server.page = self
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(_POLL_S,), daemon=True
        )
        self._thread.start()

    @property
    def listening(self) -> socket.socket:
        """Listening socket, for the server of the live page."""
        return self._server.socket

    def leave(self) -> None:
        """Stop answering. Requests wait from now on, until another server takes them from the
        socket.
        """
        self._server.shutdown()
        self._thread.join()

    def close(self) -> None:
        """Stop answering, and close the socket in this process. A process that was given the socket
        has it still.
        """
        self.leave()
        self._server.server_close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self.close()


class _Server(ThreadingHTTPServer):
    request_queue_size = 128
    page: WaitingPage


class _Answer(BaseHTTPRequestHandler):
    server: _Server

    def do_GET(self) -> None:
        """Answer with the text of the moment."""
        body = TEMPLATES.get_template("waiting.html").render(text=self.server.page.text).encode()
        self.send_response(200)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        """Print nothing about requests."""
