"""Role-trust that is slow to believe: opinions are kept, trusted raters count for more, and trust comes back slowly."""

from typing import NamedTuple

from roletrust_env.arrays import Array, largest, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import Factor, Lam, Power, Share
from roletrust_env.trust.algorithms import masked_mean, sinc, smooth, weighted_mean

_LEAST = 0.01
"""Of a rater's trust, as far as its weight goes: where nobody is believed, somebody still has to count."""


class WaryState(NamedTuple):
    """What wary role-trust remembers.

    Attributes:
        tor: trust of the raters, shape (S, ...).
        top: trust of the providers, shape (P, ...).
        last: the last note that i gave j, shape (S, P, ...), 0 where there is none.
        fresh: how much of it still counts, shape (S, P, ...), 0 where there is none.
    """

    tor: Array
    top: Array
    last: Array
    fresh: Array


@checked_dataclass
class WaryRoleTrust:
    """Wary role-trust: role-trust with a consensus of trusted raters, and trust that falls fast and rises slowly.

    The idea is that of Su and Saint-Jore (EWSN 2023): two roles, raters trusted by their gap to the consensus, and
    providers by good, steady notes of trusted raters. Four things are new, and each is undone by one value of one
    parameter:

        w[i, j] = fresh[i, j] max(ToR[i], 0.01)^power              1 for a note of this round, times keep each round
        c[j]    = sum over the raters i of w[i, j] g[i, j] / sum of w[i, j]              g[i, j] is i's last note of j
        QoR[i]  = 1 - mean over the providers j that i rated of sqrt(|f[i, j] - c[j]|)
        ToR[i] <- lam QoR[i] + (1 - lam) ToR[i]
        QoP[j]  = sum over the raters i of w[i, j] sinc(1 - g[i, j]) g[i, j] / sum of w[i, j],    ToR as just updated
        d[j]    = QoP[j] - ToP[j],   h = the median of d over the providers that were rated, the upper of two
        own[j]  = min(d[j] - (h if h < -shock else 0), 0)
        ToP[j] <- ToP[j] + lam (own[j] + rise (d[j] - own[j]))

    `power`: a weighted mean in place of the paper's plain one, so that ToR says who counts and does not lower ToP; 0
    counts all alike. `keep`: a rater has its say on a provider also when it was not there, so that the few who were do
    not decide alone; 0 hears this round only. `shock`: when most providers fall together, that is the world's doing,
    and only what one falls beyond it is its own; 1 has all falls their own. `rise`: the paper's stability term punishes
    both edges of a change; here unsteady service is paid for by the slow way up, on which a newcomer is, too, and what
    is the world's doing is followed as slowly. 1 is as fast as down.

    Attributes:
        lam: weight of the newest round, in [0.5, 1), for raters, and for providers that fall.
        initial: trust before any rating, in [0, 1].
        rise: rate of rising as a share of that of falling, in (0, 1].
        power: of a rater's trust in its weight, in [0, 8].
        keep: what is left of the weight of a note after a round, in [0, 1].
        shock: median fall from which on it is the world's, in [0, 1].
    """

    lam: Lam = 0.5
    initial: Share = 0.5
    rise: Factor = 0.1
    power: Power = 2.0
    keep: Share = 0.5
    shock: Share = 0.1
    rates_raters = True
    source = "after Su and Saint-Jore (2023)"
    smooth = False  # the median jumps from one provider to another, and so does forgiving at the shock

    def start(self, like: Array) -> WaryState:
        """Initial trust for everyone, and no note yet. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        return WaryState(nothing[:, 0, ...] + self.initial, nothing[0] + self.initial, nothing, nothing)

    def update(self, state: WaryState, ratings: Array, mask: Array) -> WaryState:
        """One round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings)
        last = xp.where(mask, ratings, state.last)
        fresh = xp.where(mask, 1.0, self.keep * state.fresh)
        below = last - largest(xp.where(fresh > 0, last, 0.0))  # raters who agree are exactly 0 apart
        consensus = weighted_mean(below, self._weights(fresh, state.tor), axis=0)
        distance, given = masked_mean(xp.sqrt(abs(below - consensus)), mask, axis=1)
        tor = smooth(1 - distance, state.tor, self.lam, given)
        quality = weighted_mean(sinc(1 - last) * last, self._weights(fresh, tor), axis=0)
        return WaryState(tor, self._moved(state.top, quality, mask), last, fresh)

    def _weights(self, fresh: Array, tor: Array) -> Array:
        """W, shape (S, P, ...)."""
        return fresh * (namespace(tor).clip(tor, _LEAST, None) ** self.power)[:, None, ...]

    def _moved(self, top: Array, quality: Array, mask: Array) -> Array:
        """ToP after the round, shape (P, ...)."""
        xp = namespace(top)
        rated = xp.any(mask, axis=0)
        change = xp.where(rated, quality - top, 0.0)
        common = _upper_median(change, rated)
        own = xp.clip(change - xp.where(common < -self.shock, common, 0.0), None, 0)
        return top + self.lam * (own + self.rise * (change - own))

    def rater_trust(self, state: WaryState) -> Array:
        """ToR, shape (S, ...)."""
        return state.tor

    def provider_trust(self, state: WaryState) -> Array:
        """ToP, shape (P, ...)."""
        return state.top


def _upper_median(values: Array, there: Array) -> Array:
    """The median along the first axis of those that are there, of an even number the upper one; 0 of fewer than two."""
    xp = namespace(values)
    count = xp.sum(there, axis=0)
    ordered = xp.sort(xp.where(there, values, float("inf")), axis=0)
    place = xp.arange(len(values), device=values.device).reshape(-1, *[1] * (values.ndim - 1))
    return xp.where(count > 1, xp.where(place == count // 2, ordered, 0.0).sum(axis=0), 0.0)
