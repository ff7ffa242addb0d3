"""A trust model in a process of its own, which gets ratings and gives trust, and sees nothing else
of a game.

The process is no sandbox: it runs with the rights of its user. But a model in it cannot reach the
game by the call stack or by modules, and its answers are read as numbers only.

Games are played side by side, many with the same noise, so whoever compares them sees who attacks.
Therefore some games, drawn at random, are played again by a process that has seen no other: trust
must be the same there.
"""

import os
import pickle
import subprocess
import sys
import time
import weakref
from collections import OrderedDict
from copy import copy
from io import BytesIO
from math import prod
from threading import Thread
from typing import IO, Any, NamedTuple

import numpy as np

from roletrust_env.arrays import Array
from roletrust_env.errors import printable
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.trust.grid_run import GridRun
from roletrust_env.trust.model import Traits
from roletrust_env.trust.ratings import Ratings
from roletrust_env.world.scenario import Scenario

_LENGTH = 8  # bytes of the length of a message
_MOST_BYTES = 2_000_000_000  # of an answer

_STATES = 8
"""Number of states that are kept."""

_STARTS, _LATEST, _GAMES = 24, 6, 8
"""Numbers of batches of which games are played again, of the latest of them, and of games in each,
fewer if large."""

_PAIRS = 2_000  # of raters and providers in these games of a batch, whose ratings are kept

_SAME = 1e-6  # trust of a game alone and beside others, which rounding tells apart


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


class _Step(NamedTuple):
    """A state of the games that may be played again: the number of the state before, what came in
    and what came out.

    Arrays are of shape (..., n), a column for each of n games; `before` is None at the start.
    """

    before: int | None
    given: list[Array | None]
    trust: list[Array]


