"""Links to a trust model outside this process: lines of text there, and one line back for each."""

import queue
import shlex
import subprocess
import threading
import urllib.error
import urllib.request
from collections import deque
from collections.abc import Sequence
from time import monotonic
from typing import Protocol

LIMIT_S = 60.0
"""Longest time, in seconds, that the other side may take for an answer."""

_MOST_BYTES = 64_000_000  # of an answer
_TOLD = 500  # characters of an error message of the other side that are shown


class LinkError(ValueError):
    """The other side cannot be reached, or does not answer."""


class Link(Protocol):
    """A connection to the other side."""

    def ask(self, lines: Sequence[str]) -> list[str]:
        """Send lines and return as many lines of answer.

        Raises:
            LinkError: The other side fails, or takes too long.
        """
        ...

    def tell(self, line: str) -> None:
        """Send a line that has no answer. Raises as `ask` does."""
        ...

    def close(self) -> None:
        """End the connection."""
        ...


class ProcessLink:
    """A process of its own: it reads lines from its standard input and answers on its standard output.

    Args:
        command: Program and arguments, as in a shell. Nothing of it is interpreted by a shell.
        limit_s: Longest time for an answer, in seconds.

    Raises:
        LinkError: The program cannot be started.
    """

    def __init__(self, command: str, limit_s: float = LIMIT_S) -> None:
        self._limit_s = limit_s
        try:
            self._process = subprocess.Popen(
                shlex.split(command), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
            )
        except (OSError, ValueError, IndexError) as error:
            raise LinkError(f"it cannot be started ({error or 'the command is empty'})") from None
        self._answers: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._complaints: deque[bytes] = deque(maxlen=1)
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()
        threading.Thread(target=self._read, daemon=True).start()

    def ask(self, lines: Sequence[str]) -> list[str]:
        """See `Link.ask`."""
        # A process that never reads would hold up whoever writes to it, so a thread writes.
        threading.Thread(target=self._write, args=(lines,), daemon=True).start()
        until, answers = monotonic() + self._limit_s, []
        for _ in lines:
            try:
                answer = self._answers.get(timeout=max(0.0, until - monotonic()))
            except queue.Empty:
                self.close()
                raise LinkError(f"it has not answered for {self._limit_s:g} s{self._complaint()}") from None
            if not answer.endswith(b"\n"):
                self._process.wait()
                raise LinkError(f"it has ended with exit code {self._process.returncode}{self._complaint()}")
            answers.append(answer.decode("utf-8", "replace"))
        return answers

    def tell(self, line: str) -> None:
        """See `Link.tell`."""
        self._write([line])

    def close(self) -> None:
        """See `Link.close`."""
        self._process.kill()
        self._process.wait()

    def _write(self, lines: Sequence[str]) -> None:
        stream = self._process.stdin
        try:
            assert stream is not None  # it is a pipe
            stream.write("".join(f"{line}\n" for line in lines).encode())
            stream.flush()
        except OSError:
            return  # it has ended; the missing answer tells

    def _read(self) -> None:
        stream = self._process.stdout
        assert stream is not None  # it is a pipe
        while (line := stream.readline(_MOST_BYTES)).endswith(b"\n"):
            self._answers.put(line)
        self._answers.put(b"")

    def _listen(self) -> None:
        stream = self._process.stderr
        assert stream is not None  # it is a pipe
        while line := stream.readline(_MOST_BYTES):
            self._complaints.append(line)

    def _complaint(self) -> str:
        """Return the last line that the process, which has ended, wrote to its standard error."""
        self._listener.join(1.0)
        said = b"".join(self._complaints).decode("utf-8", "replace").strip()
        return f": {said[:_TOLD]}" if said else ""


class HttpLink:
    """An HTTP service: lines are posted, and the body of the response has the answers.

    Args:
        url: Address of the service.
        limit_s: Longest time for an answer, in seconds.
    """

    def __init__(self, url: str, limit_s: float = LIMIT_S) -> None:
        self._url, self._limit_s = url, limit_s

    def ask(self, lines: Sequence[str]) -> list[str]:
        """See `Link.ask`."""
        answers = self._post(lines).splitlines()
        if len(answers) != len(lines):
            raise LinkError(f"it answered {len(answers)} lines to {len(lines)}")
        return answers

    def tell(self, line: str) -> None:
        """See `Link.tell`."""
        self._post([line])

    def close(self) -> None:
        """See `Link.close`."""

    def _post(self, lines: Sequence[str]) -> str:
        body = "".join(f"{line}\n" for line in lines).encode()
        request = urllib.request.Request(self._url, body, {"Content-Type": "application/x-ndjson"})
        try:
            with urllib.request.urlopen(request, timeout=self._limit_s) as response:
                answer: bytes = response.read(_MOST_BYTES)
        except urllib.error.HTTPError as error:
            raise LinkError(f"it answered with status {error.code} {error.reason}") from None
        except (OSError, ValueError) as error:
            raise LinkError(f"it cannot be reached ({getattr(error, 'reason', error)})") from None
        return answer.decode("utf-8", "replace")
