"""Subjective logic: own evidence, fused with reports of advisers that are discounted by the trust
in them.

The algebra is that of Jøsang, Hayward and Pope, "Trust network analysis with subjective logic"
(2006).
"""

from typing import Annotated, Any, NamedTuple

from roletrust_env.arrays import Array, namespace, total
from roletrust_env.parameters import Share, checked_dataclass
from roletrust_env.shapes import PerAdviser, PerPair, PerRater
from roletrust_env.trees import AMOUNTS, SHARES
from roletrust_env.trust.personal import (
    Evidence,
    Personal,
    by_judges,
    compare_opinions,
    credences,
    news,
    published_raters,
)
from roletrust_env.trust.ratings import Ratings


class Opinion(NamedTuple):
    """An opinion, or an array of opinions.

    Attributes:
        belief: Belief b, in [0, 1].
        disbelief: Disbelief d, in [0, 1].
        uncertainty: Uncertainty u, in [0, 1]; above 0 for an opinion from evidence, which is
            finite.
    """

    belief: Array
    disbelief: Array
    uncertainty: Array

    @classmethod
    def of(cls, successes: Array, failures: Array) -> "Opinion":
        """Return the opinion from evidence, (r, s, 2) / (r + s + 2); without evidence, the vacuous
        one, (0, 0, 1).

        Example:
            >>> Opinion.of(6.0, 2.0)
            Opinion(belief=0.6, disbelief=0.2, uncertainty=0.2)
        """
        evidence = successes + failures + 2
        return cls(successes / evidence, failures / evidence, 2 / evidence)

    def at(self, index: Any) -> "Opinion":
        """Return some opinions of an array of opinions, by an array index."""
        return Opinion(self.belief[index], self.disbelief[index], self.uncertainty[index])

    def discounted(self, adviser: "Opinion") -> "Opinion":
        """Return this opinion, reported by an adviser, discounted by a judge's opinion of the
        adviser.

        Example:
            >>> Opinion(0.5, 0.25, 0.25).discounted(adviser=Opinion(0.5, 0.5, 0.0))
            Opinion(belief=0.25, disbelief=0.125, uncertainty=0.625)
        """
        b = adviser.belief
        uncertainty = adviser.disbelief + adviser.uncertainty + b * self.uncertainty
        return Opinion(b * self.belief, b * self.disbelief, uncertainty)

    def fused(self, other: "Opinion") -> "Opinion":
        """Return the opinion from the evidence of both opinions.

        With k = u1 + u2 - u1 u2, b = (b1 u2 + b2 u1) / k, d likewise, and u = u1 u2 / k. For two
        opinions without uncertainty k is 0; the result is then their mean, the limit of equally
        certain opinions.

        Example:
            >>> Opinion(0.5, 0.0, 0.5).fused(Opinion(0.0, 0.5, 0.5)).belief == 1 / 3
            True
        """
        dogmatic = (self.uncertainty + other.uncertainty) == 0
        mine, its = self.uncertainty + dogmatic, other.uncertainty + dogmatic
        k = mine + its - self.uncertainty * other.uncertainty
        return Opinion(
            (self.belief * its + other.belief * mine) / k,
            (self.disbelief * its + other.disbelief * mine) / k,
            self.uncertainty * other.uncertainty / k,
        )

    def fused_along(self, axis: int) -> "Opinion":
        """Return the fusion of all opinions along an axis, each with an uncertainty above 0.

        This equals fusing them one after the other: b / u and d / u, half the evidence, add up.
        """
        belief = total(self.belief / self.uncertainty, axis)
        disbelief = total(self.disbelief / self.uncertainty, axis)
        uncertainty = 1 / (1 + belief + disbelief)
        return Opinion(belief * uncertainty, disbelief * uncertainty, uncertainty)

    def expectation(self, base_rate: float) -> Array:
        """Return E = b + a u, where the base rate a is the expectation without evidence."""
        return self.belief + base_rate * self.uncertainty


class SubjectiveLogicState(NamedTuple):
    """Memory of the judges.

    Attributes:
        trust: Trust T, shape (S, P, ...).
        agreed: Evidence for adviser k that judge i has, shape (S, S, ...), 0 for itself.
        differed: Evidence against it, shape (S, S, ...), 0 for itself.
        own: Services that each judge received; their sums are evidence for a provider, and the
            rest of their counts evidence against it.
        said: Ratings that each rater delivered.
    """

    trust: Annotated[PerPair, SHARES]
    agreed: Annotated[PerAdviser, AMOUNTS]
    differed: Annotated[PerAdviser, AMOUNTS]
    own: Evidence
    said: Evidence


@checked_dataclass
class SubjectiveLogic(Personal):
    """Subjective logic (TNA-SL): own opinion of a provider, fused with opinions of advisers
    discounted by trust.

    Jøsang, Hayward and Pope, "Trust network analysis with subjective logic" (2006); the algebra is
    that of `roletrust_env.trust.models.personal.opinions`:

        own[i, j]     from the services x that i received: each counts as x of a success and 1 - x
                      of a failure, and none fades
        said[k, j]    from the ratings f that k delivered, likewise
        adviser[i, k] from evidence: each time that k rates a provider and i received its service
                      in one round, 1 - |x[i, j] - f[k, j]| of a success, the rest of a failure
        T[i, j]       = expectation of own[i, j] fused with each said[k, j] discounted by
                      adviser[i, k]

    An adviser reports its whole opinion, which follows from its ratings so far. An adviser does not
    count before the judge has compared ratings with it.

    Not included: networks of more than one adviser between judge and provider. Added where the
    paper leaves something open: the evidence about advisers; T is updated for providers of which
    the judge has news in the round.

    Attributes:
        initial: Base rate: the trust in raters and providers before any evidence, in [0, 1].
    """

    initial: Share = 0.5
    rates_raters = True
    source = "Jøsang, Hayward and Pope (2006)"
    cost = "S^2 P"

    def start(self, like: PerPair) -> SubjectiveLogicState:
        """Return the state without evidence. See `TrustModel.start`."""
        none, advisers = Evidence.none(like), credences(like, 0.0)
        return SubjectiveLogicState(none.sums + self.initial, advisers, advisers, none, none)

    def update(self, state: SubjectiveLogicState, ratings: Ratings) -> SubjectiveLogicState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        agreed = state.agreed + compare_opinions(ratings, lambda apart: 1 - apart)
        differed = state.differed + compare_opinions(ratings, lambda apart: apart)
        own, said = state.own.after(ratings.experience), state.said.after(ratings)
        opinion, report = (Opinion.of(each.sums, each.counts - each.sums) for each in (own, said))
        adviser = Opinion.of(agreed, differed)

        def judged(judges: slice) -> Array:
            advice = report.at(None).discounted(adviser.at((judges, slice(None), None)))
            return opinion.at(judges).fused(advice.fused_along(1)).expectation(self.initial)

        trust = namespace(ratings.values).where(
            news(ratings) > 0, by_judges(judged, ratings.values), state.trust
        )
        return SubjectiveLogicState(trust, agreed, differed, own, said)

    def rater_trust(self, state: SubjectiveLogicState) -> PerRater:
        """Return the mean expectation of the others for each rater, shape (S, ...)."""
        return published_raters(Opinion.of(state.agreed, state.differed).expectation(self.initial))
