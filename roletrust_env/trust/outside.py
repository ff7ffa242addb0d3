"""A trust model outside this process, in any language: ratings go there, and trust comes back.

The model learns nothing but ratings, see docs/guide/outside.md.
"""

import weakref
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from math import prod
from pathlib import Path
from typing import NamedTuple

import numpy as np

from roletrust_env.arrays import Array, namespace
from roletrust_env.trust.outside_links import LinkError
from roletrust_env.trust.outside_sessions import MOST_GAMES, AnswerError, Answers, Numbers, Sessions
from roletrust_env.trust.ratings import Ratings

KINDS = ("exec", "http", "https")
"""Beginnings of an address, before its first colon."""


class OutsideState(NamedTuple):
    """Numbers of the games at the other side and their rounds, (...) each; trust of the raters and the providers."""

    game: Array
    round: Array
    tor: Array
    top: Array


@dataclass(frozen=True, eq=False)
class OutsideModel:
    """A trust model that is a process or an HTTP service, which begins when it is first needed.

    It cannot go back to an earlier round of a game, so a game with it cannot branch, and it has no gradients.

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
                f"address is {self.address!r}; it must be exec:COMMAND, such as exec:./my-model, or a URL, such as "
                "http://127.0.0.1:8080"
            )

    @property
    def rates_raters(self) -> bool:
        """Whether its answers have trust of raters; a game of one rater and one provider shows it."""
        if self._sessions().rates_raters is None:
            self._begin(np.zeros((1, 1)))
        return bool(self._sessions().rates_raters)

    def start(self, like: Array) -> OutsideState:
        """Begin the games of a batch. See `TrustModel.start`."""
        numbers, answers = self._begin(like)
        return _state(like, numbers, np.zeros_like(numbers), answers)

    def update(self, state: OutsideState, ratings: Ratings) -> OutsideState:
        """Send a round of ratings, and return the state with the trust that comes back. See `TrustModel.update`.

        Raises:
            ValueError: The other side fails, its answer is wrong, or the game has gone on there.
        """
        values, shape = ratings.values, (*ratings.shape, -1)
        numbers, rounds = (np.asarray(part).reshape(-1) for part in (state.game, state.round))
        numbers = self._at_hand(numbers, rounds, values)
        given, rated = (np.asarray(part).reshape(shape) for part in (values, ratings.weights > 0))
        try:
            answers = self._sessions().play(numbers, rounds + 1, given, rated)
        except (LinkError, AnswerError) as error:
            raise ValueError(f"{self}: {error}") from None
        return _state(values, numbers, rounds + 1, answers)

    def rater_trust(self, state: OutsideState) -> Array:
        """Return the trust of each rater; 1 if the model has none. See `TrustModel.rater_trust`."""
        return state.tor

    def provider_trust(self, state: OutsideState) -> Array:
        """Return the trust of each provider. See `TrustModel.provider_trust`."""
        return state.top

    def _begin(self, like: Array) -> tuple[Numbers, Answers]:
        try:
            return self._sessions().begin(like.shape[:2], prod(like.shape[2:]))
        except (LinkError, AnswerError) as error:
            raise ValueError(f"{self}: {error}") from None

    def _at_hand(self, numbers: Numbers, rounds: Numbers, ratings: Array) -> Numbers:
        """Return the numbers of games in these rounds. A game that has not had a rating can begin again.

        Raises:
            ValueError: A game is in another round at the other side.
        """
        sessions, shape = self._sessions(), ratings.shape[:2]
        there = [sessions.round_of(number) for number in numbers.tolist()]
        apart = [k for k, round in enumerate(rounds.tolist()) if there[k] != round]
        if any(rounds[apart]):
            raise ValueError(
                f"{self} cannot go back to round {max(rounds[apart])} of a game: a model outside cannot branch, be "
                f"copied in a game, or play more than {MOST_GAMES:,} games at once"
            )
        if apart:
            numbers = numbers.copy()
            numbers[apart] = self._begin(np.broadcast_to(0.0, (*shape, len(apart))))[0]
        return numbers

    def _sessions(self) -> Sessions:
        """Return the games of this model, which begin when they are first needed."""
        if self not in _SESSIONS:
            try:
                _SESSIONS[self] = sessions = Sessions(self.address)
            except LinkError as error:
                raise ValueError(f"{self}: {error}") from None
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
"""The memory of a model is at the other side. The object itself is immutable, so it can go to another process."""


def _state(like: Array, numbers: Numbers, rounds: Numbers, answers: Answers) -> OutsideState:
    xp, batch = namespace(like), like.shape[2:]
    game, round = (xp.asarray(part.reshape(batch), device=like.device) for part in (numbers, rounds))
    tor, top = (xp.asarray(part.reshape(-1, *batch), dtype=like.dtype, device=like.device) for part in answers)
    return OutsideState(game, round, tor, top)
