"""What a metric returns, and what metrics share.

Axis 0 of recorded trust is the round, axis 1 the agent, every further axis the games of a batch, as in `History`; NaN
is the trust of who is not there. A score has one number for each game. Where it is undefined it is NaN, and says why.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.game.rollout import History

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


class Score(NamedTuple):
    """A number for each game.

    Attributes:
        value: shape (...), that of the batch; NaN where the metric is undefined.
        why: why it is undefined in some games; empty if it is not.
    """

    value: Floats
    why: str = ""

    @classmethod
    def where(cls, defined: npt.ArrayLike, value: npt.ArrayLike, why: str) -> "Score":
        """The value where it is defined, and NaN elsewhere, with the reason."""
        known = np.asarray(defined)
        return cls(np.where(known, value, np.nan), "" if known.all() else why)


def seen(history: History) -> Floats:
    """The trust of the agents, (T, N, ...), NaN where they are not there: what metrics take of a recorded game."""
    return np.where(np.asarray(history.present), np.asarray(history.trust, np.float64), np.nan)


def numbers(found: Score | npt.ArrayLike) -> Floats:
    """What a metric takes of another one's outcome: the numbers of a score, or numbers as they are."""
    return np.asarray(found.value if isinstance(found, Score) else found, np.float64)


def mean_or_nan(values: Floats, axis: int | tuple[int, ...]) -> Floats:
    """Return the mean along some axes of the values that are not NaN, or NaN where there are none."""
    there = ~np.isnan(values)
    return ratio(np.where(there, values, 0.0).sum(axis=axis), there.sum(axis=axis))


def ratio(part: npt.ArrayLike, whole: npt.ArrayLike) -> Floats:
    """A quotient, NaN where it is one by 0."""
    below = np.asarray(whole, np.float64)
    found: Floats = np.asarray(part, np.float64) / np.where(below == 0, np.nan, below)
    return found
