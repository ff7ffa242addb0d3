"""The rounds of a whole log, and how they are played."""

from roletrust_env.data.log import RatingLog
from roletrust_env.data.rounds import round_numbers
from roletrust_env.trust.key_index import Floats, Ints
from roletrust_env.trust.run import TrustRun


class TooSmallError(ValueError):
    """A log is too small for a protocol."""


def log_rounds(log: RatingLog, every: float) -> Ints:
    """Return the number of the round of each rating of a log with times, shape (n,), ascending.

    Raises:
        ValueError: The length is not above 0, or the log has no times.
    """
    if log.times is None:
        raise ValueError("rounds go by time, and the log has no times; name the column of the time")
    return round_numbers(log.times, every, float(log.times[0]))


def play_round(run: TrustRun, number: int, raters: Ints, providers: Ints, values: Floats) -> None:
    """Play the round of a number; rounds without ratings that lie before it are played first."""
    if number > run.rounds:
        run.skip(number - run.rounds)
    run.play(raters, providers, values)
