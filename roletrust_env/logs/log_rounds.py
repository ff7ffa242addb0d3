"""The rounds of a whole log, and how they are played."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from roletrust_env.logs.log import Log
from roletrust_env.logs.rounds import nanoseconds, round_numbers, spans
from roletrust_env.trust.key_index import Ints
from roletrust_env.trust.run import make_run
from roletrust_env.trust.trust_run import TrustRun


def log_rounds(log: Log, every: float) -> Ints:
    """Return the number of the round of each rating of a log with times, shape (n,), ascending.

    Args:
        log: Log.
        every: Length of a round in seconds.

    Raises:
        ValueError: The length is not above 0, or the log has no times.
    """
    length = nanoseconds("every", every)
    if log.times is None:
        raise ValueError("rounds go by time, and the log has no times; name the column of the time")
    return round_numbers(log.times, length, int(log.times[0]))


def play_round(run: TrustRun, number: int, *ratings: Any) -> None:
    """Play the round of a number, see `TrustRun.play`; rounds without ratings that lie before it
    are played first.
    """
    if number > run.rounds:
        run.skip(number - run.rounds)
    run.play(*ratings)


def numbers_of(log: Log, every: float | None) -> Ints:
    """Return the number of the round of each rating, shape (n,), ascending: by time, or 0 for all.

    Raises:
        ValueError: See `log_rounds`.
    """
    return np.zeros(len(log.values), np.int64) if every is None else log_rounds(log, every)


def played(
    model: Any,
    log: Log,
    numbers: Ints,
    *,
    without: npt.NDArray[np.bool_] | None = None,
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> TrustRun:
    """Return a run that has played a whole log, with some ratings left out of their rounds.

    Args:
        model: Trust model.
        log: Log.
        numbers: Number of the round of each rating, shape (n,), ascending.
        without: Whether each rating is left out, shape (n,). None for none.
        advance: Function that is called with the number of ratings that were played, and of all.

    Raises:
        MemoryError: The model does not fit, see `make_run`.
    """
    run = make_run(model, log.shape, one_role=not log.same_agents)
    for number, part in spans(numbers):
        there = slice(None) if without is None else ~without[part]
        play_round(run, number, *(column[part][there] for column in log[:3]))
        advance(part.stop, len(numbers))
    return run
