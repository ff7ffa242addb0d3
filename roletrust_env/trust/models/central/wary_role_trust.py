"""Cautious role-trust: old ratings still count, trusted raters count for more, and trust rises
slowly.
"""

from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import Factor, Lam, Power, Share, checked_dataclass
from roletrust_env.shapes import PerPair, PerProvider, PerRater
from roletrust_env.trees import SHARES
from roletrust_env.trust.algorithms import sinc, upper_median, without_rounding
from roletrust_env.trust.ratings import (
    PROVIDER,
    RATER,
    Published,
    Ratings,
    mean,
    smooth,
    weighted_mean,
)

_LEAST = 0.01
"""Minimum trust of a rater in its weight, so that weights do not vanish where no rater is
trusted."""


class WaryState(NamedTuple):
    """Memory of wary role-trust.

    Attributes:
        tor: Trust of the raters, ToR, shape (S, ...).
        top: Trust of the providers, ToP, shape (P, ...).
        last: Last rating that i gave j, shape (S, P, ...), 0 where there is none.
        fresh: Remaining weight of that rating, shape (S, P, ...), 0 where there is none.
    """

    tor: Annotated[PerRater, SHARES]
    top: Annotated[PerProvider, SHARES]
    last: Annotated[PerPair, SHARES]
    fresh: Annotated[PerPair, SHARES]


@checked_dataclass
class WaryRoleTrust(Published):
    """Wary role-trust: role-trust with a consensus of trusted raters, and trust that falls fast and
    rises slowly.

    The idea is that of Su and Saint-Jore (EWSN 2023): two roles, raters trusted by their distance
    to the consensus, and providers by good, steady ratings of trusted raters. Four things are new.
    Each is switched off by one value of one parameter:

        w[i, j] = fresh[i, j] max(ToR[i], 0.01)^power
                1 for a rating of this round, times keep each round
        c[j]    = sum over the raters i of w[i, j] g[i, j] / sum of w[i, j]
                g[i, j] is i's last rating of j
        QoR[i]  = 1 - mean over the providers j that i rated of sqrt(|f[i, j] - c[j]|)
        ToR[i] <- lam QoR[i] + (1 - lam) ToR[i]
        QoP[j]  = sum over the raters i of w[i, j] sinc(1 - g[i, j]) g[i, j] / sum of w[i, j],
                ToR as just updated
        d[j]    = QoP[j] - ToP[j],
                h = the median of d over the providers that were rated, the upper of two
        own[j]  = min(d[j] - (h if h < -shock else 0), 0)
        ToP[j] <- ToP[j] + lam (own[j] + rise (d[j] - own[j]))

    - `power`: The mean is weighted, where the paper's is plain. ToR then decides which raters count
      and does not lower ToP. With 0 all raters count alike.
    - `keep`: A rater's last rating counts also in rounds in which it does not rate, so that the few
      raters that are present do not decide alone. With 0 only ratings of this round count.
    - `shock`: If most providers fall together, the common fall is the world's doing, and only the
      rest of a fall is a provider's own. With 1 every fall is the provider's own.
    - `rise`: The paper's stability term punishes both edges of a change. Here the price of unsteady
      service is a slow rise. Newcomers rise as slowly, and trust follows the world's doing as
      slowly. With 1 trust rises as fast as it falls.

    At a tie, where c[j] is midway between the lowest and the highest g[i, j] up to rounding, it is
    set to the exact middle. If two halves of equally trusted raters rate 0 and 1, the trust of both
    tends to 1 - sqrt(1/2). Neither half wins, whatever the order of the raters. One more rater on
    one side decides.

    Attributes:
        lam: Weight of the newest round, in [0.5, 1), for raters, and for providers that fall.
        initial: Trust before any rating, in [0, 1].
        rise: Rate of rising, as a share of the rate of falling, in (0, 1].
        power: Exponent of a rater's trust in its weight, in [0, 8].
        keep: Share of the weight of a rating that remains after a round, in [0, 1].
        shock: Median fall above which the fall is the world's doing, in [0, 1].
    """

    lam: Lam = 0.5
    initial: Share = 0.5
    rise: Factor = 0.1
    power: Power = 2.0
    keep: Share = 0.5
    shock: Share = 0.1
    rates_raters = True
    source = "after Su and Saint-Jore (2023)"
    differentiable = (
        False  # the median jumps between providers, and falls are forgiven from the shock on
    )

    def start(self, like: PerPair) -> WaryState:
        """Return the state before any rating, with initial trust for all. See
        `TrustModel.start`.
        """
        nothing = namespace(like).zeros_like(like)
        return WaryState(
            nothing[:, 0, ...] + self.initial, nothing[0] + self.initial, nothing, nothing
        )

    def update(self, state: WaryState, ratings: Ratings) -> WaryState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp, pairs = namespace(ratings.values), ratings.pairs
        last = ratings.write(state.last, ratings.values)
        fresh = ratings.write(self.keep * state.fresh, 1.0)
        best = pairs.reduce(xp.where(fresh > 0, last, 0.0), PROVIDER, "max")
        below = last - pairs.gather(best, PROVIDER)  # raters who agree are exactly 0 apart
        consensus = weighted_mean(pairs, below, self._weights(pairs, fresh, state.tor), PROVIDER)
        lowest = -pairs.reduce(xp.where(fresh > 0, -below, 0.0), PROVIDER, "max")
        consensus = pairs.gather(_level(consensus, lowest, pairs.shape[0]), PROVIDER)
        distance = mean(
            ratings, ratings.read(xp.sqrt(without_rounding(abs(below - consensus)))), RATER
        )
        tor = smooth(1 - distance, state.tor, self.lam, ratings.count(RATER))
        quality = weighted_mean(
            pairs, sinc(1 - last) * last, self._weights(pairs, fresh, tor), PROVIDER
        )
        return WaryState(tor, self._moved(state.top, quality, ratings.rated(PROVIDER)), last, fresh)

    def _weights(self, pairs: Ratings, fresh: Array, tor: Array) -> Array:
        """Return the weights w, one for each pair."""
        return fresh * pairs.gather(namespace(tor).clip(tor, _LEAST, None) ** self.power, RATER)

    def _moved(self, top: Array, quality: Array, rated: Array) -> Array:
        """Return ToP after the round, shape (P, ...); `rated` is true for providers with a
        rating.
        """
        xp = namespace(top)
        change = xp.where(rated, quality - top, 0.0)
        common = upper_median(change, rated)
        own = xp.clip(change - xp.where(common < -self.shock, common, 0.0), None, 0)
        return top + self.lam * (own + self.rise * (change - own))


def _level(consensus: Array, lowest: Array, raters: int) -> Array:
    """Return the consensus, at a tie exactly in the middle between the lowest rating and the
    highest, which is at 0.

    Otherwise rounding, and with it the order of raters, would decide a tie, and the weights would
    amplify it.
    """
    xp, middle = namespace(consensus), lowest / 2
    rounding = float(xp.finfo(consensus.dtype).eps) * (4 + raters / 4)
    return xp.where(abs(consensus - middle) <= rounding * abs(lowest), middle, consensus)
