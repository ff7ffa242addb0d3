"""HABIT: what a judge saw of other providers predicts one that all agents' ratings say is like
them.
"""

import math
from typing import Annotated, NamedTuple

from pydantic import Field

from roletrust_env.arrays import Array, device_of, largest, namespace, total
from roletrust_env.parameters import Ridge, checked_dataclass
from roletrust_env.shapes import PerPair, PerRater, Shape
from roletrust_env.trees import AMOUNTS, SHARES
from roletrust_env.trust.beta_distribution import log_gamma
from roletrust_env.trust.dirichlet import in_levels, level_values
from roletrust_env.trust.personal import Personal, by_judges, by_pairs, others
from roletrust_env.trust.ratings import Ratings, occurred


class HabitState(NamedTuple):
    """Memory of HABIT.

    Attributes:
        counts: Number of ratings of each level n that agent k gave provider j, shape (S, levels, P,
            ...).
        trust: Trust of judge i in provider j, shape (S, P, ...).
    """

    counts: Annotated[Array, Shape("S levels P ..."), AMOUNTS]
    trust: Annotated[PerPair, SHARES]


@checked_dataclass
class Habit(Personal):
    """HABIT: a hierarchical Bayesian model, in which providers that agents rate alike are expected
    to behave alike.

    Teacy, Luck, Rogers and Jennings, "An efficient and versatile approach to trust and reputation
    using hierarchical Bayesian modelling" (2012), with its discrete opinions: agent k saw n[k, j,
    x] services of level x of provider j, so its opinion of j is the Dirichlet distribution with
    parameters 1 + n[k, j]. The reputation model is a Dirichlet process: provider j is like provider
    l, or like none, with probabilities

        w[j, l]    ~ product over all k of
                B(1 + n[k, j] + n[k, l]) B(1) / (B(1 + n[k, j]) B(1 + n[k, l]))
        w[j, none] ~ alpha,     B(a) = product of Gamma(a[x]) / Gamma(sum of a)
        T[i, j]    = sum over l of w[j, l] * mean level under 1 + n[i, j] + n[i, l],
                of none under 1 + n[i, j]

    where l is any other provider with ratings. The weight of l is the probability of the ratings of
    j given those of l, relative to that without them. For an adviser it is the integral over p of
    its two opinions' densities, B(a + b - 1) / (B(a) B(b)) with a = 1 + n[k, j] and b = 1 + n[k,
    l]; for the judge it is the marginal likelihood of what it saw of j after what it saw of l. With
    the same uniform prior for all, both come to the factor above, up to one that is the same for
    all l. So all judges have the same weights, and differ in what they saw.

    Nobody is discounted. A liar that says one thing of all good providers and another of all bad
    ones tells them apart as well as who is honest; one that lies about a single provider makes it
    like none, and then a judge that has not met it expects the mean.

    The equations could not be read in the paper itself; they were derived from its model, and the
    public code of its first author was read, which has B(a + b + 1) where the integral gives B(a +
    b - 1). Levels are ours, see `roletrust_env.trust.dirichlet`; and that providers without ratings
    are no l. Not included: groups of trustees, continuous behaviour, and opinions in another form
    than the judge's.

    Attributes:
        levels: Number of levels of ratings, at least 2.
        alpha: Concentration of the Dirichlet process: weight of a provider that is like none, at
            least 0.001.
    """

    levels: Annotated[int, Field(ge=2, le=100)] = 3
    alpha: Ridge = 1.0
    rates_raters = False
    source = "Teacy et al. (2012)"
    cost = "S P^2"

    def start(self, like: PerPair) -> HabitState:
        """Return the state without ratings. See `TrustModel.start`."""
        xp, shape = namespace(like), (like.shape[0], self.levels, *like.shape[1:])
        return HabitState(
            xp.zeros(shape, dtype=like.dtype, device=device_of(like)), xp.zeros_like(like) + 0.5
        )

    def update(self, state: HabitState, ratings: Ratings) -> HabitState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        counts = state.counts + in_levels(ratings, self.levels)
        like, none = self._likeness(counts)
        number = total(counts, 1)
        sums = total(level_values(self.levels, ratings.values) * counts, 1)

        def expected(judges: slice) -> Array:
            """Return the judges' trust, shape (judges, P, ...); axis 1 is j, axis 2 is l, which is
            summed out.
            """
            own, seen = sums[judges] + self.levels / 2, number[judges] + self.levels
            as_others = (own[:, :, None, ...] + sums[judges, None]) / (
                seen[:, :, None, ...] + number[judges, None]
            )
            return none * own / seen + total(like * as_others, 2)

        trust = by_judges(expected, number)
        return HabitState(counts, namespace(counts).clip(trust, 0.0, 1.0))

    def rater_trust(self, state: HabitState) -> PerRater:
        """Return 1 for each rater, since nobody is discounted, shape (S, ...)."""
        return 0 * state.trust[:, 0] + 1

    def _likeness(self, counts: Array) -> tuple[Array, Array]:
        """Return w[j, l], shape (P, P, ...), 0 for a provider and itself; and w[j, none], shape (P,
        ...).
        """
        xp = namespace(counts)
        known = xp.moveaxis(counts, 2, 0)  # (P, S, levels, ...)
        alone, nothing = (
            _log_beta(known + 1, 2),
            -math.lgamma(self.levels),
        )  # the latter is log B(1)

        def together(these: slice, those: slice) -> Array:
            """Return the logarithm of the product in w[j, l], shape (these, those, ...)."""
            both = _log_beta(known[these, None] + known[None, those] + 1, 3)
            return total(both - alone[these, None] - alone[None, those] + nothing, 2)

        alike = by_pairs(together, alone)
        other = others(alike) * occurred(total(total(counts, 1), 0))
        odds = other * alike
        peak = xp.clip(largest(odds, 1), 0.0, None)
        weights, none = other * xp.exp(odds - peak[:, None]), self.alpha * xp.exp(-peak)
        whole = total(weights, 1) + none
        return weights / whole[:, None], none / whole


def _log_beta(parameters: Array, axis: int) -> Array:
    """Return ln B of the parameters of Dirichlet distributions, which lie along an axis."""
    return total(log_gamma(parameters), axis) - log_gamma(total(parameters, axis))
