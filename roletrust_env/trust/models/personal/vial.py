"""Judges that try a few providers each, recommend their best, and block advisers for a bad one."""

import math
from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, cast, largest, namespace, total
from roletrust_env.parameters import Amount, Exponent, PositiveAmount, Share, checked_dataclass
from roletrust_env.shapes import PerAdviser, PerPair, PerRater
from roletrust_env.trees import COUNTS, FLAGS, SHARES
from roletrust_env.trust.personal import (
    Evidence,
    Personal,
    credences,
    heard,
    others,
    product,
    unknown_first,
)
from roletrust_env.trust.ratings import Ratings, occurred


class VialState(NamedTuple):
    """Memory of the judges. All flags are 0 or 1.

    Attributes:
        own: All services that the judges received.
        plays: Number of services in the judge's phase. Between two phases it is that of the last
            one.
        sticky: 1 for providers that the judge always tries, shape (S, P, ...).
        guests: 1 for providers that the judge tries on a recommendation, shape (S, P, ...).
        entrants: 1 for recommended providers that opened the judge's phase, shape (S, P, ...).
        sponsors: 1 for the advisers that recommended an entrant, shape (S, S, ...).
        opening: 1 if the judge's next service begins a phase, shape (S, ...).
        blocked: Last phase in which the judge blocks the adviser, shape (S, S, ...); 0 for none.
        reports: Ratings that the rater delivered in its phase.
        delivered: Number of all ratings that the rater delivered, shape (S, ...).
        recommended: 1 for the provider that the rater rated most often in its last complete phase,
            shape (S, P, ...).
        trust: Trust of each judge in each provider, shape (S, P, ...).
        credence: 0 where the judge blocks the adviser, 1 elsewhere, shape (S, S, ...).
    """

    own: Evidence
    plays: Annotated[PerPair, COUNTS]
    sticky: Annotated[PerPair, FLAGS]
    guests: Annotated[PerPair, FLAGS]
    entrants: Annotated[PerPair, FLAGS]
    sponsors: Annotated[PerAdviser, FLAGS]
    opening: Annotated[PerRater, FLAGS]
    blocked: Annotated[PerAdviser, COUNTS]
    reports: Evidence
    delivered: Annotated[PerRater, COUNTS]
    recommended: Annotated[PerPair, FLAGS]
    trust: Annotated[PerPair, SHARES]
    credence: Annotated[PerAdviser, FLAGS]


