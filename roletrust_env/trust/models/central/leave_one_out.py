"""Leave-one-out trust: each rater is compared with the others, and has one voice about each
provider.
"""

from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import Power, Ridge, Share, checked_dataclass
from roletrust_env.shapes import PerPair, PerProvider, PerRater
from roletrust_env.trees import AMOUNTS, SHARES, ValueRange
from roletrust_env.trust.algorithms import safe_power, upper_median
from roletrust_env.trust.models.central.beta_reputation import remaining
from roletrust_env.trust.ratings import PROVIDER, RATER, TINY, Published, Ratings


class LeaveOneOutState(NamedTuple):
    """Memory of leave-one-out trust.

    Attributes:
        tor: Trust of the raters, ToR, shape (S, ...).
        top: Trust of the providers, ToP, shape (P, ...).
        sums: Sum of the ratings of each pair, faded, shape (S, P, ...).
        counts: Number of these ratings, faded alike, shape (S, P, ...).
    """

    tor: Annotated[PerRater, SHARES]
    top: Annotated[PerProvider, SHARES]
    sums: Annotated[PerPair, ValueRange(0, "counts")]
    counts: Annotated[PerPair, AMOUNTS]


@checked_dataclass
class LeaveOneOut(Published):
    """Leave-one-out trust: a rater is trusted as far as it agrees with the others, a provider as
    trusted raters say.

        s[i, j] <- keep s[i, j] + f[i, j],   n[i, j] <- keep n[i, j] + 1
                f and 1 only where i rated j
        x[i, j]  = s[i, j] / n[i, j],   v[i, j] = n[i, j] / (1 + limit n[i, j]),
                w[i, j] = v[i, j] ToR[i]
        m[j]     = sum over i of w[i, j] x[i, j] / sum of w[i, j]
        b        = initial - modesty max(initial - median over the rated providers j of m[j], 0)
        c[i, j]  = (prior b + sum over k of w[k, j] x[k, j]) / (prior + W[i, j]),
                W[i, j] = sum over k of w[k, j],
                   both without i itself, or with the share `own` of its weight
        e[i, j]  = v[i, j] W[i, j] / (W[i, j] + prior)
        ToR[i]   = ((doubt + sum over j of e[i, j] (1 - |x[i, j] - c[i, j]|)) / (1 + sum over j of
                e[i, j]))^power
        ToP[j]   = (prior b + sum over i of w[i, j] x[i, j]) / (prior + sum over i of w[i, j])

    ToR is of the raters of the round; others keep theirs. ToP has w and b with ToR as just updated.
    The ratings of a provider fade in each round in which it is rated. The median is the upper of
    two.

    - `own`: A rater is not compared with itself. A rating that is alone is no evidence for its
      rater, since nobody else was there. With 1 the rater is in the view that it is compared with.
    - `limit`: A pair has one voice of at most 1 / limit, however often the rater repeats itself.
      With 0 every rating is a voice.
    - `modesty`: The prior is no higher than the median provider, so that nobody outranks more than
      half of the rated providers by being unrated. With 0 the prior is `initial`.
    - `power`: A rater that is somewhat further from the others counts for far less. With 0 all
      raters count alike, and their trust is 1.
    - `keep`: Old ratings fade. With 1 none is forgotten.
    - `prior`: Few ratings move trust little.

    Attributes:
        initial: Trust in a provider before any rating, in [0, 1].
        keep: Share of a rating's weight that remains when its provider is rated in another round,
            in [0, 1].
        prior: Number of voices that the prior counts, at least 0.001.
        power: Exponent that turns agreement into trust in a rater, in [0, 8].
        doubt: Agreement of a rater that was compared with nobody, in [0, 1]; it counts as one
            comparison.
        own: Share of a rater's own weight in the view that it is compared with, in [0, 1].
        limit: Inverse of the largest weight of a pair, in [0, 1].
        modesty: Share of the way from `initial` down to the median provider, in [0, 1].
    """

    initial: Share = 0.5
    keep: Share = 0.9
    prior: Ridge = 0.2
    power: Power = 6.0
    doubt: Share = 0.8
    own: Share = 0.0
    limit: Share = 1.0
    modesty: Share = 1.0
    rates_raters = True
    differentiable = False  # the median jumps between providers

    def start(self, like: PerPair) -> LeaveOneOutState:
        """Return the state before any rating. See `TrustModel.start`."""
        nothing = namespace(like).zeros_like(like)
        tor = nothing[:, 0, ...] + self.doubt**self.power
        return LeaveOneOutState(tor, nothing[0] + self.initial, nothing, nothing)

    def update(self, state: LeaveOneOutState, ratings: Ratings) -> LeaveOneOutState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp, pairs, none = namespace(ratings.values), ratings.pairs, 0 * state.sums
        remains = pairs.gather(remaining(self.keep, ratings), PROVIDER)
        sums = remains * state.sums + ratings.write(none, ratings.values)
        counts = remains * state.counts + ratings.write(none, 1.0)
        voice, above = counts / (1 + self.limit * counts), sums / (counts + TINY) - self.initial
        weights = voice * pairs.gather(state.tor, RATER)
        # Sums over the raters of each provider.
        weight, said = pairs.reduce(weights, PROVIDER), pairs.reduce(weights * above, PROVIDER)
        rated = pairs.reduce(voice, PROVIDER) > 0
        base = self._base(said, weight, rated)
        # The view of the others: all weights and ratings of a provider, less the rater's own.
        own, apart = (1 - self.own) * weights, above - base
        heard = xp.clip(pairs.gather(weight, PROVIDER) - own, 0.0, None)
        view = (pairs.gather(pairs.reduce(weights * apart, PROVIDER), PROVIDER) - own * apart) / (
            heard + self.prior
        )
        evidence = voice * heard / (heard + self.prior)
        agreed = self.doubt + pairs.reduce(evidence * (1 - abs(apart - view)), RATER)
        agreement = xp.clip(agreed / (1 + pairs.reduce(evidence, RATER)), 0.0, 1.0)
        tor = xp.where(ratings.rated(RATER), safe_power(agreement, self.power), state.tor)
        weights = voice * pairs.gather(tor, RATER)
        weight, said = pairs.reduce(weights, PROVIDER), pairs.reduce(weights * above, PROVIDER)
        said = said + self.prior * self._base(said, weight, rated)
        top = xp.clip(self.initial + said / (weight + self.prior), 0.0, 1.0)
        return LeaveOneOutState(tor, top, sums, counts)

    def _base(self, said: Array, weight: Array, rated: Array) -> Array:
        """Return the prior of the providers, less `initial`: shape (...), at most 0."""
        median = upper_median(said / (weight + TINY), rated)
        return self.modesty * namespace(said).clip(median, None, 0.0)