class _Trace:
    """Some games of a batch, drawn at random, and their states by number, in order."""

    def __init__(self, batch: tuple[int, ...], peers: Array) -> None:
        self.axes, self.peers = len(batch), peers
        most = min(_GAMES, max(1, _PAIRS // peers.size))
        self.games = np.random.default_rng().permutation(prod(batch))[
            :most
        ]  # which no model can predict
        self.steps: dict[int, _Step] = {}

    def add(self, before: int | None, given: list[Array | None], state: "IsolatedState") -> None:
        """Keep a state."""
        trust = [self._columns(part) for part in state[1:] if part is not None]
        self.steps[int(state.number.flat[0])] = _Step(
            before, [None if part is None else self._columns(part) for part in given], trust
        )

    def _columns(self, array: Array) -> Array:
        lead = array.shape[: array.ndim - self.axes]
        return array.reshape(*lead, -1)[..., self.games].copy()

    def difference(self, model: "IsolatedModel", k: int) -> float:
        """Return how far trust in the k-th of the games is from that where another process plays
        the game alone.
        """

        def alone(array: Array) -> Array:
            return array[..., k].reshape(*array.shape[:-1], *[1] * self.axes)

        states: dict[int | None, IsolatedState] = {}
        largest = 0.0
        for number, step in self.steps.items():
            given = [None if part is None else alone(part) for part in step.given]
            if step.before is None:
                state = model.start(given[0], self.peers)
            else:
                state = model.update(states[step.before], _from_arrays(*given))
            states[number] = state
            trusts = [part for part in state[1:] if part is not None]
            for own, other in zip(trusts, step.trust, strict=True):
                largest = max(largest, float(np.abs(own - alone(other)).max()))
        return largest


class IsolatedModel:
    """A trust model in a process of its own, which ends with this object. It works on NumPy arrays.

    The process keeps the latest states of a game, so a game can go on from them and not from
    earlier ones.

    Args:
        text: Text `NAME[:key=value,...]`, see `roletrust_env.evaluation.specs.parse_trust_model`.
        scenario: Scenario of the model, of which it learns `lam` and `initial_trust`.

    Raises:
        ValueError: The model cannot be made.
    """

    def __init__(self, text: str, scenario: Scenario) -> None:
        self._text, self._scenario = text, scenario
        self._traces: list[_Trace] = []
        self._starts = 0
        command = [sys.executable, "-m", "roletrust_env.evaluation.isolated"]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        weakref.finalize(self, _end, self._process)
        settings = {"lam": scenario.lam, "initial_trust": scenario.initial_trust}
        names, self._has_judges, self._has_choice = self._ask("make", sys.path, text, settings)
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
        """Return `judge_trust` or `preference` if the model has it."""
        if name == "judge_trust" and self._has_judges:
            return lambda state: state.judged
        if name == "preference" and self._has_choice:
            return self._preference
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def start(self, like: Array, peers: Array) -> IsolatedState:
        """Return the state before any rating. See `TrustModel.start`.

        Raises:
            ValueError: The model fails, or `like` is no NumPy array.
        """
        if not isinstance(like, np.ndarray):
            raise ValueError(f"{self} works on NumPy arrays, not on {type(like).__name__}")
        state = self._state(like, self._ask("start", like, peers))
        self._follow(_Trace(like.shape[2:], peers)).add(None, [like], state)
        return state

    def update(self, state: IsolatedState, ratings: Ratings) -> IsolatedState:
        """Return the state after one more round. See `TrustModel.update`.

        Raises:
            ValueError: The model fails, or the state is none of the latest.
        """
        numbers = np.unique(state.number)
        if len(numbers) != 1:
            raise ValueError(f"{self} cannot mix games of different states")
        before, given = int(numbers[0]), _to_arrays(ratings)
        after = self._state(ratings.values, self._ask("update", before, *given))
        for trace in self._traces:
            if before in trace.steps:
                trace.add(before, given, after)
        return after

    def rater_trust(self, state: IsolatedState) -> Array:
        """Return the trust of each rater. See `TrustModel.rater_trust`."""
        return state.tor

    def provider_trust(self, state: IsolatedState) -> Array:
        """Return the trust of each provider. See `TrustModel.provider_trust`."""
        return state.top

    def _preference(self, state: IsolatedState, noise: Array) -> Array:
        (number,) = np.unique(state.number)
        return self._ask("preference", int(number), noise)[0]

    def check_alone(self) -> None:
        """Play some games again, each alone in a process that has not seen the others. Then begin a
        new record.

        Raises:
            ValueError: Trust in a game is another one there, or the model fails.
        """
        traces, self._traces = self._traces, []
        games = [(trace, k) for trace in traces for k in range(len(trace.games))]
        if not games:
            return
        model = IsolatedModel(self._text, self._scenario)
        for place in np.random.default_rng().permutation(len(games)):
            trace, k = games[place]
            if not (difference := trace.difference(model, k)) <= _SAME:
                raise ValueError(
                    f"{self}: trust in a game differs by {difference:.2g} from that in the same "
                    "game alone; it must "
                    "follow from the ratings of the game, and not from other games"
                )

    def _follow(self, trace: _Trace) -> _Trace:
        """Record a batch that starts, in place of one drawn at random if there are enough. The
        latest ones stay.
        """
        self._starts += 1
        if len(self._traces) >= _STARTS:
            earlier = self._starts - _LATEST  # of which each has the same chance to be kept
            leaves = int(np.random.default_rng().integers(earlier))
            n_earlier = _STARTS - _LATEST
            del self._traces[leaves if leaves < n_earlier else n_earlier]
        self._traces.append(trace)
        return trace

    def _state(self, like: Array, answer: list[Array]) -> IsolatedState:
        number, tor, top, *judged = answer
        return IsolatedState(
            np.broadcast_to(number, like.shape[2:]), tor, top, judged[0] if judged else None
        )

    def _ask(self, *message: Any) -> list[Any]:
        """Send a message and return the arrays of the answer.

        Raises:
            ValueError: The process has ended, the model has failed, or the answer cannot be read.
        """
        assert self._process.stdin is not None  # both are pipes
        assert self._process.stdout is not None
        try:
            _write(self._process.stdin, pickle.dumps(message))
            answer = _read(self._process.stdout)
        except (OSError, EOFError):
            raise ValueError(f"{self}: the process has ended") from None
        if not answer.startswith(b"+"):
            raise ValueError(
                f"{self}: {printable(' '.join(answer[1:1000].decode('utf-8', 'replace').split()))}"
            )
        stream, arrays = BytesIO(answer[1:]), []
        try:
            while stream.tell() < len(answer) - 1:
                arrays.append(np.load(stream, allow_pickle=False))
        except (ValueError, EOFError, OSError):
            raise ValueError(f"{self}: its answer has no arrays of numbers") from None
        return arrays


def _to_arrays(ratings: Ratings) -> list[Array | None]:
    """Return the values and the mask of ratings, and of the experience of the raters if it is
    another.
    """
    own = ratings.experience
    return [ratings.values, ratings.mask, *([] if own is ratings else [own.values, own.mask])]


def _from_arrays(values: Array, mask: Array | None, *own: Array | None) -> Ratings:
    """Return the ratings that `_to_arrays` took apart."""
    return Ratings(values, mask, experience=Ratings(*own) if own else None)


def _write(stream: IO[bytes], message: bytes) -> None:
    """Write a message with its length before it."""
    stream.write(len(message).to_bytes(_LENGTH, "big") + message)
    stream.flush()


def _read(stream: IO[bytes]) -> bytes:
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


# --- the process of the model
# ------------------------------------------------------------------------


class _Model:
    """The model and its latest states, each a run that goes on from a copy."""

    def __init__(self) -> None:
        self._runs: OrderedDict[int, GridRun] = OrderedDict()
        self._number = 0

    def make(self, path: list[str], text: str, settings: dict[str, Any]) -> list[Any]:
        """Make the model, and return its traits, whether it is a personal one, and whether it has a
        choice rule of its own.
        """
        sys.path[:] = path
        agents: Any = [{"role": "SR"}, {"role": "SP"}]
        self._model: Any = parse_trust_model(text, Scenario(agents=agents, **settings))
        return [
            [str(trait) for trait in Traits.of(self._model)],
            hasattr(self._model, "judge_trust"),
            hasattr(self._model, "preference"),
        ]

    def start(self, like: Any, peers: Any) -> list[Any]:
        """Start games, and return the number of the state and its trust."""
        return self._numbered(GridRun(self._model, like, peers))

    def update(self, number: int, *given: Any) -> list[Any]:
        """Play a round, and return the number of the state and its trust."""
        if number not in self._runs:
            raise ValueError(
                f"it keeps the latest {_STATES} states only, so games cannot go back further"
            )
        run = copy(self._runs[number])
        run.update(_from_arrays(*given))
        return self._numbered(run)

    def preference(self, number: int, noise: Any) -> list[Any]:
        """Return how much each judge wants each provider in a state."""
        return [self._model.preference(self._runs[number].state, noise)]

    def _numbered(self, run: GridRun) -> list[Any]:
        """Keep a run under the next number, and return the number and the trust."""
        trust = [run.rater_trust, run.provider_trust]
        if hasattr(self._model, "judge_trust"):
            trust.append(self._model.judge_trust(run.state))
        self._number += 1
        self._runs[self._number] = run
        if len(self._runs) > _STATES:
            self._runs.popitem(last=False)
        return [self._number, *trust]


def _answer(model: _Model, message: bytes) -> bytes:
    """Return the arrays of an answer behind a plus, or an error message behind a minus."""
    try:
        name, *arguments = pickle.loads(message)
        parts, stream = getattr(model, name)(*arguments), BytesIO(b"+")
        stream.seek(1)
        for part in parts:
            np.save(stream, np.asarray(part), allow_pickle=False)
    except (Exception, SystemExit) as error:  # a model of another package may raise anything
        kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
        return f"-{kind}{error}".encode()
    return stream.getvalue()


def _end_with(parent: int) -> None:
    """End this process when its parent has ended, also while the model is busy."""
    while os.getppid() == parent:
        time.sleep(1)
    os._exit(1)


def main() -> None:
    """Answer messages on standard input until it ends. What a model prints goes to standard
    error.
    """
    with os.fdopen(os.dup(1), "wb") as answers:
        os.dup2(2, 1)
        Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
        model = _Model()
        while True:
            try:
                message = _read(sys.stdin.buffer)
            except EOFError:
                return
            _write(answers, _answer(model, message))


if __name__ == "__main__":
    main()
