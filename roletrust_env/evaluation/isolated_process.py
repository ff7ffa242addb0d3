"""The process of an isolated trust model, see `roletrust_env.evaluation.isolated`."""

import os
import pickle
import sys
import time
from collections import OrderedDict
from io import BytesIO
from threading import Thread
from typing import Any

import numpy as np

from roletrust_env.evaluation.isolated import read, write
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.trust.model import Traits, start_model
from roletrust_env.trust.ratings import Ratings
from roletrust_env.world import Scenario

_STATES = 8
"""Number of states that are kept."""


class _Model:
    """The model and its latest states."""

    def __init__(self) -> None:
        self._states: OrderedDict[int, Any] = OrderedDict()
        self._number = 0

    def make(self, path: list[str], text: str, settings: dict[str, Any]) -> list[Any]:
        """Make the model, and return its traits and whether it is a personal one."""
        sys.path[:] = path
        agents: Any = [{"role": "SR"}, {"role": "SP"}]
        self._model: Any = parse_trust_model(text, Scenario(agents=agents, **settings))
        return [[str(trait) for trait in Traits.of(self._model)], hasattr(self._model, "judge_trust")]

    def start(self, like: Any, peers: Any) -> list[Any]:
        """Start games, and return the number of the state and its trust."""
        return self._kept(start_model(self._model, like, peers))

    def update(self, number: int, ratings: Any, mask: Any) -> list[Any]:
        """Play a round, and return the number of the state and its trust."""
        if number not in self._states:
            raise ValueError(f"it keeps the latest {_STATES} states only, so games cannot go back further")
        return self._kept(self._model.update(self._states[number], Ratings(ratings, mask)))

    def _kept(self, state: Any) -> list[Any]:
        model = self._model
        trust = [model.rater_trust(state), model.provider_trust(state)]
        if hasattr(model, "judge_trust"):
            trust.append(model.judge_trust(state))
        self._number += 1
        self._states[self._number] = state
        if len(self._states) > _STATES:
            self._states.popitem(last=False)
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
    """Answer messages on standard input until it ends. What a model prints goes to standard error."""
    with os.fdopen(os.dup(1), "wb") as answers:
        os.dup2(2, 1)
        Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
        model = _Model()
        while True:
            try:
                message = read(sys.stdin.buffer)
            except EOFError:
                return
            write(answers, _answer(model, message))


if __name__ == "__main__":
    main()
