"""A trust model outside this process, in any language: ratings go there, and trust comes back.

The model learns nothing but ratings, see docs/guide/outside.md. Links carry lines there and back,
and games send one line of JSON for each game and round.
"""

import json
import queue
import secrets
import shlex
import subprocess
import threading
import weakref
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from hashlib import sha256
from itertools import count
from math import prod
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.arrays import Array, namespace
from roletrust_env.errors import printable
from roletrust_env.shapes import PerPair, PerProvider, PerRater
from roletrust_env.trust.key_index import Floats, Ints
from roletrust_env.trust.ratings import Ratings

KINDS = ("exec", "http", "https")
"""Beginnings of an address, before its first colon."""

MOST_GAMES = 20_000
"""Number of games that the other side has to remember. When there are more, the oldest ones are
over."""

_SHOWN = 100  # characters of a wrong answer

Shape = tuple[int, int]

LIMIT_S = 60.0
"""Longest time, in seconds, that the other side may take for an answer."""

_MOST_BYTES = 64_000_000  # of an answer
_TOLD = 500  # characters of an error message of the other side that are shown
_ENDS_S = 1.0  # seconds for a process without output to end by itself
_TOGETHER = 200_000  # values of trust in the answers to messages that are sent at once
_ENDED = 20  # games whose end is told at once
_WAITING = 100_000  # answers that nobody has asked for yet


class LinkError(ValueError):
    """The other side cannot be reached, does not answer, or answers what the protocol does not
    allow.
    """


