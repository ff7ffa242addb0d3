"""Iterative filtering: providers are judged by their raters, and raters by what comes out, over and over."""

from typing import Literal, NamedTuple

from roletrust_env.arrays import Array, namespace, total
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import Lam, Share
from roletrust_env.trust.algorithms import weighted_mean

STEPS = 80
"""Of the iteration: with these weightings, what it comes to is reached to 1e-6."""

_LINEAR, _EXPONENTIAL, _POWER = 0.5, 2.0, 0.05  # e of the linear weighting, b of the exponential, e of the power


class FilteringState(NamedTuple):
    """What iterative filtering remembers.

    Attributes:
        tor: trust of the raters, shape (S, ...).
        top: trust of the providers, shape (P, ...).
        notes: the mean of all ratings of each pair, shape (S, P, ...), 0 where there are none.
        rated: 1 where there are some, 0 elsewhere, shape (S, P, ...).
    """

    tor: Array
    top: Array
    notes: Array
    rated: Array


@checked_dataclass
class IterativeFiltering:
    """Iterative filtering: raters weigh by how near they are to the weighted mean, iterated until both agree.

    De Kerchove and Van Dooren (2010), with the weightings of Yu et al. (2006) and Laureti et al. (2006):

        d[i] = mean over the providers j that i rated of (g[i, j] - r[j])^2
        u[i] = 1 - d[i] / (max d + 1/2)   "linear"
        u[i] = exp(-2 d[i])               "exponential"
        u[i] = (d[i] + 0.05)^(-1/2)       "power"
        r[j] = sum over the raters i of j of u[i] g[i, j] / sum of u[i]

    from equal weights, by a fixed number of steps. The papers leave 1/2, 2 and 0.05 open; Laureti et al. take the power
    -1/2 or -1. They filter one matrix; here g[i, j] is the exponential mean of the ratings that i gave j so far, the
    first in full, so that who is silent in a round still counts. Published are r, and u as a share of the largest:
    trust in a rater is in relation to the best one.

    Weights any sharper would take sides where nothing speaks for one: of two raters who disagree, the one that rounding
    favours would end up as right.

    Attributes:
        lam: weight of the newest rating in the mean of each pair, in [0.5, 1).
        initial: trust before any rating, in [0, 1].
        weighting: `"linear"`, `"exponential"` or `"power"`.
    """

    lam: Lam = 0.5
    initial: Share = 0.5
    weighting: Literal["linear", "exponential", "power"] = "power"
    rates_raters = True
    source = "de Kerchove and Van Dooren (2010)"

    def start(self, like: Array) -> FilteringState:
        """Initial trust for everyone, and no rating yet. See `TrustModel.start`."""
        xp = namespace(like)
        notes, rated = xp.zeros_like(like), xp.zeros_like(like)
        return FilteringState(notes[:, 0, ...] + self.initial, notes[0] + self.initial, notes, rated)

    def update(self, state: FilteringState, ratings: Array, mask: Array) -> FilteringState:
        """One round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings)
        weight = 1 - (1 - self.lam) * state.rated
        notes = state.notes + weight * (xp.where(mask, ratings, state.notes) - state.notes)
        rated = xp.where(mask, 1.0, state.rated)
        given, received = total(rated, 1), total(rated, 0)
        weights, worth = rated[:, 0, ...], weighted_mean(notes, rated, axis=0)
        for _ in range(STEPS):
            distance = weighted_mean((notes - worth) ** 2, rated, axis=1)
            least = xp.min(xp.where(given > 0, distance, 1.0), axis=0)
            weights = self._weights(xp.where(given > 0, distance, least), least)
            worth = weighted_mean(notes, rated * weights[:, None, ...], axis=0)
        return FilteringState(
            xp.where(given > 0, weights, self.initial), xp.where(received > 0, worth, self.initial), notes, rated
        )

    def _weights(self, distance: Array, least: Array) -> Array:
        """The weights u of raters as shares of the largest, that of the least distance."""
        xp = namespace(distance)
        if self.weighting == "linear":
            most = xp.max(distance, axis=0) + _LINEAR
            return (most - distance) / (most - least)
        if self.weighting == "exponential":
            return xp.exp(_EXPONENTIAL * (least - distance))
        return xp.sqrt((least + _POWER) / (distance + _POWER))

    def rater_trust(self, state: FilteringState) -> Array:
        """The weights as shares of the largest, shape (S, ...)."""
        return state.tor

    def provider_trust(self, state: FilteringState) -> Array:
        """The weighted means, shape (P, ...)."""
        return state.top
