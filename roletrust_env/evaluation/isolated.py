"""A trust model in a process of its own, which gets ratings and gives trust, and sees nothing else of a game.

The process is no sandbox: it runs with the rights of its user. But a model in it cannot reach the game by the call
stack or by modules, and its answers are read as numbers only.
"""

import pickle
import subprocess
import sys
import weakref
from io import BytesIO
from typing import IO, Any, NamedTuple

import numpy as np

from roletrust_env.arrays import Array
from roletrust_env.trust.model import Traits
from roletrust_env.trust.ratings import Ratings
from roletrust_env.world.scenario import Scenario

_LENGTH = 8  # bytes of the length of a message
_MOST_BYTES = 2_000_000_000  # of an answer


class IsolatedState(NamedTuple):
    """State of an isolated model.

    Attributes:
        number: Number of the state in the other process, shape (...).
        tor: Trust of each rater, shape (S, ...).
        top: Trust of each provider, shape (P, ...).
        judged: Trust of each provider as each rater sees it, shape (S, P, ...); None for a central model.
    """

    number: Array
    tor: Array
    top: Array
    judged: Array | None


class IsolatedModel:
    """A trust model in a process of its own, which ends with this object. It works on NumPy arrays.

    The process keeps the latest states of a game, so a game can go on from them and not from earlier ones.

    Args:
        text: Text `NAME[:key=value,...]`, see `roletrust_env.evaluation.specs.parse_trust_model`.
        scenario: Scenario of the model, of which it learns `lam` and `initial_trust`.

    Raises:
        ValueError: The model cannot be made.
    """

    def __init__(self, text: str, scenario: Scenario) -> None:
        self._text = text
        command = [sys.executable, "-m", "roletrust_env.evaluation.isolated_process"]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        weakref.finalize(self, _end, self._process)
        settings = {"lam": scenario.lam, "initial_trust": scenario.initial_trust}
        names, self._personal = self._ask("make", sys.path, text, settings)
        traits = dict(zip(Traits._fields, names.tolist(), strict=True))
        self.rates_raters, self.family, self.source = (
            traits["rates_raters"] == "True",
            traits["family"],
            traits["source"],
        )
        self.differentiable, self.takes_peers = False, True

    def __repr__(self) -> str:
        """Return the text of the model."""
        return f"{self._text} in a process of its own"

    def __getattr__(self, name: str) -> Any:
        """Return `judge_trust` if the model is a personal one."""
        if name == "judge_trust" and self._personal:
            return lambda state: state.judged
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def start(self, like: Array, peers: Array) -> IsolatedState:
        """Return the state before any rating. See `TrustModel.start`.

        Raises:
            ValueError: The model fails, or `like` is no NumPy array.
        """
        if not isinstance(like, np.ndarray):
            raise ValueError(f"{self} works on NumPy arrays, not on {type(like).__name__}")
        return self._state(like, self._ask("start", like, peers))

    def update(self, state: IsolatedState, ratings: Ratings) -> IsolatedState:
        """Return the state after one more round. See `TrustModel.update`.

        Raises:
            ValueError: The model fails, or the state is none of the latest.
        """
        numbers = np.unique(state.number)
        if len(numbers) != 1:
            raise ValueError(f"{self} cannot mix games of different states")
        return self._state(ratings.values, self._ask("update", int(numbers[0]), ratings.values, ratings.mask))

    def rater_trust(self, state: IsolatedState) -> Array:
        """Return the trust of each rater. See `TrustModel.rater_trust`."""
        return state.tor

    def provider_trust(self, state: IsolatedState) -> Array:
        """Return the trust of each provider. See `TrustModel.provider_trust`."""
        return state.top

    def _state(self, like: Array, answer: list[Array]) -> IsolatedState:
        number, tor, top, *judged = answer
        return IsolatedState(np.broadcast_to(number, like.shape[2:]), tor, top, judged[0] if judged else None)

    def _ask(self, *message: Any) -> list[Any]:
        """Send a message and return the arrays of the answer.

        Raises:
            ValueError: The process has ended, the model has failed, or the answer cannot be read.
        """
        assert self._process.stdin is not None  # both are pipes
        assert self._process.stdout is not None
        try:
            write(self._process.stdin, pickle.dumps(message))
            answer = read(self._process.stdout)
        except (OSError, EOFError):
            raise ValueError(f"{self}: the process has ended") from None
        if not answer.startswith(b"+"):
            raise ValueError(f"{self}: {' '.join(answer[1:1000].decode('utf-8', 'replace').split())}")
        stream, arrays = BytesIO(answer[1:]), []
        try:
            while stream.tell() < len(answer) - 1:
                arrays.append(np.load(stream, allow_pickle=False))
        except (ValueError, EOFError, OSError):
            raise ValueError(f"{self}: its answer has no arrays of numbers") from None
        return arrays


def write(stream: IO[bytes], message: bytes) -> None:
    """Write a message with its length before it."""
    stream.write(len(message).to_bytes(_LENGTH, "big") + message)
    stream.flush()


def read(stream: IO[bytes]) -> bytes:
    """Read a message.

    Raises:
        EOFError: The other side has ended, or the message is too long.
    """
    length = int.from_bytes(stream.read(_LENGTH), "big")
    message = stream.read(length) if 0 < length <= _MOST_BYTES else b""
    if not message or len(message) < length:
        raise EOFError
    return message


def _end(process: "subprocess.Popen[bytes]") -> None:
    process.kill()
    process.wait()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            stream.close()
