"""The paper's model: Algorithms 1 and 2 with the memory that they need between rounds."""

from typing import NamedTuple

from roletrust_env.arrays import Array, namespace, ones
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import Lam, Share
from roletrust_env.trust.algorithms import Notes, occurred, provider_quality, rater_quality, smooth


class RoleTrustState(NamedTuple):
    """What role-trust remembers.

    Attributes:
        tor: trust of the raters, shape (S, ...).
        top: trust of the providers, shape (P, ...).
        last: the last note that i gave j, shape (S, P, ...).
        elapsed: service periods since then, shape (S, P, ...), 0 where i never rated j.
        full: whether everybody rated everybody in the last round, so that `elapsed` is 1 everywhere.
    """

    tor: Array
    top: Array
    last: Array
    elapsed: Array
    full: bool = False


@checked_dataclass
class RoleTrust:
    """Role-based trust: a rater by its distance to the average note, a provider by good, steady, trusted notes.

    Su and Saint-Jore (EWSN 2023), Algorithms 1 and 2. An agent's ToA (Algorithm 3) combines the two read-outs and is
    the game's, since only the game knows which rater and which provider are one agent.

    Attributes:
        lam: weight of the newest round, in [0.5, 1), for raters and providers alike.
        initial: trust before any rating, in [0, 1]; the paper does not give it.
    """

    lam: Lam = 0.5
    initial: Share = 0.5
    rates_raters = True
    source = "Su and Saint-Jore (2023)"
    takes_full_rounds = True

    def start(self, like: Array) -> RoleTrustState:
        """Initial trust for everyone, and no rating yet. See `TrustModel.start`."""
        xp = namespace(like)
        last, elapsed = xp.zeros_like(like), xp.zeros_like(like)
        return RoleTrustState(last[:, 0, ...] + self.initial, last[0] + self.initial, last, elapsed)

    def update(self, state: RoleTrustState, ratings: Array, mask: Array | None) -> RoleTrustState:
        """One round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings)
        notes = Notes.of(ratings, mask)
        tor = smooth(self._rater_quality(notes), state.tor, self.lam, notes.given)
        quality = provider_quality(notes, tor, state.last, None if state.full else state.elapsed)
        top = smooth(quality, state.top, self.lam, notes.received)
        if mask is None:
            return RoleTrustState(tor, top, ratings, ones(ratings), True)
        last = xp.where(mask, ratings, state.last)
        elapsed = xp.where(mask, notes.weights, state.elapsed + occurred(state.elapsed))
        return RoleTrustState(tor, top, last, elapsed)

    def _rater_quality(self, notes: Notes) -> Array:
        """QoR, shape (S, ...)."""
        return rater_quality(notes)

    def rater_trust(self, state: RoleTrustState) -> Array:
        """ToR, shape (S, ...)."""
        return state.tor

    def provider_trust(self, state: RoleTrustState) -> Array:
        """ToP, shape (P, ...)."""
        return state.top
