"""The way of a rating to the trust manager: some are lost, some come late."""

from typing import NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.world.scenario import RatingChannel


class InTransit(NamedTuple):
    """Ratings that are late, by the round in which they arrive: shape (delay, S, P, ...); row 0 arrives next."""

    ratings: Array
    sent: Array


def start(rule: RatingChannel, like: Array) -> InTransit:
    """Nothing in transit. `like` has shape (S, P, ...)."""
    xp = namespace(like)
    empty = xp.stack([xp.zeros_like(like)] * rule.delay)
    return InTransit(empty, empty > 0)


def deliver(
    rule: RatingChannel,
    transit: InTransit | None,
    ratings: Array,
    sent: Array,
    lost: Array | None,
    late: Array | None,
) -> tuple[Array, Array, InTransit | None]:
    """What arrives in this round.

    Args:
        rule: the probabilities and the delay.
        transit: the ratings that are late; None where the rule makes none late.
        ratings: those sent now, shape (S, P, ...).
        sent: boolean, shape (S, P, ...): which cells hold a rating.
        lost: uniform noise, shape (S, P, ...); None where the rule loses none.
        late: uniform noise, shape (S, P, ...); None where the rule makes none late.

    Returns:
        The ratings that arrive, where they do, and what is in transit afterwards.
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
    return (
        xp.where(on_time, ratings, transit.ratings[0]),
        on_time | transit.sent[0],
        waiting,
    )
