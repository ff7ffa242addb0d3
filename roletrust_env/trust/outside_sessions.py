"""The games of a trust model outside this process: requests and answers, one line of JSON for each game and round."""

import json
import secrets
from collections.abc import Sequence
from itertools import count
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.trust.outside_links import HttpLink, Link, ProcessLink

MOST_GAMES = 20_000
"""Number of games that the other side has to remember. When there are more, the oldest ones are over."""

_SHOWN = 100  # characters of a wrong answer

Floats = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]
Shape = tuple[int, int]


class AnswerError(ValueError):
    """An answer is not what the protocol allows."""


class Answers(NamedTuple):
    """Trust in G games: of the raters, (S, G), 1 if the model has none, and of the providers, (P, G)."""

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
        self.link: Link = ProcessLink(command) if kind == "exec" else HttpLink(address)
        self.rates_raters: bool | None = None
        # A service may have games of several processes, which do not know of each other.
        self._numbers = count(secrets.randbits(32) << 20)
        self._rounds: dict[int, int] = {}

    def begin(self, shape: Shape, games: int) -> tuple[Numbers, Answers]:
        """Begin games, and return their numbers and the trust before any rating.

        Args:
            shape: Numbers of raters and providers, (S, P).
            games: Number of games G.
        """
        numbers = [next(self._numbers) for _ in range(games)]
        answers = self._ask([_request(number, 0, shape, []) for number in numbers], shape)
        self._rounds.update(dict.fromkeys(numbers, 0))
        if len(self._rounds) > MOST_GAMES:
            self.end(list(self._rounds)[: len(self._rounds) - MOST_GAMES])
        return np.array(numbers, np.int64), answers

    def play(self, numbers: Numbers, rounds: Numbers, ratings: Floats, mask: Any) -> Answers:
        """Send a round of ratings for each game, and return the trust after it.

        Args:
            numbers: Numbers of the games, (G,).
            rounds: Numbers of the rounds, (G,); 1 is the first one.
            ratings: Ratings, (S, P, G).
            mask: Whether a rater rated a provider, boolean, (S, P, G).
        """
        shape = ratings.shape[:2]
        requests = []
        for k, (number, round) in enumerate(zip(numbers.tolist(), rounds.tolist(), strict=True)):
            raters, providers = np.nonzero(mask[..., k])
            given = ratings[raters, providers, k]
            listed = [list(one) for one in zip(raters.tolist(), providers.tolist(), given.tolist(), strict=True)]
            requests.append(_request(number, round, shape, listed))
        answers = self._ask(requests, shape)
        self._rounds.update(zip(numbers.tolist(), rounds.tolist(), strict=True))
        return answers

    def round_of(self, number: int) -> int | None:
        """Return the round that a game has reached; None if it is over."""
        return self._rounds.get(number)

    def end(self, numbers: list[int]) -> None:
        """Tell the other side that games are over."""
        for number in numbers:
            del self._rounds[number]
        self.link.tell(json.dumps({"over": numbers}))

    def _ask(self, requests: Sequence[str], shape: Shape) -> Answers:
        lines = self.link.ask(requests)
        answers = Answers(np.ones((shape[0], len(lines))), np.empty((shape[1], len(lines))))
        for k, line in enumerate(lines):
            try:
                trust = _read(line, shape)
            except AnswerError as error:
                raise AnswerError(f"{error} in its answer {line.strip()[:_SHOWN]!r}") from None
            answers.top[:, k] = trust["providers"]
            answers.tor[:, k] = trust.get("raters", 1.0)
            self.rates_raters = "raters" in trust
        return answers


def _request(number: int, round: int, shape: Shape, ratings: list[list[float]]) -> str:
    sizes = {"raters": shape[0], "providers": shape[1]}
    return json.dumps({"game": number, "round": round, **sizes, "ratings": ratings})


def _read(line: str, shape: Shape) -> dict[str, list[float]]:
    """Return the lists of an answer.

    Raises:
        AnswerError: It is no JSON, or a list is missing, has another length, or has something outside [0, 1].
    """
    try:
        data = json.loads(line)
    except (ValueError, RecursionError):
        raise AnswerError("there is no JSON") from None
    if not isinstance(data, dict) or "providers" not in data:
        raise AnswerError("there is no 'providers'")
    lists = {name: data[name] for name in ("raters", "providers") if name in data}
    for name, values in lists.items():
        size = shape[name == "providers"]
        if not isinstance(values, list) or len(values) != size:
            raise AnswerError(f"{name!r} is no list of {size} numbers")
        if not all(type(value) in (int, float) and 0 <= value <= 1 for value in values):
            raise AnswerError(f"{name!r} has something else than numbers in [0, 1]")
    return lists
