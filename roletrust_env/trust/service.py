"""A trust model of this package for programs in any language: the other side of
`roletrust_env.trust.outside`.
"""

import json
from copy import copy
from http.server import BaseHTTPRequestHandler, HTTPServer, ThreadingHTTPServer
from threading import Lock
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from roletrust_env.errors import printable, validation_message
from roletrust_env.trust.grid_run import GridRun, pairs_of
from roletrust_env.trust.model import TrustModel

MOST_GAMES = 100_000
"""Number of games that a service remembers."""

_MOST_BYTES = 64_000_000  # of a request
_MOST_CELLS = 1_000_000  # pairs of a rater and a provider in a game
_PATIENCE_S = 30.0  # with a client that does not go on
_Count = Annotated[int, Field(ge=1, le=100_000)]
_Place = Annotated[int, Field(ge=0)]
_Rating = tuple[_Place, _Place, Annotated[float, Field(ge=0, le=1)]]


class _Over(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    over: list[int]


class _Copy(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    game: int
    copied: Annotated[int, Field(alias="copy")]


class _Round(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    game: int
    round: Annotated[int, Field(ge=0)]
    raters: _Count
    providers: _Count
    ratings: list[_Rating]


class TrustService:
    """Answers the messages of the protocol for models outside, see docs/guide/outside.md.

    Example:
        >>> from roletrust_env import make_trust_model
        >>> service = TrustService(make_trust_model("mean"))
        >>> service.answer('{"game": 1, "round": 0, "raters": 1, "providers": 2, "ratings": []}')
        '{"providers": [0.5, 0.5], "copies": true}'
        >>> service.answer('{"game": 1, "round": 1, "raters": 1, "providers": 2, "ratings": [[0, 1, 0.9]]}')
        '{"providers": [0.5, 0.7]}'
    """  # noqa: E501

    def __init__(self, model: TrustModel[Any]) -> None:
        self._model = model
        self._games: dict[int, GridRun] = {}

    def answer(self, line: str) -> str | None:
        """Return the answer to a message, one line of JSON without its end; None if a message has
        no answer.

        Raises:
            ValueError: The message is not valid, or is of a game that is in another round.
        """
        try:
            data = json.loads(line)
            if isinstance(data, dict) and "over" in data:
                for game in _Over.model_validate_json(line).over:
                    self._games.pop(game, None)
                return None
            kind: type[_Copy | _Round] = (
                _Copy if isinstance(data, dict) and "copy" in data else _Round
            )
            message = kind.model_validate_json(line)
        except ValidationError as error:
            raise ValueError(validation_message(error)) from None
        except (ValueError, RecursionError) as error:
            raise ValueError(f"there is no JSON: {error}") from None
        run = self._copied(message) if isinstance(message, _Copy) else self._play(message)
        trust: dict[str, Any] = {"providers": _values("provider_trust", run.provider_trust)}
        if self._model.rates_raters:
            trust["raters"] = _values("rater_trust", run.rater_trust)
        if not run.rounds:
            trust["copies"] = True
        self._games[message.game] = run
        return json.dumps(trust)

    def answer_lines(self, text: str) -> str:
        """Return the answers to the messages of a text, one on each line; those before a wrong
        message count.

        Raises:
            ValueError: See `answer`.
        """
        answers = [self.answer(line) for line in text.splitlines() if line.strip()]
        return "".join(f"{answer}\n" for answer in answers if answer is not None)

    def _copied(self, message: _Copy) -> GridRun:
        """Return the run of a game of which another begins as a copy; a round makes a new run of
        it.
        """
        if message.copied not in self._games:
            raise ValueError(f"game {message.copied} is not in progress, so it cannot be copied")
        self._check_number(message.game)
        return self._games[message.copied]

    def _check_number(self, game: int) -> None:
        if game not in self._games and len(self._games) >= MOST_GAMES:
            raise ValueError(
                f"{MOST_GAMES:,} games are in progress, which is the most; say which ones are over"
            )

    def _play(self, message: _Round) -> GridRun:
        """Return a run after the round of a message; the one before it is as it was."""
        game, shape = message.game, (message.raters, message.providers)
        if shape[0] * shape[1] > _MOST_CELLS:
            raise ValueError(
                f"game {game} has {shape[0]} x {shape[1]} pairs; the most are {_MOST_CELLS:,}"
            )
        if message.round == 0:
            if message.ratings:
                raise ValueError(f"game {game} begins with ratings; they come from round 1 on")
            self._check_number(game)
            return GridRun(self._model, np.zeros(shape), pairs_of(shape, one_role=True))
        before = self._games.get(game)
        if before is None or before.rounds + 1 != message.round or before.shape != shape:
            known = (
                "is not in progress"
                if before is None
                else f"waits for round {before.rounds + 1} of {before.shape}"
            )
            raise ValueError(
                f"game {game} {known}; the message is of round {message.round} of {shape}"
            )
        seen = set()
        for rater, provider, _ in message.ratings:
            if rater >= shape[0] or provider >= shape[1]:
                raise ValueError(
                    f"game {game} has a rating of provider {provider} by rater {rater}; it has "
                    f"{shape}"
                )
            if (rater, provider) in seen:
                raise ValueError(
                    f"game {game} has two ratings of provider {provider} by rater {rater} in a "
                    "round"
                )
            seen.add((rater, provider))
        run, table = copy(before), np.array(message.ratings).reshape(-1, 3)
        run.play(table[:, 0].astype(np.int64), table[:, 1].astype(np.int64), table[:, 2])
        return run


def _values(name: str, trust: Any) -> list[float]:
    """Return the trust of all agents of a role.

    Raises:
        ValueError: A value is outside [0, 1].
    """
    if not ((trust >= 0) & (trust <= 1)).all():
        raise ValueError(f"{name} of the model has values outside [0, 1]")
    values: list[float] = trust.tolist()
    return values


def http_server(service: TrustService, host: str, port: int) -> HTTPServer:
    """Return a server that answers POST requests, each with messages on lines of their own.

    A request with a message that is not valid has the status 400 and the reason as its body, one at
    which the model fails the status 500; the messages before it count.

    Args:
        service: Service that answers.
        host: Address to listen at, such as `127.0.0.1`.
        port: Port; 0 is any free one.

    Raises:
        OSError: The port is in use.
    """
    lock = Lock()

    class Handler(BaseHTTPRequestHandler):
        timeout = _PATIENCE_S

        def do_POST(self) -> None:
            size = self.headers.get("Content-Length", "")
            if not (size.isascii() and size.isdigit()) or int(size) > _MOST_BYTES:
                self._respond(
                    400, f"Content-Length must be a number of at most {_MOST_BYTES} bytes\n"
                )
                return
            text = self.rfile.read(int(size)).decode("utf-8", "replace")
            try:
                with lock:
                    answers = service.answer_lines(text)
            except ValueError as error:
                self._respond(400, f"{printable(str(error))}\n")
            except Exception as error:  # a model of another package may raise anything
                self._respond(500, f"{type(error).__name__}: {printable(str(error))}\n")
            else:
                self._respond(200, answers)

        def log_message(self, *arguments: object) -> None:
            pass

        def _respond(self, status: int, text: str) -> None:
            body = text.encode()
            self.send_response(status)
            self.send_header(
                "Content-Type",
                "application/x-ndjson" if status == 200 else "text/plain; charset=utf-8",
            )
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

    class Server(ThreadingHTTPServer):
        def handle_error(self, *arguments: object) -> None:
            pass  # a client that went away is no news

    return Server((host, port), Handler)
