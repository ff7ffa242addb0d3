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
import sys
import time
from base64 import b64decode, b64encode
from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from functools import cached_property
from hashlib import sha256
from io import BytesIO
from itertools import count
from math import prod
from pathlib import Path
from threading import Thread
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from roletrust_env.arrays import Array, namespace
from roletrust_env.errors import printable, short, validation_message
from roletrust_env.registry import make_entry, parse_entry, parse_settings
from roletrust_env.shapes import PerPair, PerProvider, PerRater
from roletrust_env.trust.grid_run import GridRun, check_grid_memory, pairs_of
from roletrust_env.trust.key_index import Floats
from roletrust_env.trust.links import HttpLink, ProcessLink
from roletrust_env.trust.model import Peers, Traits, TrustModel, registry
from roletrust_env.trust.ratings import Published, Ratings

KINDS = ("exec", "http", "https")  # of addresses, before the first colon
MOST_GAMES = 20_000
"""Number of games that a program or a service must remember; of more, the oldest ones are over."""

_TOGETHER = 200_000  # values of trust in the answers to messages that are sent at once
_STATES = 8  # of an isolated model that are kept
_SAME = 1e-6  # difference of trust in a game alone and in a batch that rounding explains
_BUFFER = 1_000_000  # bytes of messages that are read at once
_METHODS = ("judge_trust", "preference")  # that a model may have

Shape = tuple[int, int]  # numbers of raters S and of providers P
Rating = tuple[int, int, float]
"""Index of the rater, index of the provider, and rating in [0, 1]."""
Rounds = Sequence[Sequence[Rating]]
"""Ratings of several rounds or games."""

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


def _line(game: int, round: int, shape: Shape, ratings: Sequence[Rating]) -> str:
    """Return the message of a round of a game."""
    game_and_round = {"game": game, "round": round, "raters": shape[0], "providers": shape[1]}
    return json.dumps({**game_and_round, "ratings": ratings})


def _packed(*arrays: Array | None) -> list[str | None]:
    """Return arrays in the format NPY, as base64."""
    texts: list[str | None] = []
    for array in arrays:
        stream = BytesIO()
        if array is not None:
            np.save(stream, np.asarray(array), allow_pickle=False)
        texts.append(b64encode(stream.getvalue()).decode() or None)
    return texts


def _unpacked(texts: Sequence[str | None]) -> list[Any]:
    return [text and np.load(BytesIO(b64decode(text)), allow_pickle=False) for text in texts]


def _to_arrays(ratings: Ratings) -> list[Array | None]:
    """Return the values in the mask and the mask, also of the experience if it is different."""
    own = ratings.experience
    mask, values = ratings.mask, ratings.values
    first = [values if mask is None else values[mask], mask]
    return first if own is ratings else [*first, *_to_arrays(own)]


def _from_arrays(values: Array, mask: Array | None, *own: Array | None) -> Ratings:
    """Return the ratings of which `_to_arrays` returned the arrays."""
    if mask is not None:
        given, values = values, np.zeros(mask.shape, values.dtype)
        values[mask] = given
    return Ratings(values, mask, experience=_from_arrays(*own) if own else None)


def _column(array: Array, game: tuple[int, ...]) -> Any:
    """Return the part of an array that is about one game of a batch, with one axis for it."""
    return array[(..., *game, None)]


def _one_game(ratings: Ratings, game: tuple[int, ...]) -> Ratings:
    own = ratings.experience
    experience = None if own is ratings else _one_game(own, game)
    mask = None if ratings.mask is None else _column(ratings.mask, game)
    return Ratings(_column(ratings.values, game), mask, experience=experience)


