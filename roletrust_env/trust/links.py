"""Lines of text to another process and back: to a program that runs here, or to an HTTP service."""

import shlex
import subprocess
import weakref
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from functools import partial
from threading import Thread
from typing import Any, TypeVar

from roletrust_env.errors import short

LIMIT_S = 300.0
"""Longest time, in seconds, that the other side may take for an answer."""

_MOST_BYTES = 256_000_000  # of an answer
_BUFFER = 1_000_000  # bytes that are read at once
_ENDS_S = 1.0  # seconds for a process without output to end by itself

T = TypeVar("T")


class ProcessLink:
    """A process that reads lines from its standard input and answers on its standard output. It
    ends with this object.

    Args:
        command: Program and arguments, as in a shell. No shell interprets it.
        env: Environment of the process; None for that of this one.

    Raises:
        ValueError: The program cannot be started.
    """

    def __init__(self, command: str, env: Mapping[str, str] | None = None) -> None:
        pipe = subprocess.PIPE
        try:
            process: Any = subprocess.Popen(
                shlex.split(command), _BUFFER, stdin=pipe, stdout=pipe, stderr=pipe, env=env
            )
        except (OSError, ValueError, IndexError) as error:
            raise ValueError(f"it cannot be started ({error or 'the command is empty'})") from None
        self._process, self._complaints = process, deque[bytes](maxlen=1)
        weakref.finalize(self, _end, process)
        complaints = iter(partial(process.stderr.readline, _MOST_BYTES), b"")
        self._listener = Thread(target=self._complaints.extend, args=(complaints,), daemon=True)
        self._listener.start()

    def ask(self, lines: Sequence[str]) -> list[bytes]:
        """Send lines and return their answers.

        Args:
            lines: Lines with their ends; a text of several lines has one answer.

        Raises:
            ValueError: The process has ended, or takes too long. It is ended then.
        """
        try:
            answers = _in_time(partial(self._exchange, lines))
        except ValueError:
            _end(self._process)
            raise
        if len(answers) == len(lines) and answers[-1].endswith(b"\n"):
            return answers
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_ENDS_S)
        code = self._process.poll()
        _end(self._process)
        self._listener.join(1.0)
        what = "closed its output" if code is None else f"ended with exit code {code}"
        complaint = b"".join(list(self._complaints)).decode(errors="replace").strip()
        raise ValueError(f"it has {what}{complaint and f': {short(complaint)}'}")

    def _exchange(self, lines: Sequence[str]) -> list[bytes]:
        answers = []
        with suppress(OSError):  # the process has ended, and answers are missing
            for line in lines:
                self._process.stdin.write(line.encode())
                self._process.stdin.flush()
                answers.append(self._process.stdout.readline(_MOST_BYTES))
        return answers


class HttpLink:
    """An HTTP service: lines are posted, and the body of the response has the answers.

    Args:
        url: Address of the service.
    """

    def __init__(self, url: str) -> None:
        self._url = url

    def ask(self, lines: Sequence[str]) -> list[bytes]:
        """Send lines and return their answers. See `ProcessLink.ask`."""
        answers = _in_time(partial(self._post, "".join(lines).encode())).splitlines()
        if len(answers) != len(lines):
            raise ValueError(f"it answered {len(answers)} lines to {len(lines)}")
        return answers

    def _post(self, body: bytes) -> bytes:
        from urllib.request import Request, urlopen

        request = Request(self._url, body, {"Content-Type": "application/x-ndjson"})
        try:
            with urlopen(request, timeout=LIMIT_S) as response:
                answer: bytes = response.read(_MOST_BYTES)
                left = response.length
        except Exception as error:  # what is not HTTP raises many things
            what = short(f"{type(error).__name__}: {error}")
            raise ValueError(f"it gave no HTTP answer ({what})") from None
        if left:
            raise ValueError(f"its answer breaks off: {left} bytes are missing")
        return answer


def _in_time(work: Callable[[], T]) -> T:
    """Return the result of a function that may never end, such as one that waits for an answer.

    Raises:
        ValueError: It has not ended in time.
    """
    future: Future[T] = Future()

    def run() -> None:
        try:
            future.set_result(work())
        except Exception as error:
            future.set_exception(error)

    Thread(target=run, daemon=True).start()
    try:
        return future.result(LIMIT_S)
    except TimeoutError:
        raise ValueError(f"it has not answered for {LIMIT_S:g} s") from None


def _end(process: "subprocess.Popen[bytes]") -> None:
    process.kill()
    process.wait()
