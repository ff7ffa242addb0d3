"""Judges that pool all reports but those of raters that contradicted them."""

from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, cast, namespace, total
from roletrust_env.parameters import Share, checked_dataclass
from roletrust_env.shapes import PerAdviser, PerPair
from roletrust_env.trees import FLAGS, SHARES
from roletrust_env.trust.personal import (
    Evidence,
    Personal,
    by_judges,
    credences,
    heard,
    product,
    unknown_first,
    weighted_advice,
)
from roletrust_env.trust.ratings import Ratings, occurred


class BlockState(NamedTuple):
    """Memory of the judges.

    Attributes:
        own: All services that the judges received.
        said: All ratings that were delivered.
        contradicted: 1 where an adviser has contradicted the judge, 0 elsewhere, shape (S, S, ...).
        agreed: 1 where an adviser has agreed with the judge, 0 elsewhere, shape (S, S, ...).
        trust: Trust of each judge in each provider, shape (S, P, ...).
        credence: 1 where a judge listens to a rater, 0 elsewhere, shape (S, S, ...).
    """

    own: Evidence
    said: Evidence
    contradicted: Annotated[PerAdviser, FLAGS]
    agreed: Annotated[PerAdviser, FLAGS]
    trust: Annotated[PerPair, SHARES]
    credence: Annotated[PerAdviser, FLAGS]


@checked_dataclass
class Block(Personal):
    """Block: the mean of the judge's own services and of the ratings of all raters that have not
    contradicted it.

    An adviser contradicts a judge where the mean of its ratings of a provider and the mean of the
    services that the judge received from it are further apart than `limit`, and agrees with it
    where they are nearer. Both are remembered, unless `forgive`. A baseline for listeners: a model
    of the same view that is not better is not worth its formula. Blocking for good is what makes
    collaboration pay against a malicious agent in Vial, Shakkottai and Srikant (2021), whose
    algorithm this is not.

    By its own choice rule, a judge first goes to providers of which it knows nothing, at random,
    and then to the most trusted one.

    Attributes:
        initial: Trust without a service or a rating that counts, in [0, 1].
        limit: Distance of the means beyond which an adviser contradicts, in [0, 1].
        forgive: Whether only the current means count, not those of earlier rounds.
        strangers: Whether a rater that neither agreed nor contradicted counts.
    """

    initial: Share = 0.5
    limit: Share = 0.3
    forgive: bool = False
    strangers: bool = True
    rates_raters = True
    differentiable = False
    cost = "S^2 P"

    def start(self, like: PerPair) -> BlockState:
        """Return the state without experience. See `TrustModel.start`."""
        none, nobody = Evidence.none(like), credences(like, 0.0)
        trust, credence = none.sums + self.initial, nobody + float(self.strangers)
        return BlockState(none, none, nobody, nobody, trust, credence)

    def update(self, state: BlockState, ratings: Ratings) -> BlockState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings.values)
        own, said = state.own.after(ratings.experience), state.said.after(ratings)
        met, rated, seen, reported = (
            *(occurred(own.counts), occurred(said.counts)),
            *(own.means, said.means),
        )

        def apart(judges: slice) -> Array:
            far = abs(seen[judges, None] - reported[None]) > self.limit
            return total(met[judges, None] * rated[None] * far, 2)

        contradictions = by_judges(apart, rated)
        agreements = product(met, rated.swapaxes(0, 1)) - contradictions
        contradicted, agreed = occurred(contradictions), cast(agreements > 0.5, rated.dtype)
        if not self.forgive:
            contradicted = xp.maximum(contradicted, state.contradicted)
            agreed = xp.maximum(agreed, state.agreed)
        credence = (1 - contradicted) * (1 if self.strangers else agreed)
        mean, weight = weighted_advice(credence, said, own)
        trust = xp.where(weight > 0, mean, self.initial)
        return BlockState(own, said, contradicted, agreed, trust, credence)

    def preference(self, state: BlockState, noise: PerPair) -> PerPair:
        """Return how much each judge wants each provider, shape (S, P, ...). See `TrustModel`."""
        known = heard(state.credence, state.said.counts) + state.own.counts
        return unknown_first(known, state.trust, noise)


@checked_dataclass
class BlockForgiving(Block):
    """Forgiving block: `block` with a memory of mean ratings only, not of past contradictions.

    An adviser that contradicted the judge counts again once its mean ratings agree with the judge.

    Attributes:
        forgive: Whether only the current means count, not those of earlier rounds.
    """

    forgive: bool = True


@checked_dataclass
class AgreedOnce(Block):
    """Agreed once: the mean of the judge's own services and of the ratings of raters that agreed
    with it at least once and never contradicted it.

    It is `block` without strangers: a rater that rated no provider of the judge's does not count.

    Attributes:
        initial: Trust without a service or a rating that counts, in [0, 1].
        strangers: Whether a rater that neither agreed nor contradicted counts.
    """

    initial: Share = 0.7
    strangers: bool = False
