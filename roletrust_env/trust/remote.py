"""A trust model in another process, in any language: ratings go there, and trust comes back.

Messages and answers are lines of JSON, see docs/guide/outside.md. `RemoteModel` is the client of a
program or an HTTP service, with a message for each game. `TrustService` is the other side for
models in Python, and `python -m roletrust_env.trust.remote MODEL` runs it on standard input.

`IsolatedModel` is the client of this service for a model of another package, with a message for
each batch of games. Such a process is not a sandbox: it has the rights of its user. But a model in
it cannot reach the game by the call stack or by modules, and its answers are read as numbers only.
"""

import json
import os
import secrets
import shlex
import subprocess
import sys
import time
import weakref
from base64 import b64decode, b64encode
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from copy import copy
from functools import cached_property, partial
from hashlib import sha256
from io import BytesIO
from itertools import count
from math import prod
from pathlib import Path
from threading import Thread
from typing import Annotated, Any, NamedTuple, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from roletrust_env.arrays import Array, namespace
from roletrust_env.errors import printable, validation_message
from roletrust_env.registry import make_entry, parse_entry, parse_settings
from roletrust_env.shapes import PerPair, PerProvider, PerRater
from roletrust_env.trust.grid_run import GridRun, check_grid_memory, pairs_of
from roletrust_env.trust.key_index import Floats
from roletrust_env.trust.model import Peers, Traits, TrustModel, registry
from roletrust_env.trust.ratings import Published, Ratings

KINDS = ("exec", "http", "https")
"""Beginnings of an address, before its first colon."""

MOST_GAMES = 20_000
"""Number of games that a program or a service has to remember. When there are more, the oldest ones
are over."""

LIMIT_S = 300.0
"""Longest time, in seconds, that the other side may take for an answer."""

_MOST_BYTES = 256_000_000  # of an answer
_SHOWN = 300  # characters of an answer and of an error of the other side
_ENDS_S = 1.0  # seconds for a process without output to end by itself
_TOGETHER = 200_000  # values of trust in the answers to messages that are sent at once
_STATES = 8  # of an isolated model that are kept
_SAME = 1e-6  # difference of trust in a game alone and in a batch that rounding explains
_METHODS = ("judge_trust", "preference")  # that a model may have

T = TypeVar("T")
Shape = tuple[int, int]


# --- lines there and back
# ---------------------------------------------------------------------------


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
                shlex.split(command), stdin=pipe, stdout=pipe, stderr=pipe, env=env
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
        said = "".join(f": {_shown(line.strip())}" for line in list(self._complaints))
        raise ValueError(f"it has {what}{said}")

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
            shown = _shown(f"{type(error).__name__}: {error}".encode())
            raise ValueError(f"it gave no HTTP answer ({shown})") from None
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


def _shown(text: bytes) -> str:
    return printable(text.decode(errors="replace")[:_SHOWN])


# --- messages and answers
# ---------------------------------------------------------------------------

_Index = Annotated[int, Field(ge=0)]
_Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]


