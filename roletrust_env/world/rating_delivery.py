"""Reports of ratings to the trust manager: which are sent, and which are lost or arrive late."""

from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.shapes import PairFlags, PerPair, Shape
from roletrust_env.world.access import highest
from roletrust_env.world.scenario import RatingDelivery


class Due(NamedTuple):
    """Services of earlier rounds that can still be rated.

    Attributes:
        service: Perceived quality, shape (S, P, ...); 0 where there is no such service.
        rounds: Number of rounds left to rate the service, shape (S, P, ...); 0 where there is none.
    """

    service: PerPair
    rounds: PerPair


def remaining(
    rule: RatingDelivery, due: Due, service: PerPair, awaiting: PairFlags, unsent: PairFlags
) -> Due:
    """Return the services that can still be rated after a round.

    Args:
        rule: Deadline of ratings.
        due: Services of earlier rounds before this round.
        service: Perceived quality of all services that could be rated in this round, shape (S, P,
            ...).
        awaiting: Whether the service is of the last round, boolean, shape (S, P, ...).
        unsent: Whether the service was neither rated nor replaced, boolean, shape (S, P, ...).
    """
    xp, nothing = namespace(service), 0 * service
    rounds = xp.where(awaiting, nothing + (rule.deadline - 1), due.rounds - 1)
    rounds = xp.where(unsent, rounds, nothing)
    return Due(xp.where(rounds > 0, service, nothing), rounds)


def choose_reports(
    rule: RatingDelivery,
    reports: PairFlags,
    claimed: PairFlags | None,
    claims: PerPair | None,
    noise: PerPair | None,
) -> PairFlags:
    """Return which ratings are sent, boolean, shape (S, P, ...).

    Args:
        rule: Largest number of ratings of a rater; without it all reports are sent, and no claims.
        reports: Whether there is a service to rate whose rating is not withheld, boolean, shape (S,
            P, ...).
        claimed: Whether a rating without a service can be sent, boolean, shape (S, P, ...); None
            where none can be.
        claims: Priority of such a rating, shape (S, P, ...), in [0, 1]; 0 sends none.
        noise: Uniform noise that breaks ties, shape (S, P, ...); None where all reports are sent.
    """
    if rule.open is None or noise is None:
        return reports
    if claimed is None or claims is None:
        return highest(noise, reports, rule.open)
    xp = namespace(noise)
    # Every report precedes every claim; near ties of claims break at random, too.
    preference = xp.where(reports, 2 + noise, claims + 1e-5 * noise)
    return highest(preference, reports | claimed & (claims > 0), rule.open)


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
