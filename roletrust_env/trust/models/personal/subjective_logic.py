"""Own evidence, fused with reports of advisers that are discounted by the trust in them: subjective logic."""

from typing import NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import Share, checked_dataclass
from roletrust_env.trust.judges import (
    Personal,
    by_judges,
    compare_opinions,
    credences,
    others,
    published_raters,
)
from roletrust_env.trust.opinions import Opinion
from roletrust_env.trust.ratings import PROVIDER, Ratings


class SubjectiveLogicState(NamedTuple):
    """Memory of the judges.

    Attributes:
        trust: Trust T, shape (S, P, ...).
        agreed: Evidence for adviser k that judge i has, shape (S, S, ...), 0 for itself.
        differed: Evidence against it, shape (S, S, ...).
        successes: Evidence for provider j that i has, shape (S, P, ...).
        failures: Evidence against it, shape (S, P, ...).
    """

    trust: Array
    agreed: Array
    differed: Array
    successes: Array
    failures: Array


@checked_dataclass
class SubjectiveLogic(Personal):
    """Subjective logic (TNA-SL): own opinion of a provider, fused with opinions of advisers discounted by trust.

    Jøsang, Hayward and Pope, "Trust network analysis with subjective logic" (2006); the algebra is that of
    `roletrust_env.trust.opinions`:

        own[i, j]     from evidence: each rating f counts as f of a success and 1 - f of a failure, and none fades
        adviser[i, k] from evidence: each time that both rate a provider in one round, 1 - |f[i, j] - f[k, j]| of a
                      success, the rest of a failure
        T[i, j]       = expectation of own[i, j] fused with each own[k, j] discounted by adviser[i, k]

    An adviser reports its whole opinion, which follows from its ratings so far. An adviser does not count before the
    judge has compared ratings with it.

    Not included: networks of more than one adviser between judge and provider. Added where the paper leaves something
    open: the evidence about advisers; T is updated for providers that were rated in the round.

    Attributes:
        initial: Base rate: the trust in raters and providers before any evidence, in [0, 1].
    """

    initial: Share = 0.5
    rates_raters = True
    source = "Jøsang, Hayward and Pope (2006)"
    cost = "S^2 P"

    def start(self, like: Array) -> SubjectiveLogicState:
        """Return the state without evidence. See `TrustModel.start`."""
        nothing, advisers = namespace(like).zeros_like(like), credences(like, 0.0)
        return SubjectiveLogicState(nothing + self.initial, advisers, advisers, nothing, nothing)

    def update(self, state: SubjectiveLogicState, ratings: Ratings) -> SubjectiveLogicState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        outcomes, met = ratings.values, ratings.weights
        two = others(ratings.values)
        agreed = state.agreed + two * compare_opinions(outcomes, met, lambda apart: 1 - apart)
        differed = state.differed + compare_opinions(outcomes, met, lambda apart: apart)
        successes, failures = state.successes + outcomes, state.failures + (met - outcomes)
        own, adviser = Opinion.of(successes, failures), Opinion.of(agreed, differed)

        def judged(some: slice) -> Array:
            advice = own.at(None).discounted(adviser.at((some, slice(None), None)))
            return own.at(some).fused(advice.fused_along(1)).expectation(self.initial)

        trust = namespace(ratings.values).where(ratings.rated(PROVIDER), by_judges(judged, outcomes), state.trust)
        return SubjectiveLogicState(trust, agreed, differed, successes, failures)

    def rater_trust(self, state: SubjectiveLogicState) -> Array:
        """Return the mean expectation of the others for each rater, shape (S, ...)."""
        return published_raters(Opinion.of(state.agreed, state.differed).expectation(self.initial))