class ProcessLink:
    """A process of its own: it reads lines from its standard input and answers on its standard
    output.

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
                shlex.split(command),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
            )
        except (OSError, ValueError, IndexError) as error:
            raise LinkError(f"it cannot be started ({error or 'the command is empty'})") from None
        self._messages: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._answers: queue.Queue[bytes] = queue.Queue(_WAITING)
        self._complaints: deque[bytes] = deque(maxlen=1)
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()
        # A process that never reads would hold up whoever writes to it, so a thread writes.
        for work in (self._write, self._read):
            threading.Thread(target=work, daemon=True).start()

    def ask(self, lines: Sequence[str]) -> list[str]:
        """Send lines and return as many lines of answer.

        Raises:
            LinkError: The other side fails, or takes too long.
        """
        self._send(lines)
        until, answers = monotonic() + self._limit_s, []
        for _ in lines:
            try:
                answer = self._answers.get(timeout=max(0.0, until - monotonic()))
            except queue.Empty:
                self.close()
                raise _late(self._limit_s, self._complaint()) from None
            if not answer.endswith(b"\n"):
                self._answers.put(answer)  # which is so for all further questions
                with suppress(subprocess.TimeoutExpired):
                    self._process.wait(_ENDS_S)
                code = self._process.poll()
                self.close()
                what = "closed its output" if code is None else f"ended with exit code {code}"
                raise LinkError(f"it has {what}{self._complaint()}")
            answers.append(answer.decode("utf-8", "replace"))
        return answers

    def tell(self, line: str) -> None:
        """Send a line that has no answer."""
        self._send([line])

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        self._messages.put(b"")

    def _send(self, lines: Sequence[str]) -> None:
        self._messages.put("".join(f"{line}\n" for line in lines).encode())

    def _write(self) -> None:
        stream = self._process.stdin
        assert stream is not None  # it is a pipe
        with suppress(OSError):  # it has ended; the missing answer tells
            while message := self._messages.get():
                stream.write(message)
                stream.flush()

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
        return f": {printable(said[:_TOLD])}" if said else ""


class HttpLink:
    """An HTTP service: lines are posted, and the body of the response has the answers.

    Args:
        url: Address of the service.
        limit_s: Longest time for a whole answer, in seconds.
    """

    def __init__(self, url: str, limit_s: float = LIMIT_S) -> None:
        self._url, self._limit_s = url, limit_s

    def ask(self, lines: Sequence[str]) -> list[str]:
        """Send lines and return as many lines of answer. See `ProcessLink.ask`."""
        answers = self._post(lines).splitlines()
        if len(answers) != len(lines):
            raise LinkError(f"it answered {len(answers)} lines to {len(lines)}")
        return answers

    def tell(self, line: str) -> None:
        """Send a line that has no answer. Raises as `ask` does."""
        self._post([line])

    def close(self) -> None:
        """Do nothing; each request has a connection of its own."""

    def _post(self, lines: Sequence[str]) -> str:
        body = "".join(f"{line}\n" for line in lines).encode()
        answers: queue.SimpleQueue[bytes | LinkError] = queue.SimpleQueue()
        # A service may send byte by byte, each in time, so a thread waits for the whole answer.
        threading.Thread(target=lambda: answers.put(self._answer(body)), daemon=True).start()
        try:
            answer = answers.get(timeout=self._limit_s)
        except queue.Empty:
            raise _late(self._limit_s) from None
        if isinstance(answer, LinkError):
            raise answer
        return answer.decode("utf-8", "replace")

    def _answer(self, body: bytes) -> bytes | LinkError:
        """Return the body of the response to a body, or what went wrong."""
        import urllib.error
        import urllib.request

        try:
            request = urllib.request.Request(
                self._url, body, {"Content-Type": "application/x-ndjson"}
            )
            with urllib.request.urlopen(request, timeout=self._limit_s) as response:
                answer: bytes = response.read(_MOST_BYTES)
                return (
                    LinkError("its answer breaks off, or is too long")
                    if response.length
                    else answer
                )
        except urllib.error.HTTPError as error:
            error.close()
            return LinkError(
                f"it answered with status {error.code} {printable(str(error.reason)[:_TOLD])}"
            )
        except TimeoutError:
            return _late(self._limit_s)
        except OSError as error:
            return LinkError(
                f"it cannot be reached ({printable(str(getattr(error, 'reason', error))[:_TOLD])})"
            )
        except Exception as error:  # what is no HTTP raises many things
            return LinkError(
                f"its answer is no HTTP ({type(error).__name__}: {printable(str(error)[:_TOLD])})"
            )


def _late(limit_s: float, complaint: str = "") -> LinkError:
    return LinkError(f"it has not answered for {limit_s:g} s{complaint}")


# --- games at the other side
# -------------------------------------------------------------------------


class Answers(NamedTuple):
    """Trust in G games: of the raters, (S, G), 1 if the model has none, and of the providers, (P,
    G).
    """

    tor: Floats
    top: Floats


class Sessions:
    """The games at the other side.

    Args:
        address: `exec:` and a command, or the URL of a service.

    Attributes:
        link: Connection to the other side.
        rates_raters: Whether the last answer had trust of raters; None before the first one.

    Raises:
        LinkError: A program cannot be started.
    """

    def __init__(self, address: str) -> None:
        kind, _, command = address.partition(":")
        self.link = ProcessLink(command) if kind == "exec" else HttpLink(address)
        self.rates_raters: bool | None = None
        # A service may have games of several processes, which do not know of each other.
        self._numbers = count(secrets.randbits(32) << 20)
        self._rounds: dict[int, int] = {}
        self._past: tuple[Sequence[str], int] | None = (
            None  # messages of a game that is copied, and its number
        )
        self._ended = list[int]()  # of which the other side has not heard

    def begin(self, shape: Shape, games: int) -> tuple[Ints, Answers]:
        """Begin games, and return their numbers and the trust before any rating.

        Args:
            shape: Ints of raters and providers, (S, P).
            games: Number of games G.
        """
        numbers = [next(self._numbers) for _ in range(games)]
        answers = self._ask([_request(number, 0, shape, []) for number in numbers], shape)
        self._rounds.update(dict.fromkeys(numbers, 0))
        if len(self._rounds) > MOST_GAMES:
            self.end(list(self._rounds)[: len(self._rounds) - MOST_GAMES])
        return np.array(numbers, np.int64), answers

    def play(self, numbers: Ints, rounds: Ints, ratings: Floats, mask: Any) -> Answers:
        """Send a round of ratings for each game, and return the trust after it.

        Args:
            numbers: Ints of the games, (G,).
            rounds: Ints of the rounds, (G,); 1 is the first one.
            ratings: Ratings, (S, P, G).
            mask: Whether a rater rated a provider, boolean, (S, P, G).
        """
        shape = ratings.shape[:2]
        requests = []
        for k, (number, round) in enumerate(zip(numbers.tolist(), rounds.tolist(), strict=True)):
            raters, providers = np.nonzero(mask[..., k])
            given = ratings[raters, providers, k]
            listed = [
                list(rating)
                for rating in zip(raters.tolist(), providers.tolist(), given.tolist(), strict=True)
            ]
            requests.append(_request(number, round, shape, listed))
        answers = self._ask(requests, shape)
        self._rounds.update(zip(numbers.tolist(), rounds.tolist(), strict=True))
        return answers

    def replay(self, shape: Shape, past: Sequence[str], tails: Sequence[str]) -> Floats:
        """Play a game of known rounds, and return the trust in the providers at its end, shape
        (P,).

        Messages are sent many at a time, and answers before the last one are not checked. The game
        is then over. If the other side can copy games, the past is played once, and each further
        game with the same past begins as its copy.

        Args:
            shape: Ints of raters and providers, (S, P).
            past: Messages of the first rounds, see `round_tail`.
            tails: Messages of the rounds after it.
        """
        number = next(self._numbers)
        begin = [_headed(number, tail) for tail in past]
        if self._past is None or self._past[0] is not past:
            first = self._send(begin, shape)[0]
            with suppress(ValueError, AttributeError, RecursionError):
                if json.loads(first).get("copies") is True:
                    self._past, number = (past, number), next(self._numbers)
            begin = []
        if self._past is not None and self._past[0] is past:
            begin = [json.dumps({"game": number, "copy": self._past[1]})]
        answer = self._send([*begin, *(_headed(number, tail) for tail in tails)], shape)[-1]
        self._ended.append(number)
        if len(self._ended) >= _ENDED:
            self.link.tell(json.dumps({"over": self._ended}))
            self._ended.clear()
        return self._read([answer], shape).top[:, 0]

    def _send(self, lines: Sequence[str], shape: Shape) -> list[str]:
        """Send lines, many at a time, and return the first and the last answer."""
        many = max(1, _TOGETHER // sum(shape))
        answers = [self.link.ask(lines[at : at + many]) for at in range(0, len(lines), many)]
        return [answers[0][0], answers[-1][-1]]

    def round_of(self, number: int) -> int | None:
        """Return the round that a game has reached; None if it is over."""
        return self._rounds.get(number)

    def end(self, numbers: list[int]) -> None:
        """Tell the other side that games are over."""
        for number in numbers:
            del self._rounds[number]
        self.link.tell(json.dumps({"over": numbers}))

    def _ask(self, requests: Sequence[str], shape: Shape) -> Answers:
        return self._read(self.link.ask(requests), shape)

    def _read(self, lines: Sequence[str], shape: Shape) -> Answers:
        answers = Answers(np.ones((shape[0], len(lines))), np.empty((shape[1], len(lines))))
        for k, line in enumerate(lines):
            try:
                trust = _read(line, shape)
            except LinkError as error:
                raise LinkError(f"{error} in its answer {line.strip()[:_SHOWN]!r}") from None
            answers.top[:, k] = trust["providers"]
            answers.tor[:, k] = trust.get("raters", 1.0)
            self.rates_raters = "raters" in trust
        return answers


def round_tail(round: int, shape: Shape, ratings: list[list[float]]) -> str:
    """Return the message of a round without the number of its game, which comes first."""
    return json.dumps(
        {"round": round, "raters": shape[0], "providers": shape[1], "ratings": ratings}
    )[1:]


def _headed(number: int, tail: str) -> str:
    return f'{{"game": {number}, {tail}'


def _request(number: int, round: int, shape: Shape, ratings: list[list[float]]) -> str:
    return _headed(number, round_tail(round, shape, ratings))


def _read(line: str, shape: Shape) -> dict[str, list[float]]:
    """Return the lists of an answer.

    Raises:
        LinkError: It is no JSON, or a list is missing, has another length, or has something outside
            [0, 1].
    """
    try:
        data = json.loads(line)
    except (ValueError, RecursionError):
        raise LinkError("there is no JSON") from None
    if not isinstance(data, dict) or "providers" not in data:
        raise LinkError("there is no 'providers'")
    lists = {name: data[name] for name in ("raters", "providers") if name in data}
    for name, values in lists.items():
        size = shape[name == "providers"]
        if not isinstance(values, list) or len(values) != size:
            raise LinkError(f"{name!r} is no list of {size} numbers")
        if not all(type(value) in (int, float) and 0 <= value <= 1 for value in values):
            raise LinkError(f"{name!r} has something else than numbers in [0, 1]")
    return lists


# --- the model
# --------------------------------------------------------------------------------------


class OutsideState(NamedTuple):
    """Ints of the games at the other side and their rounds, (...) each; trust of the raters and the
    providers.
    """

    game: Array
    round: Array
    tor: PerRater
    top: PerProvider


@dataclass(frozen=True, eq=False)
class OutsideModel:
    """A trust model that is a process or an HTTP service, which begins when it is first needed.

    It cannot go back to an earlier round of a game, so a game with it cannot branch, and it has no
    gradients.

    Attributes:
        address: `exec:` and a command, such as `exec:./my-model --fast`, or the URL of a service.

    Raises:
        ValueError: The address is of no known kind.
    """

    address: str

    source = ""
    differentiable = False

    def __post_init__(self) -> None:
        """Check the address."""
        kind, _, rest = self.address.partition(":")
        if kind not in KINDS or not rest.strip("/ "):
            raise ValueError(
                f"address is {self.address!r}; it must be exec:COMMAND, such as exec:./my-model, "
                "or a URL, such as "
                "http://127.0.0.1:8080"
            )

    @property
    def rates_raters(self) -> bool:
        """True if its answers have trust of raters; a game of one rater and one provider shows
        it.
        """
        if self._sessions().rates_raters is None:
            self._begin(np.zeros((1, 1)))
        return bool(self._sessions().rates_raters)

    def start(self, like: PerPair) -> OutsideState:
        """Begin the games of a batch. See `TrustModel.start`."""
        numbers, answers = self._begin(like)
        return _state(like, numbers, np.zeros_like(numbers), answers)

    def update(self, state: OutsideState, ratings: Ratings) -> OutsideState:
        """Send a round of ratings, and return the state with the trust that comes back. See
        `TrustModel.update`.

        Raises:
            ValueError: The other side fails, its answer is wrong, or the game has gone on there.
        """
        values, shape = ratings.values, (*ratings.shape, -1)
        numbers, rounds = (np.asarray(part).reshape(-1) for part in (state.game, state.round))
        numbers = self._at_hand(numbers, rounds, values)
        given, rated = (np.asarray(part).reshape(shape) for part in (values, ratings.weights > 0))
        with self._named():
            answers = self._sessions().play(numbers, rounds + 1, given, rated)
        return _state(values, numbers, rounds + 1, answers)

    def rater_trust(self, state: OutsideState) -> PerRater:
        """Return the trust of each rater; 1 if the model has none. See `TrustModel.rater_trust`."""
        return state.tor

    def provider_trust(self, state: OutsideState) -> PerProvider:
        """Return the trust of each provider. See `TrustModel.provider_trust`."""
        return state.top

    def replay(self, shape: tuple[int, int], past: Sequence[str], tails: Sequence[str]) -> Floats:
        """Return the trust in providers after a game of known rounds. See `Sessions.replay`.

        Raises:
            ValueError: The other side fails, or its answer is wrong.
        """
        with self._named():
            return self._sessions().replay(shape, past, tails)

    def _begin(self, like: Array) -> tuple[Ints, Answers]:
        with self._named():
            return self._sessions().begin(like.shape[:2], prod(like.shape[2:]))

    @contextmanager
    def _named(self) -> Iterator[None]:
        """Name the model in errors of its other side."""
        try:
            yield
        except LinkError as error:
            raise ValueError(f"{self}: {error}") from None

    def _at_hand(self, numbers: Ints, rounds: Ints, ratings: Array) -> Ints:
        """Return the numbers of games in these rounds. A game that has not had a rating can begin
        again.

        Raises:
            ValueError: A game is in another round at the other side.
        """
        sessions, shape = self._sessions(), ratings.shape[:2]
        session_rounds = [sessions.round_of(number) for number in numbers.tolist()]
        apart = [k for k, round in enumerate(rounds.tolist()) if session_rounds[k] != round]
        if any(rounds[apart]):
            raise ValueError(
                f"{self} cannot go back to round {max(rounds[apart])} of a game: a model outside "
                "cannot branch, be "
                f"copied in a game, or play more than {MOST_GAMES:,} games at once"
            )
        if apart:
            numbers = numbers.copy()
            numbers[apart] = self._begin(np.broadcast_to(0.0, (*shape, len(apart))))[0]
        return numbers

    def _sessions(self) -> Sessions:
        """Return the games of this model, which begin when they are first needed."""
        if self not in _SESSIONS:
            with self._named():
                _SESSIONS[self] = sessions = Sessions(self.address)
            weakref.finalize(self, sessions.link.close)
        return _SESSIONS[self]


class OutsideFactory:
    """Factory of the trust model at an address.

    Attributes:
        fingerprint: Hash of the address, and of the files that its command names.

    Args:
        address: See `OutsideModel`.
    """

    kind = OutsideModel

    def __init__(self, address: str) -> None:
        digest = sha256(address.encode())
        for word in address.partition(":")[2].split() if address.startswith("exec:") else ():
            with suppress(OSError):
                digest.update(Path(word).read_bytes())
        self.address, self.fingerprint = address, digest.hexdigest()

    def __call__(self) -> OutsideModel:
        """Return the model."""
        return OutsideModel(self.address)


_SESSIONS: "weakref.WeakKeyDictionary[OutsideModel, Sessions]" = weakref.WeakKeyDictionary()
"""The memory of a model is at the other side. The object itself is immutable, so it can go to
another process."""


def _state(like: Array, numbers: Ints, rounds: Ints, answers: Answers) -> OutsideState:
    xp, batch = namespace(like), like.shape[2:]
    game, round = (
        xp.asarray(part.reshape(batch), device=like.device) for part in (numbers, rounds)
    )
    tor, top = (
        xp.asarray(part.reshape(-1, *batch), dtype=like.dtype, device=like.device)
        for part in answers
    )
    return OutsideState(game, round, tor, top)
