"""The paper's model: Algorithms 1 and 2, and their memory between rounds."""

from typing import Annotated, NamedTuple

import numpy as np

from roletrust_env.arrays import Array, namespace, ones
from roletrust_env.parameters import Lam, Share, checked_dataclass
from roletrust_env.shapes import PairAge, PerPair, PerProvider, PerRater
from roletrust_env.trees import SHARES
from roletrust_env.trust.algorithms import provider_quality, rater_quality
from roletrust_env.trust.ratings import PROVIDER, RATER, Published, Ratings, aged, smooth


class RoleTrustState(NamedTuple):
    """Memory of role-trust.

    Attributes:
        tor: Trust of the raters, ToR, shape (S, ...).
        top: Trust of the providers, ToP, shape (P, ...).
        last: Last rating that i gave j, shape (S, P, ...).
        elapsed: Number of service periods since then, shape (S, P, ...), 0 where i never rated j.
    """

    tor: Annotated[PerRater, SHARES]
    top: Annotated[PerProvider, SHARES]
    last: Annotated[PerPair, SHARES]
    elapsed: PairAge


@checked_dataclass
class RoleTrust(Published):
    """Role-based trust: raters by their distance to the average rating, providers by good, steady,
    trusted ratings.

    Su and Saint-Jore (EWSN 2023), Algorithms 1 and 2. The game computes an agent's ToA (Algorithm
    3) from the two read-outs, since only the game knows which rater and which provider are one
    agent.

    Attributes:
        lam: Weight of the newest round, in [0.5, 1), for raters and providers alike.
        initial: Trust before any rating, in [0, 1]; the paper does not give it.
    """

    lam: Lam = 0.5
    initial: Share = 0.5
    rates_raters = True
    source = "Su and Saint-Jore (2023)"
    local = True

    def start(self, like: PerPair) -> RoleTrustState:
        """Return the state before any rating, with initial trust for all. See
        `TrustModel.start`.
        """
        xp = namespace(like)
        last, elapsed = xp.zeros_like(like), xp.zeros_like(like)
        return RoleTrustState(last[:, 0, ...] + self.initial, last[0] + self.initial, last, elapsed)

    def update(self, state: RoleTrustState, ratings: Ratings) -> RoleTrustState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        tor = smooth(self._rater_quality(ratings), state.tor, self.lam, ratings.count(RATER))
        elapsed: Array | None = ratings.read(state.elapsed)
        if isinstance(elapsed, np.ndarray) and (elapsed == 1).all():
            elapsed = None  # this comparison takes less time than powers
        quality = provider_quality(ratings, tor, ratings.read(state.last), elapsed)
        top = smooth(quality, state.top, self.lam, ratings.count(PROVIDER))
        if ratings.full:
            return RoleTrustState(tor, top, ratings.values, ones(ratings.values))
        last = ratings.write(state.last, ratings.values)
        return RoleTrustState(tor, top, last, aged(ratings, state.elapsed))

    def _rater_quality(self, ratings: Ratings) -> Array:
        """Return QoR, shape (S, ...)."""
        return rater_quality(ratings)
