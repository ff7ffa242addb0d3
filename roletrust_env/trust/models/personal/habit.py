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
from roletrust_env.trust.personal import Personal, by_judges, heard, others
from roletrust_env.trust.ratings import Ratings, occurred


class HabitState(NamedTuple):
    """Memory of HABIT.

    Attributes:
        own: Number of services of each level n that judge i received from provider j, shape (S,
            levels, P, ...).
        said: Number of ratings of each level that agent k gave provider j, of the same shape.
        trust: Trust of judge i in provider j, shape (S, P, ...).
    """

    own: Annotated[Array, Shape("S levels P ..."), AMOUNTS]
    said: Annotated[Array, Shape("S levels P ..."), AMOUNTS]
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

        w[j, l]    ~ product over i and all advisers k of
                B(1 + n[k, j] + n[k, l]) B(1) / (B(1 + n[k, j]) B(1 + n[k, l]))
        w[j, none] ~ alpha,     B(a) = product of Gamma(a[x]) / Gamma(sum of a)
        T[i, j]    = sum over l of w[j, l] * mean level under 1 + n[i, j] + n[i, l],
                of none under 1 + n[i, j]

    for judge i, whose n[i] are the services that it received, while the n[k] of the others are the
    ratings that they delivered; l is any other provider of which i knows a rating or service. The
    weight of l is the probability of the ratings of j given those of l, relative to that without
    them. For an adviser it is the integral over p of its two opinions' densities, B(a + b - 1) /
    (B(a) B(b)) with a = 1 + n[k, j] and b = 1 + n[k, l]; for the judge it is the marginal
    likelihood of what it saw of j after what it saw of l. With the same uniform prior for all, both
    come to the factor above, up to one that is the same for all l.

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
        none = xp.zeros(shape, dtype=like.dtype, device=device_of(like))
        return HabitState(none, none, xp.zeros_like(like) + 0.5)

    def update(self, state: HabitState, ratings: Ratings) -> HabitState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        own = state.own + in_levels(ratings.experience, self.levels)
        said = state.said + in_levels(ratings, self.levels)
        seen, rated = total(own, 1), total(said, 1)
        sums = total(level_values(self.levels, ratings.values) * own, 1)
        known = heard(1.0, rated) + seen

        def agreed(providers: slice) -> Array:
            """Return the sum of all advisers' factors, shape (providers, P, ...)."""
            return total(_likeness(said, providers), 0)

        advice = by_judges(agreed, rated.swapaxes(0, 1))

        def expected(judges: slice) -> Array:
            """Return the judges' trust, shape (judges, P, ...); axis 1 is j, axis 2 is l, which is
            summed out.
            """
            alike = advice - _likeness(said[judges]) + _likeness(own[judges])
            like, none = self._weights(alike, occurred(known[judges]))
            mine, number = sums[judges] + self.levels / 2, seen[judges] + self.levels
            as_others = (mine[:, :, None, ...] + sums[judges, None]) / (
                number[:, :, None, ...] + seen[judges, None]
            )
            return none * mine / number + total(like * as_others, 2)

        trust = by_judges(expected, seen)
        return HabitState(own, said, namespace(own).clip(trust, 0.0, 1.0))

    def rater_trust(self, state: HabitState) -> PerRater:
        """Return 1 for each rater, since nobody is discounted, shape (S, ...)."""
        return 0 * state.trust[:, 0] + 1

    def _weights(self, alike: Array, known: Array) -> tuple[Array, Array]:
        """Return w[j, l] of each judge, shape (judges, P, P, ...), 0 for a provider and itself; and
        w[j, none], shape (judges, P, ...).

        Args:
            alike: Logarithm of the product in w[j, l], shape (judges, P, P, ...).
            known: 1 where the judge knows a rating or service of l, 0 elsewhere, shape (judges, P,
                ...).
        """
        xp = namespace(alike)
        other = others(alike[0])[None] * known[:, None]
        odds = other * alike
        peak = xp.clip(largest(odds, 2), 0.0, None)
        weights, none = other * xp.exp(odds - peak[:, :, None]), self.alpha * xp.exp(-peak)
        whole = total(weights, 2) + none
        return weights / whole[:, :, None], none / whole


def _likeness(counts: Array, providers: slice = slice(None)) -> Array:
    """Return the logarithm of each agent's factor in w[j, l], shape (agents, providers, P, ...).

    Args:
        counts: Numbers n of these agents, shape (agents, levels, P, ...).
        providers: Places of the providers j.
    """
    parameters, levels = namespace(counts).moveaxis(counts, 1, -1) + 1, counts.shape[1]
    alone, nothing = _log_beta(parameters), -math.lgamma(levels)  # the latter is log B(1)
    both = _log_beta(parameters[:, providers, None] + parameters[:, None] - 1)
    return both - alone[:, providers, None] - alone[:, None] + nothing


def _log_beta(parameters: Array) -> Array:
    """Return ln B of the parameters of Dirichlet distributions, which lie along the last axis."""
    axis = parameters.ndim - 1
    return total(log_gamma(parameters), axis) - log_gamma(total(parameters, axis))