@checked_dataclass
class Vial(Personal):
    """Vial: a judge tries a few providers, adds one that a random adviser recommends, and blocks
    the adviser unless that one becomes its favourite.

    Vial, Shakkottai and Srikant, "Robust Multi-Agent Multi-Armed Bandits" (2021). Phase p of a
    judge ends with its service number ceil(p^beta). In a phase, the judge chooses by upper
    confidence bounds among its active providers:

        choice[i] = argmax over active j of mean[i, j] + width sqrt(2 ln t[i] / n[i, j])

    Judge i received n[i, j] services from provider j, and t[i] in all. A few active providers are
    sticky, which means that they stay for good, and two are guests. In each phase the judge asks a
    random adviser that it does not block for its most used provider. If this one is not active, it
    replaces the guest that served the judge less in the last phase. The judge blocks the adviser
    if the recommended provider does not serve it most in the next phase p. The block lasts until
    phase ceil(p^eta).

    The trust of a judge is the mean of its own services: reports of others decide where it looks,
    not what it believes. So the model equals `own-experience` unless it has the choice.

    Our reading differs from the paper where models have less than its agents:

    - Raters report services and recommend nothing. The recommendation of an adviser is the provider
      with most delivered reports in its last complete phase, by number of reports; of several, the
      one with the highest mean rating.
    - Sticky providers are not drawn before the game. They are the first ceil(cover P / S) that
      serve the judge, which are random by the choice rule. More are sticky if they come at once.
    - There are no guests before the first recommendation.
    - The first service of a phase comes from the recommended provider. All advisers that
      recommended it are blocked or none: the judge drew one of them, and does not remember which.
    - A favourite is the provider with most services in the phase; of several, the one with the
      highest mean.
    - We did not have the pseudocode. The active set and the guests follow the public code of the
      algorithm without blocks (Chawla et al. 2020), and the rule of blocking follows a summary of
      the authors' later paper (2022). The ends ceil(p^beta) and ceil(p^eta) are not verified.
    - The defaults are ours. They fit about 100 rounds; the paper's bounds hold in the long run.

    Attributes:
        initial: Trust before any service, in [0, 1].
        cover: Number of judges that have each provider as a sticky one, if all are spread evenly,
            in [1e-6, 1e6].
        width: Weight of the bonus, at least 0.
        beta: Exponent of the end of a phase, in [1, 8].
        eta: Exponent of the end of a block, in [1, 8].
    """

    initial: Share = 0.5
    cover: PositiveAmount = 2.0
    width: Amount = 0.1
    beta: Exponent = 1.5
    eta: Exponent = 2.0
    rates_raters = True
    differentiable = False
    cost = "S^2 P"
    source = "Vial, Shakkottai and Srikant (2021)"

    def start(self, like: PerPair) -> VialState:
        """Return the state without experience. See `TrustModel.start`."""
        none, nobody = Evidence.none(like), credences(like, 0.0)
        no, never = none.counts, none.counts[:, 0, ...]
        return VialState(
            own=none,
            plays=no,
            sticky=no,
            guests=no,
            entrants=no,
            sponsors=nobody,
            opening=never + 1,
            blocked=nobody,
            reports=none,
            delivered=never,
            recommended=no,
            trust=no + self.initial,
            credence=nobody + 1,
        )

    def update(self, state: VialState, ratings: Ratings) -> VialState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp, own = namespace(ratings.values), state.own.after(ratings.experience)
        opened = self._opened(state, ratings.experience.weights)
        before, now = total(state.own.counts, 1), total(own.counts, 1)
        phase, next_phase = 1 + self._completed(before), 1 + self._completed(now)
        ends = cast(next_phase > phase, now.dtype)
        favourite = _most(opened.plays, own.means)
        failed = ends * (1 - largest(opened.entrants * favourite, 1))
        until = -xp.floor(_ROUNDING - phase**self.eta)  # the ceiling
        blocked = xp.where(
            failed[:, None, ...] * opened.sponsors > 0, until[:, None, ...], state.blocked
        )
        delivered = state.delivered + total(ratings.weights, 1)
        complete = self._completed(delivered) > self._completed(state.delivered)
        reports = state.reports.after(ratings)
        return opened._replace(
            own=own,
            opening=xp.where(now > before, ends, state.opening),
            blocked=blocked,
            reports=Evidence(*(xp.where(complete[:, None, ...], 0.0, part) for part in reports)),
            delivered=delivered,
            recommended=xp.where(
                complete[:, None, ...], _most(reports.counts, reports.means), state.recommended
            ),
            trust=xp.where(own.counts > 0, own.means, self.initial),
            credence=cast(blocked < next_phase[:, None, ...], now.dtype),
        )

    def preference(self, state: VialState, noise: PerPair) -> PerPair:
        """Return how much each judge wants each provider, shape (S, P, ...). See `TrustModel`.

        The advisers draw lots: of uniform numbers u, the largest u^(1 / votes) has a probability
        in proportion to the votes (Efraimidis and Spirakis 2006).
        """
        xp, counts = namespace(noise), state.own.counts
        services = xp.clip(total(counts, 1), 1.0, None)[:, None, ...]
        bonus = self.width * xp.sqrt(2 * xp.log(services) / xp.clip(counts, 1.0, None))
        active = state.sticky + state.guests > 0
        wanted = xp.where(active, state.trust + bonus, noise - 1)
        votes, first = self._votes(state), 1 + 10 * self.width
        asks = state.opening[:, None, ...] * votes > 0
        wanted = xp.where(asks, first + noise ** (1 / xp.clip(votes, 1.0, None)), wanted)
        searches = self._searches(state)[:, None, ...] > 0
        return xp.where(searches, unknown_first(counts, wanted, noise, 1 + first), wanted)

    def _opened(self, state: VialState, served: PerPair) -> VialState:
        """Return the state with the active providers after a round's services, and with a new phase
        where it begins.
        """
        xp = namespace(served)
        opens = state.opening[:, None, ...] * largest(served, 1)[:, None, ...]
        entrants = served * occurred(self._votes(state))
        sponsors = occurred(product(entrants, state.recommended.swapaxes(0, 1)))
        sticky = xp.maximum(
            state.sticky, self._searches(state)[:, None, ...] * served * (1 - state.guests)
        )
        joins = opens * entrants * (1 - xp.maximum(sticky, state.guests))
        stays = _most((1 + state.plays) * state.guests, state.own.means)
        return state._replace(
            plays=served + (1 - opens) * state.plays,
            sticky=sticky,
            guests=xp.where(largest(joins, 1)[:, None, ...] > 0, stays + joins, state.guests),
            entrants=xp.where(opens > 0, entrants, state.entrants),
            sponsors=xp.where(
                opens > 0, others(served) * state.credence * sponsors, state.sponsors
            ),
        )

    def _votes(self, state: VialState) -> PerPair:
        """Return the number of advisers that recommend each provider to each judge, without those
        that it blocks, shape (S, P, ...).
        """
        return heard(state.credence, state.recommended)

    def _searches(self, state: VialState) -> PerRater:
        """Return 1 for judges that have too few sticky providers, 0 for others, shape (S, ...)."""
        raters, providers = state.sticky.shape[:2]
        size = max(1, min(providers, math.ceil(self.cover * providers / raters)))
        return cast(total(state.sticky, 1) < size, state.sticky.dtype)

    def _completed(self, services: PerRater) -> PerRater:
        """Return the number of phases that are complete after a number of services, shape (S,
        ...).
        """
        nearest = namespace(services).floor(services ** (1 / self.beta) + 0.5)
        return nearest - cast(nearest**self.beta > services + _ROUNDING, services.dtype)


_ROUNDING = 1e-3
"""Largest rounding error of a power that is compared with a whole number."""


def _most(counts: PerPair, means: PerPair) -> PerPair:
    """Return 1 for the provider with most services or ratings in each row, and of several for that
    with the highest mean; 0 for others, shape (S, P, ...).
    """
    xp = namespace(counts)
    first = (counts > 0) & (counts == largest(counts, 1)[:, None, ...])
    means = xp.where(first, means, -1.0)
    best: Array = first & (means == largest(means, 1)[:, None, ...])
    return cast(best, counts.dtype)
