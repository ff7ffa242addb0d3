"""Lines to programs and services that fail, hang, or send what is not an answer."""

import socket
import sys
import threading
import time
from contextlib import suppress

import pytest
from refusals import refuses

from roletrust_env.trust import links
from roletrust_env.trust.links import HttpLink, ProcessLink


def linked(folder, text):
    """The link to a Python program."""
    path = folder / "program.py"
    path.write_text(text)
    return ProcessLink(f"{sys.executable} {path}")


@pytest.mark.parametrize("text", ["import sys; sys.stdin.read()", "import time; time.sleep(60)"])
@pytest.mark.parametrize("line", ["{}\n", "1" * 1_000_000 + "\n"])
def test_a_process_that_does_not_answer_is_ended(tmp_path, monkeypatch, text, line):
    monkeypatch.setattr(links, "LIMIT_S", 0.2)
    link = linked(tmp_path, text)
    with refuses(ValueError, "0.2"):
        link.ask([line])
    assert link._process.poll() is not None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("import os, time; os.close(1); time.sleep(60)", ()),
        (
            "import sys; print('no \\x1b[2J\\a', file=sys.stderr); exit(3)",
            ("3", "\\x1b[2J\\x07"),
        ),
    ],
)
def test_a_process_that_stops_to_answer_is_one_line_at_once(tmp_path, monkeypatch, text, words):
    monkeypatch.setattr(links, "_ENDS_S", 0.1)
    link, began = linked(tmp_path, text), time.monotonic()
    for _ in range(2):
        with refuses(ValueError, *words):
            link.ask(["{}\n"])
    assert time.monotonic() - began < 30


@pytest.fixture
def peer():
    """A function from what a peer sends, part by part, to a link to it."""
    sockets = []

    def start(parts):
        listener = socket.create_server(("127.0.0.1", 0))

        def serve():
            with suppress(OSError):
                connection, _ = listener.accept()
                sockets.append(connection)
                connection.recv(65536)
                for part in parts:
                    connection.sendall(part)
                connection.shutdown(socket.SHUT_WR)

        sockets.append(listener)
        threading.Thread(target=serve, daemon=True).start()
        return HttpLink(f"http://127.0.0.1:{listener.getsockname()[1]}")

    yield start
    for one in sockets:
        one.close()


OK = b"HTTP/1.1 200 OK\r\n"


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (b"\x1b[31mI am no server\r\n\r\n", ("BadStatusLine",)),
        (b"", ("RemoteDisconnected",)),
        (OK + b"Transfer-Encoding: chunked\r\n\r\nzz\r\n{}", ("IncompleteRead",)),
        (OK + b"Content-Length: 100\r\n\r\n{}", ("98",)),
        (OK + b"X: y\r\n" * 101 + b"\r\n", ("HTTPException", "100")),
        (OK + b"X: " + b"y" * 70_000 + b"\r\n\r\n", ("LineTooLong", "65536")),
        (
            b"HTTP/1.1 500 \x1b[31mred\x07\r\nContent-Length: 0\r\n\r\n",
            ("500", "\\x1b[31mred\\x07"),
        ),
        (b"HTTP/1.1 302 Go\r\nLocation: file:///etc/passwd\r\n\r\n", ("HTTPError", "302")),
        (OK + b"Content-Length: 6\r\n\r\n{}\n{}\n", ("2", "1")),
    ],
)
def test_what_is_no_answer_is_one_printable_line(peer, answer, words):
    with refuses(ValueError, *words) as error:
        peer([answer]).ask(["{}\n"])
    assert str(error.value).isprintable()
    assert len(str(error.value)) < 600


def test_a_service_has_one_deadline_for_its_whole_answer(peer, monkeypatch):
    monkeypatch.setattr(links, "LIMIT_S", 0.3)

    def drip():
        yield OK
        while True:
            time.sleep(0.02)
            yield b"X: y\r\n"[:1]

    with refuses(ValueError, "0.3"):
        peer(drip()).ask(["{}\n"])