class _Message(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    over: list[int] | None = None
    game: int = 0
    copied: Annotated[int | None, Field(alias="copy")] = None
    round: _Index = 0
    raters: _Index = 0
    providers: _Index = 0
    ratings: list[tuple[_Index, _Index, _Share]] = []
    # Of `IsolatedModel`:
    traits: bool = False
    arrays: list[str | None] = []
    choose: bool = False


class _Answer(BaseModel):
    model_config = ConfigDict(strict=True)

    error: str = ""
    providers: list[_Share] = []
    raters: list[_Share] | None = None
    copies: bool = False
    # To `IsolatedModel`:
    arrays: list[str | None] = []
    rates_raters: bool = True
    family: str = ""
    judge_trust: bool = False
    preference: bool = False


def round_tail(round: int, shape: Shape, ratings: list[list[float]]) -> str:
    """Return the message of a round without the number of its game, which comes first."""
    return json.dumps(
        {"round": round, "raters": shape[0], "providers": shape[1], "ratings": ratings}
    )[1:]


def _headed(number: int, tail: str) -> str:
    return f'{{"game": {number}, {tail}'


def _packed(array: Array | None) -> str | None:
    """Return an array in the format NPY, as base64."""
    if array is None:
        return None
    stream = BytesIO()
    np.save(stream, np.asarray(array), allow_pickle=False)
    return b64encode(stream.getvalue()).decode()


def _unpacked(text: str | None) -> Any:
    return text and np.load(BytesIO(b64decode(text)), allow_pickle=False)


def _to_arrays(ratings: Ratings) -> list[Array | None]:
    """Return the values and the mask of ratings, and of the experience of the raters if it is
    different.
    """
    own = ratings.experience
    return [ratings.values, ratings.mask, *([] if own is ratings else [own.values, own.mask])]


def _from_arrays(values: Array, mask: Array | None, *own: Array | None) -> Ratings:
    """Return the ratings of which `_to_arrays` returned the arrays."""
    return Ratings(values, mask, experience=Ratings(*own) if own else None)


# --- the models
# -------------------------------------------------------------------------------------


class _Client(Published):
    """A trust model at the other side of a link."""

    differentiable = False
    _link: Any

    def __init__(self) -> None:
        self._over = list[int]()  # numbers of games; the next message says that they are over

    def _ask(self, lines: Sequence[str], shape: Shape = (0, 0)) -> Iterator[_Answer]:
        """Send messages, many at a time, and yield their answers.

        Args:
            lines: Messages.
            shape: Numbers of raters and providers of which the answers have the trust.

        Raises:
            ValueError: The other side fails, or answers what is not allowed.
        """
        many = max(1, _TOGETHER // (sum(shape) + 1))
        for at in range(0, len(lines), many):
            sent = [f"{line}\n" for line in lines[at : at + many]]
            if self._over:
                sent[0] = json.dumps({"over": self._over}) + "\n" + sent[0]
                self._over = []
            try:
                received = self._link.ask(sent)
            except ValueError as error:
                raise ValueError(f"{self}: {error}") from None
            for line in received:
                yield self._read(line, shape)

    def _read(self, line: bytes, shape: Shape) -> _Answer:
        try:
            answer = _Answer.model_validate_json(line)
            error = answer.error
        except ValidationError as wrong:
            error = validation_message(wrong)
        else:
            sizes = len(answer.raters or range(shape[0])), len(answer.providers)
            if not error and sizes != shape:
                error = f"it has trust of {sizes} raters and providers; it must be of {shape}"
        if error:
            raise ValueError(f"{self}: {_shown(error.encode())}, in its answer {_shown(line)!r}")
        return answer


class RemoteState(NamedTuple):
    """Numbers of the games at the other side and their rounds, (...) each; trust of the raters and
    the providers.
    """

    game: Array
    round: Array
    tor: PerRater
    top: PerProvider


class RemoteModel(_Client):
    """A trust model that is a program or an HTTP service, which begins when it is first needed.

    It cannot go back to an earlier round of a game, so a game with it cannot branch, and it has no
    gradients. A copy of this object has a process of its own.

    Attributes:
        address: `exec:` and a command, such as `exec:./my-model --fast`, or the URL of a service.

    Raises:
        ValueError: The address has another form.
    """

    def __init__(self, address: str) -> None:
        super().__init__()
        kind, _, rest = address.partition(":")
        if kind not in KINDS or not rest.strip("/ "):
            raise ValueError(
                f"address is {address!r}; it must be exec:COMMAND, such as exec:./my-model, or a "
                "URL, such as http://127.0.0.1:8080"
            )
        self.address = address
        # A service may have games of several processes, which do not know of each other.
        self._numbers = count(secrets.randbits(32) << 20)
        self._rounds: dict[int, int] = {}
        # Messages of a game that further games begin as copies of, and its number.
        self._past: tuple[Sequence[str], int] | None = None

    def __repr__(self) -> str:
        """Return the call that makes the model."""
        return f"RemoteModel({self.address!r})"

    def __reduce__(self) -> Any:
        """Make copies, also in another process, from the address."""
        return RemoteModel, (self.address,)

    @cached_property
    def _link(self) -> ProcessLink | HttpLink:
        kind, _, command = self.address.partition(":")
        return ProcessLink(command) if kind == "exec" else HttpLink(self.address)

    @cached_property
    def rates_raters(self) -> bool:
        """True if its answers have trust of raters; a game of one rater and one provider shows
        it.
        """
        return self._begin((1, 1), 1)[1][0].raters is not None

    def start(self, like: PerPair) -> RemoteState:
        """Return the state before any rating, which one game shows. See `TrustModel.start`.

        Raises:
            ValueError: The other side fails, or its answer is wrong.
        """
        none = [0] * prod(like.shape[2:])
        return _state(like, none, none, self._begin(like.shape[:2], 1)[1] * len(none))

    def update(self, state: RemoteState, ratings: Ratings) -> RemoteState:
        """Send a round of ratings, and return the state with the trust that comes back. See
        `TrustModel.update`.

        Raises:
            ValueError: The other side fails, its answer is wrong, or the game has gone on there.
        """
        numbers, rounds = (np.asarray(x).reshape(-1).tolist() for x in (state.game, state.round))
        begun = iter(self._begin(ratings.shape, rounds.count(0))[0])
        numbers = [next(begun) if round == 0 else numbers[k] for k, round in enumerate(rounds)]
        for number, round in zip(numbers, rounds, strict=True):
            if self._rounds.get(number) != round:
                raise ValueError(
                    f"{self} cannot go back to round {round} of a game: a model outside cannot "
                    f"branch, be copied in a game, or play more than {MOST_GAMES:,} games at once"
                )
        values, rated = (
            np.asarray(x).reshape(*ratings.shape, -1) for x in (ratings.values, ratings.weights)
        )
        given = values.tolist()
        listed = [
            [(i, j, given[i][j][game]) for i, j in np.argwhere(rated[..., game]).tolist()]
            for game in range(len(numbers))
        ]
        after = [round + 1 for round in rounds]
        return _state(
            ratings.values, numbers, after, self._send(numbers, after, ratings.shape, listed)
        )

    def replay(self, shape: Shape, past: Sequence[str], tails: Sequence[str]) -> Floats:
        """Play a game of known rounds, and return the trust in the providers at its end, shape
        (P,).

        The game is then over. If the other side can copy games, the past is played once, and each
        further game with the same past begins as its copy.

        Args:
            shape: Numbers of raters and providers, (S, P).
            past: Messages of the first rounds, see `round_tail`.
            tails: Messages of the rounds after it.

        Raises:
            ValueError: The other side fails, or its answer is wrong.
        """
        number = next(self._numbers)
        lines = [_headed(number, tail) for tail in past]
        if self._past is None or self._past[0] is not past:
            self._past = None
            for answer in self._ask(lines, shape):
                if answer.copies:
                    self._past = past, number
            lines = []
        if self._past is not None:
            number = next(self._numbers)
            lines = [json.dumps({"game": number, "copy": self._past[1]})]
        for answer in self._ask([*lines, *(_headed(number, tail) for tail in tails)], shape):
            last = answer
        self._over.append(number)
        return np.array(last.providers)

    def _begin(self, shape: Shape, games: int) -> tuple[list[int], list[_Answer]]:
        """Begin games, and return their numbers and the answers."""
        numbers = [next(self._numbers) for _ in range(games)]
        return numbers, self._send(numbers, [0] * games, shape, [[]] * games)

    def _send(
        self, numbers: list[int], rounds: list[int], shape: Shape, listed: list[Any]
    ) -> list[_Answer]:
        """Send a message for each game and return the answers."""
        games = zip(numbers, rounds, listed, strict=True)
        lines = [_headed(number, round_tail(round, shape, given)) for number, round, given in games]
        answers = list(self._ask(lines, shape))
        self._rounds.update(zip(numbers, rounds, strict=True))
        for oldest in list(self._rounds)[:-MOST_GAMES]:
            del self._rounds[oldest]
            self._over.append(oldest)
        return answers


def _state(like: Array, numbers: Any, rounds: Any, answers: list[_Answer]) -> RemoteState:
    xp, batch, device = namespace(like), like.shape[2:], like.device
    tor = [answer.raters or [1.0] * len(like) for answer in answers]
    top = [answer.providers for answer in answers]
    return RemoteState(
        *(xp.asarray(np.reshape(part, batch), device=device) for part in (numbers, rounds)),
        *(
            xp.asarray(np.array(part).T.reshape(-1, *batch), dtype=like.dtype, device=device)
            for part in (tor, top)
        ),
    )


class RemoteFactory:
    """Factory of the trust model at an address.

    Attributes:
        fingerprint: Hash of the address, and of the files that its command names.

    Args:
        address: See `RemoteModel`.
    """

    kind = RemoteModel

    def __init__(self, address: str) -> None:
        digest = sha256(address.encode())
        for word in address.partition(":")[2].split() if address.startswith("exec:") else ():
            with suppress(OSError):
                digest.update(Path(word).read_bytes())
        self.address, self.fingerprint = address, digest.hexdigest()

    def __call__(self) -> RemoteModel:
        """Return the model."""
        return RemoteModel(self.address)


class IsolatedState(NamedTuple):
    """State of an isolated model.

    Attributes:
        number: Number of the state in the other process, shape (...).
        tor: Trust of each rater, shape (S, ...).
        top: Trust of each provider, shape (P, ...).
        judged: Trust of each provider as each rater sees it, shape (S, P, ...); None for a central
            model.
    """

    number: Array
    tor: Array
    top: Array
    judged: Array | None


class IsolatedModel(_Client):
    """A trust model in a process of its own, which ends with this object. It runs on NumPy arrays.

    The process keeps the latest 8 states, so a game cannot go on from earlier ones.

    Games of a batch have the same noise, so a model that compares them sees which agents attack.
    Therefore a second process plays one game of each batch, drawn at random, alone: trust must be
    the same there.

    Args:
        text: Text `NAME[:key=value,...]` or `package.module:Class[:key=value,...]`.
        offered: Further parameters, of which the model gets those that it accepts and that the
            text does not give.
        checked: Whether a second process plays games alone.

    Raises:
        ValueError: The model cannot be made.
    """

    takes_peers = True

    def __init__(self, text: str, offered: Mapping[str, float], *, checked: bool = True) -> None:
        super().__init__()
        self._text, self._latest = text, 0
        settings = [f"{name}={value!r}" for name, value in offered.items()]
        command = [sys.executable, "-m", "roletrust_env.trust.remote", text, *settings]
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        self._link = ProcessLink(shlex.join(command), env)
        self._second = IsolatedModel(text, offered, checked=False) if checked else None
        # By the number of a state: the index of the game that is played alone, and its state there.
        self._alone: dict[int, tuple[tuple[int, ...], IsolatedState]] = {}
        (traits,) = self._ask(['{"traits": true}'])
        self.rates_raters, self.family = traits.rates_raters, traits.family
        self._methods = {name for name in _METHODS if getattr(traits, name)}

    def __repr__(self) -> str:
        """Return the text of the model."""
        return f"{self._text} in a process of its own"

    def __getattr__(self, name: str) -> Any:
        """Return `judge_trust` or `preference` if the model has it."""
        if name not in vars(self).get("_methods", ()):
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        return self._preference if name == "preference" else lambda state: state.judged

    def start(self, like: Array, peers: Peers) -> IsolatedState:
        """Return the state before any rating. See `TrustModel.start`.

        Raises:
            ValueError: The model fails.
        """
        state = self._play(like, None, [like, peers])
        if self._second:
            game = tuple(map(secrets.randbelow, like.shape[2:]))
            self._compare(state, game, self._second.start(_column(like, game), peers))
        return state

    def update(self, state: IsolatedState, ratings: Ratings) -> IsolatedState:
        """Return the state after one more round. See `TrustModel.update`.

        Raises:
            ValueError: The model fails, the state is not one of the latest 8, or trust in a game
                is different when it is played alone.
        """
        before, given = self._number(state), _to_arrays(ratings)
        after = self._play(ratings.values, before, given)
        if self._second:
            game, alone = self._alone[before]
            column = _from_arrays(*(_column(part, game) for part in given))
            self._compare(after, game, self._second.update(alone, column))
        return after

    def _preference(self, state: IsolatedState, noise: Array) -> Array:
        (preference,) = self._arrays({"game": self._number(state), "choose": True}, [noise])
        return preference

    def _compare(self, state: IsolatedState, game: tuple[int, ...], alone: IsolatedState) -> None:
        """Remember the state of the game that is played alone.

        Raises:
            ValueError: Trust in the batch is different.
        """
        for own, other in zip(state[1:], alone[1:], strict=True):
            if own is not None and not (
                (difference := abs(_column(own, game) - other).max()) <= _SAME
            ):
                raise ValueError(
                    f"{self}: trust in a game differs by {difference:.2g} from that in the same "
                    "game alone; it must follow from the ratings of the game, and not from other "
                    "games"
                )
        self._alone[self._latest] = game, alone
        self._alone.pop(self._latest - _STATES, None)

    def _number(self, state: IsolatedState) -> int:
        """Return the number of a state.

        Raises:
            ValueError: It is a mixture of states, or not one of the latest.
        """
        numbers = np.unique(state.number).tolist()
        if len(numbers) != 1 or numbers[0] <= self._latest - _STATES:
            raise ValueError(
                f"{self} keeps the latest {_STATES} states, {self._latest} the newest, and plays "
                f"all games of a batch from one of them, not from {numbers[:_STATES]}"
            )
        return int(numbers[0])

    def _play(self, like: Array, before: int | None, given: list[Array | None]) -> IsolatedState:
        self._latest += 1
        self._over.append(self._latest - _STATES - 1)
        tor, top, judged = self._arrays({"game": self._latest, "copy": before}, given)
        return IsolatedState(np.broadcast_to(self._latest, like.shape[2:]), tor, top, judged)

    def _arrays(self, message: dict[str, Any], given: list[Array | None]) -> list[Any]:
        """Send a message with arrays, and return those of the answer.

        Raises:
            ValueError: The model fails, or its answer has no arrays of numbers.
        """
        (answer,) = self._ask([json.dumps({**message, "arrays": list(map(_packed, given))})])
        try:
            return list(map(_unpacked, answer.arrays))
        except Exception:  # bytes that are not those of an array raise many things
            raise ValueError(f"{self}: its answer has no arrays of numbers") from None


def _column(array: Array | None, game: tuple[int, ...]) -> Any:
    """Return the part of an array that is about one game of a batch, with one axis for it."""
    return None if array is None else array[(..., *game, None)]


# --- the other side
# ---------------------------------------------------------------------------------


class TrustService:
    """Answers the messages of the protocol with the trust of a model in Python.

    Example:
        >>> from roletrust_env import make_trust_model
        >>> service = TrustService(make_trust_model("mean"))
        >>> service.answer('{"game": 1, "round": 0, "raters": 1, "providers": 2, "ratings": []}')
        '{"providers": [0.5, 0.5], "copies": true}'
        >>> service.answer('{"game": 1, "round": 1, "raters": 1, "providers": 2, "ratings": [[0, 1, 0.9]]}')
        '{"providers": [0.5, 0.7]}'
    """  # noqa: E501

    def __init__(self, model: TrustModel[Any]) -> None:
        self._model: Any = model
        self._games: dict[int, GridRun] = {}

    def answer(self, line: str) -> str | None:
        """Return the answer to a message, one line of JSON without its end; None if a message has
        no answer.

        Raises:
            ValueError: The message is not valid, or is of a game that is in another round; or the
                model fails in a round.
            MemoryError: A game has too many agents. The message says how much is allowed.
        """
        try:
            message = _Message.model_validate_json(line)
        except ValidationError as error:
            raise ValueError(validation_message(error)) from None
        if message.over is not None:
            for game in message.over:
                self._games.pop(game, None)
            return None
        model, methods = self._model, {name: hasattr(self._model, name) for name in _METHODS}
        if message.traits:
            return json.dumps({**Traits.of(model)._asdict(), **methods})
        if message.choose:
            state = self._run(message.game).state
            return _answer_arrays(model.preference(state, *map(_unpacked, message.arrays)))
        run = self._games[message.game] = self._played(message)
        if message.arrays:
            judged = model.judge_trust(run.state) if methods["judge_trust"] else None
            return _answer_arrays(run.rater_trust, run.provider_trust, judged)
        trust = {"providers": run.provider_trust.tolist()}
        if model.rates_raters:
            trust["raters"] = run.rater_trust.tolist()
        return json.dumps(trust if run.rounds else {**trust, "copies": True}, allow_nan=False)

    def _run(self, game: int) -> GridRun:
        if game not in self._games:
            raise ValueError(f"game {game} is not in progress; the message of round 0 begins it")
        return self._games[game]

    def _played(self, message: _Message) -> GridRun:
        """Return a run after a message; the one before it is as it was."""
        shape, arrays = (message.raters, message.providers), map(_unpacked, message.arrays)
        if message.copied is not None:
            run = copy(self._run(message.copied))
            if message.arrays:
                run.update(_from_arrays(*arrays))
            return run
        if message.arrays:
            return GridRun(self._model, *arrays)
        if message.round == 0:
            if message.ratings or not all(shape):
                raise ValueError(
                    f"game {message.game} begins with {len(message.ratings)} ratings, {shape[0]} "
                    f"raters and {shape[1]} providers; round 0 has no ratings, and agents of both "
                    "roles"
                )
            check_grid_memory(self._model, shape)
            return GridRun(self._model, np.zeros(shape), pairs_of(shape, one_role=True))
        run, table = copy(self._run(message.game)), np.array(message.ratings).reshape(-1, 3)
        raters, providers = table[:, :2].T.astype(np.int64)
        run.play(raters, providers, table[:, 2])
        if (run.rounds, run.shape) != (message.round, shape):
            raise ValueError(
                f"game {message.game} goes to round {run.rounds} with {run.shape[0]} raters and "
                f"{run.shape[1]} providers; the message is of round {message.round} with "
                f"{shape[0]} and {shape[1]}"
            )
        return run


def _answer_arrays(*arrays: Array | None) -> str:
    return json.dumps({"arrays": list(map(_packed, arrays))})


def _end_with(parent: int) -> None:
    """End this process when its parent has ended, also while the model is busy."""
    while os.getppid() == parent:
        time.sleep(1)
    os._exit(1)


def main(text: str, *offered: str) -> None:
    """Answer the messages on standard input until it ends. A message that is not valid, or at which
    the model fails, is answered by its error. What a model prints goes to standard error.

    Args:
        text: Model, see `IsolatedModel`.
        *offered: Further parameters `name=value`, see `IsolatedModel`.
    """
    with os.fdopen(os.dup(1), "w") as answers:
        os.dup2(2, 1)
        Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
        try:
            entry, name, parameters = parse_entry(registry, text)
            further = entry.accepted_parameters(name, parse_settings(offered, "MODEL"))
            service = TrustService(make_entry(entry, name, {**further, **parameters}, text))
        except ValueError as error:
            sys.exit(printable(str(error)))
        for line in sys.stdin:
            try:
                answer = service.answer(line)
            except (Exception, SystemExit) as error:  # a foreign model may raise anything
                kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
                answer = json.dumps({"error": kind + str(error)})
            if answer is not None:
                print(answer, file=answers, flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:] or [""])
