"""Score, the result of a metric, and functions that metrics share.

In arrays of recorded trust, axis 0 is the round, axis 1 is the agent, and all further axes are the
games of a batch, as in `History`. The trust of an absent agent is NaN. A score has one number for
each game: NaN where the metric is undefined, with the reason. Rounds of games that end at random
count by their weights, see `Scenario.round_weights`.
"""

from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from roletrust_env.game.rollout import History
from roletrust_env.shapes import Shape

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

AgentFloats: TypeAlias = Annotated[Floats, Shape("N ...")]
"""Array with an entry for each agent, shape (N, ...)."""

ProviderFloats: TypeAlias = Annotated[Floats, Shape("P ...")]
"""Array with an entry for each provider, shape (P, ...)."""

TrustByRound: TypeAlias = Annotated[Floats, Shape("T N ...")]
"""Trust of each agent in each round, shape (T, N, ...)."""

FlagsByRound: TypeAlias = Annotated[Flags, Shape("T S P ...", "bool")]
"""Boolean array with an entry for each round and pair, shape (T, S, P, ...)."""

RoundWeights: TypeAlias = Annotated[Floats, Shape("T")]
"""Weights of the rounds, shape (T,)."""


class Score(NamedTuple):
    """Value of a metric for each game.

    Attributes:
        value: Values of the shape of the batch (...); NaN where the metric is undefined.
        why: Reason why the metric is undefined in some games; empty if it is defined in all.
    """

    value: Annotated[Floats, Shape("...")]
    why: str = ""

    @classmethod
    def where(cls, defined: npt.ArrayLike, value: npt.ArrayLike, why: str) -> "Score":
        """Return a score with the value where it is defined, and NaN with a reason elsewhere."""
        known = np.asarray(defined)
        return cls(np.where(known, value, np.nan), "" if known.all() else why)


def present_trust(history: History) -> TrustByRound:
    """Return the trust of the agents in a recorded game, shape (T, N, ...), NaN where they are
    absent.
    """
    return np.where(np.asarray(history.present), np.asarray(history.trust, np.float64), np.nan)


def as_numbers(score: Score | npt.ArrayLike) -> Floats:
    """Return the values of a score, or numbers as an array."""
    return np.asarray(score.value if isinstance(score, Score) else score, np.float64)


def mean_or_nan(
    values: Floats, axis: int | tuple[int, ...], weights: RoundWeights | None = None
) -> Floats:
    """Return the mean along some axes over all values but NaN; NaN if there are none.

    Args:
        values: Values; with weights, of shape (T, ...).
        axis: Axes.
        weights: Weights of the rounds, shape (T,); None weights all alike.
    """
    known, share = np.where(np.isnan(values), 0.0, values), ~np.isnan(values)
    if weights is not None:
        known, share = in_rounds(known, weights), in_rounds(share, weights)
    return ratio(known.sum(axis=axis), share.sum(axis=axis))


def in_rounds(values: npt.NDArray[Any], weights: RoundWeights | None) -> Floats:
    """Return values of shape (T, ...), times the weights of the rounds, shape (T,), if there are
    any.
    """
    return values if weights is None else values * weights.reshape(-1, *[1] * (values.ndim - 1))


def ratio(part: npt.ArrayLike, whole: npt.ArrayLike) -> Floats:
    """Return a quotient; NaN where the denominator is 0."""
    denominator = np.asarray(whole, np.float64)
    quotient: Floats = np.asarray(part, np.float64) / np.where(
        denominator == 0, np.nan, denominator
    )
    return quotient
