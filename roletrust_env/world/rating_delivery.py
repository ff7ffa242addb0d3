"""Delivery of ratings to the trust manager: some ratings are lost or arrive late."""

from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.shapes import Shape
from roletrust_env.world.scenario import RatingDelivery


class InTransit(NamedTuple):
    """Late ratings, by the round in which they arrive.

    Attributes:
        ratings: Values of shape (delay, S, P, ...); row 0 arrives next.
        sent: Boolean array of the same shape, true where there is a rating.
    """

    ratings: Annotated[Array, Shape("delay S P ...")]
    sent: Annotated[Array, Shape("delay S P ...", "bool")]


def start(rule: RatingDelivery, like: Array) -> InTransit:
    """Return an empty transit for ratings like an array of shape (S, P, ...)."""
    xp = namespace(like)
    empty = xp.stack([xp.zeros_like(like)] * rule.delay)
    return InTransit(empty, empty > 0)


def deliver(
    rule: RatingDelivery,
    transit: InTransit | None,
    ratings: Array,
    sent: Array,
    lost: Array | None,
    late: Array | None,
) -> tuple[Array, Array, InTransit | None]:
    """Deliver the ratings of one round.

    Args:
        rule: Probabilities of losses and delays, and length of the delay.
        transit: Late ratings; None if the rule delays no ratings.
        ratings: Ratings sent in this round, shape (S, P, ...).
        sent: Boolean array of shape (S, P, ...), true where there is a rating.
        lost: Uniform noise, shape (S, P, ...); None if the rule loses no ratings.
        late: Uniform noise, shape (S, P, ...); None if the rule delays no ratings.

    Returns:
        The ratings that arrive in this round, a boolean array of where they arrive, and the late
        ratings afterwards.
    """
    if lost is not None:
        sent = sent & (lost >= rule.lost)
    if transit is None or late is None:
        return ratings, sent, None
    xp = namespace(ratings)
    delayed = sent & (late < rule.late)
    on_time = sent & ~delayed
    waiting = InTransit(
        xp.concat([transit.ratings[1:], ratings[None, ...]]),
        xp.concat([transit.sent[1:], delayed[None, ...]]),
    )
    return (xp.where(on_time, ratings, transit.ratings[0]), on_time | transit.sent[0], waiting)