class _Client(Published):
    """A trust model at the other side of a link."""

    differentiable = False
    _link: Any

    def __init__(self) -> None:
        self._over = list[int]()  # numbers of games; the next message says that they are over

    def _ask(self, lines: Sequence[str], shape: Shape = (0, 0)) -> Iterator[_Answer]:
        """Send messages, many at a time, and yield their answers, with trust of a shape of agents.

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
        except ValidationError as error:
            wrong = f"{validation_message(error)}, in its answer {line.decode(errors='replace')}"
            raise ValueError(f"{self}: {short(wrong.strip())}") from None
        sizes = len(answer.raters or range(shape[0])), len(answer.providers)
        if answer.error or sizes != shape:
            wrong = f"it has trust of {sizes} raters and providers; it must be of {shape}"
            raise ValueError(f"{self}: {short(answer.error or wrong)}")
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
        # Ratings of a game that further games begin as copies of, and its number.
        self._past: tuple[Rounds, int] | None = None

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
        columns = (ratings.values, ratings.weights)
        values, rated = (np.asarray(x).reshape(*ratings.shape, -1) for x in columns)
        given = values.tolist()
        listed = [
            [(i, j, given[i][j][game]) for i, j in np.argwhere(rated[..., game]).tolist()]
            for game in range(len(numbers))
        ]
        after = [round + 1 for round in rounds]
        answers = self._send(numbers, after, ratings.shape, listed)
        return _state(ratings.values, numbers, after, answers)

    def replay(self, shape: Shape, past: Rounds, end: Rounds) -> Floats:
        """Play a game of known rounds, and return the trust in the providers at its end, shape
        (P,).

        The game is then over. If the other side can copy games, the past is played once, and each
        further game with the same past begins as its copy.

        Args:
            shape: Numbers of raters and providers, (S, P).
            past: Ratings of the first rounds; round 0 has none.
            end: Ratings of the rounds after it.

        Raises:
            ValueError: The other side fails, or its answer is wrong.
        """
        number, copies = next(self._numbers), False
        if self._past is None or self._past[0] is not past:
            lines = [_line(number, round, shape, given) for round, given in enumerate(past)]
            for answer in self._ask(lines, shape):
                copies = copies or answer.copies
            self._past = (past, number) if copies else None
        begin = []
        if self._past is not None:
            number = next(self._numbers)
            begin = [json.dumps({"game": number, "copy": self._past[1]})]
        lines = [_line(number, round, shape, given) for round, given in enumerate(end, len(past))]
        for answer in self._ask([*begin, *lines], shape):
            last = answer
        self._over.append(number)
        return np.array(last.providers)

    def _begin(self, shape: Shape, games: int) -> tuple[list[int], list[_Answer]]:
        """Begin games, and return their numbers and the answers."""
        numbers = [next(self._numbers) for _ in range(games)]
        return numbers, self._send(numbers, [0] * games, shape, [[]] * games)

    def _send(self, numbers: Any, rounds: Any, shape: Shape, listed: Rounds) -> list[_Answer]:
        """Send a message for each game and return the answers."""
        games = zip(numbers, rounds, listed, strict=True)
        lines = [_line(number, round, shape, given) for number, round, given in games]
        answers = list(self._ask(lines, shape))
        self._rounds.update(zip(numbers, rounds, strict=True))
        for oldest in list(self._rounds)[:-MOST_GAMES]:
            del self._rounds[oldest]
            self._over.append(oldest)
        return answers


def _state(like: Array, numbers: Any, rounds: Any, answers: list[_Answer]) -> RemoteState:
    xp, batch = namespace(like), like.shape[2:]
    tor = np.array([answer.raters or [1.0] * len(like) for answer in answers])
    top = np.array([answer.providers for answer in answers])
    parts = (np.reshape(numbers, batch), np.reshape(rounds, batch))
    trusts = (part.T.reshape(-1, *batch) for part in (tor, top))
    return RemoteState(
        *(xp.asarray(part, device=like.device) for part in parts),
        *(xp.asarray(part, dtype=like.dtype, device=like.device) for part in trusts),
    )


class RemoteFactory:
    """Factory of the trust model at an address, with a hash of the address and of the files that
    its command names.
    """

    kind = RemoteModel

    def __init__(self, address: str) -> None:
        files = [Path(word) for word in address.partition(":")[2].split()]
        contents = [file.read_bytes() for file in files if file.is_file()]
        self.address = address
        self.fingerprint = sha256(b"".join([address.encode(), *contents])).hexdigest()

    def __call__(self) -> RemoteModel:
        """Return the model."""
        return RemoteModel(self.address)


class IsolatedState(NamedTuple):
    """Number of the state in the other process, shape (...); trust of the raters, of the providers,
    and of each provider as each rater sees it, shape (S, P, ...), None for a central model.
    """

    number: Array
    tor: Array
    top: Array
    judged: Array | None


class IsolatedModel(_Client):
    """A trust model in a process of its own, which ends with this object. It runs on NumPy arrays,
    and keeps the latest 8 states, so a game cannot go on from earlier ones.

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
        before = self._number(state)
        after = self._play(ratings.values, before, _to_arrays(ratings))
        if self._second:
            game, alone = self._alone[before]
            self._compare(after, game, self._second.update(alone, _one_game(ratings, game)))
        return after

    def _preference(self, state: IsolatedState, noise: Array) -> Array:
        (preference,) = self._arrays({"game": self._number(state), "choose": True}, [noise])
        return preference

    def _compare(self, state: IsolatedState, game: tuple[int, ...], alone: IsolatedState) -> None:
        """Remember the state of the game that is played alone; refuse other trust in the batch."""
        for own, other in zip(state[1:], alone[1:], strict=True):
            difference = 0.0 if own is None else abs(_column(own, game) - other).max()
            if not difference <= _SAME:
                raise ValueError(
                    f"{self}: trust in game {game} of a batch differs by {difference:.2g} from "
                    "that in the same game alone; it must not depend on other games"
                )
        self._alone[self._latest] = game, alone
        self._alone.pop(self._latest - _STATES, None)

    def _number(self, state: IsolatedState) -> int:
        """Return the number of a state; refuse a mixture of states, and one that is too old."""
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
        """Send a message with arrays, and return those of the answer."""
        (answer,) = self._ask([json.dumps({**message, "arrays": _packed(*given)})])
        try:
            return _unpacked(answer.arrays)
        except Exception:  # bytes that are not those of an array raise many things
            raise ValueError(f"{self}: its answer has no arrays of numbers") from None


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

    def answer(self, line: str | bytes) -> str | None:
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
            wanted = model.preference(state, *_unpacked(message.arrays))
            return json.dumps({"arrays": _packed(wanted)})
        run = self._games[message.game] = self._played(message)
        if message.arrays:
            judged = model.judge_trust(run.state) if methods["judge_trust"] else None
            return json.dumps({"arrays": _packed(run.rater_trust, run.provider_trust, judged)})
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
        shape, arrays = (message.raters, message.providers), _unpacked(message.arrays)
        source = message.game if message.copied is None else message.copied
        if message.copied is None and message.round == 0:
            if arrays:
                return GridRun(self._model, *arrays)
            if message.ratings or not all(shape):
                raise ValueError(
                    f"game {source} begins with {len(message.ratings)} ratings, {shape[0]} raters "
                    f"and {shape[1]} providers; it must begin without ratings, with both roles"
                )
            check_grid_memory(self._model, shape)
            return GridRun(self._model, np.zeros(shape), pairs_of(shape, one_role=True))
        run = copy(self._run(source))
        if arrays:
            run.update(_from_arrays(*arrays))
        elif message.round or message.ratings:
            table = np.array(message.ratings).reshape(-1, 3)
            raters, providers = table[:, :2].T.astype(np.int64)
            run.play(raters, providers, table[:, 2])
            if (run.rounds, run.shape) != (message.round, shape):
                raise ValueError(
                    f"game {source} goes to round {run.rounds} with {run.shape[0]} raters and "
                    f"{run.shape[1]} providers; the message is of round {message.round} with "
                    f"{shape[0]} and {shape[1]}"
                )
        return run


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
        *offered: Further parameters, each as `name=value`, see `IsolatedModel`.
    """
    with open(0, "rb", _BUFFER) as messages, open(os.dup(1), "w") as answers:
        os.dup2(2, 1)
        Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
        try:
            entry, name, parameters = parse_entry(registry, text)
            further = entry.accepted_parameters(name, parse_settings(offered, "MODEL"))
            service = TrustService(make_entry(entry, name, {**further, **parameters}, text))
        except ValueError as error:
            sys.exit(printable(str(error)))
        for line in messages:
            try:
                answer = service.answer(line)
            except (Exception, SystemExit) as error:  # a foreign model may raise anything
                kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
                answer = json.dumps({"error": kind + str(error)})
            if answer is not None:
                print(answer, file=answers, flush=True)


if __name__ == "__main__":
    if not sys.argv[1:] or sys.argv[1].startswith("-"):
        sys.exit("usage: python -m roletrust_env.trust.remote MODEL [NAME=VALUE ...]")
    main(*sys.argv[1:])
