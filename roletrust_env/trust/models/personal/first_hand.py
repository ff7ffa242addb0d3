"""First-hand trust: each judge goes by its own ratings first, and by others as far as they agree
with these.
"""

from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, namespace, total
from roletrust_env.parameters import Power, Ridge, Share, checked_dataclass
from roletrust_env.shapes import PerAdviser, PerPair
from roletrust_env.trees import SHARES
from roletrust_env.trust.algorithms import safe_power
from roletrust_env.trust.personal import (
    Evidence,
    Personal,
    by_judges,
    credences,
    heard,
    product,
    unknown_first,
)
from roletrust_env.trust.ratings import Ratings


class FirstHandState(NamedTuple):
    """Memory of the judges.

    Attributes:
        own: Services that each judge received, weighted and faded.
        said: Ratings that each rater delivered, weighted and faded alike.
        trust: Trust of each judge in each provider, shape (S, P, ...).
        credence: Credence of each judge in each rater, shape (S, S, ...).
    """

    own: Evidence
    said: Evidence
    trust: Annotated[PerPair, SHARES]
    credence: Annotated[PerAdviser, SHARES]


@checked_dataclass
class FirstHand(Personal):
    """First-hand trust: what a judge has seen itself counts most, and agreement with it makes
    others count.

        s[k, j] <- keep s[k, j] + f[k, j],   n[k, j] <- keep n[k, j] + 1      only where k rated j
        x[k, j]  = s[k, j] / n[k, j],   v[k, j] = n[k, j] / (1 + limit n[k, j])
        s', n', x', v': the same of the services that i itself received, as i perceived them
        C[i, k]  = ((doubt + sum over j of v'[i, j] v[k, j] (1 - |x'[i, j] - x[k, j]|))
                    / (1 + sum over j of v'[i, j] v[k, j]))^power
        T[i, j]  = (prior initial + own n'[i, j] x'[i, j] + sum over k of C[i, k] v[k, j] x[k, j])
                    / (prior + own n'[i, j] + sum over k of C[i, k] v[k, j]),   k other than i

    It is `leave-one-out` for a judge that has experience of its own: a liar that is the majority
    misleads nobody who has met the provider, and who contradicts a judge in one place is not
    believed by it in others. Credence is computed anew from all ratings, so a lie of long ago that
    the judge now sees through counts, too.

    By its own choice rule, a judge first goes to providers without a service or a rating, at
    random, and then to the most trusted one.

    Attributes:
        initial: Trust without any rating, in [0, 1].
        keep: Share of a rating's weight that remains when its rater rates its provider again, in
            [0, 1].
        prior: Number of voices that the prior counts, at least 0.001.
        own: Number of voices that a rating of the judge's own counts, at least 0.001.
        power: Exponent that turns agreement into credence, in [0, 8].
        doubt: Agreement with a rater that has rated no provider of the judge's, in [0, 1]; it
            counts as one comparison.
        limit: Inverse of the largest weight of a pair, in [0, 1].
    """

    initial: Share = 0.5
    keep: Share = 1.0
    prior: Ridge = 0.2
    own: Ridge = 5.0
    power: Power = 8.0
    doubt: Share = 0.8
    limit: Share = 0.3
    rates_raters = True
    cost = "S^2 P"

    def start(self, like: PerPair) -> FirstHandState:
        """Return the initial trust and credence of all judges. See `TrustModel.start`."""
        none = Evidence.none(like)
        return FirstHandState(
            none, none, none.sums + self.initial, credences(like, self.doubt**self.power)
        )

    def update(self, state: FirstHandState, ratings: Ratings) -> FirstHandState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings.values)
        own = self._remembered(state.own, ratings.experience)
        said = self._remembered(state.said, ratings)
        seen, reported = own.means, said.means
        own_voice, voice = self._voice(own), self._voice(said)

        def agree(judges: slice) -> Array:
            apart = abs(seen[judges, None] - reported[None])
            return total(own_voice[judges, None] * voice[None] * (1 - apart), 2)

        compared = product(own_voice, voice.swapaxes(0, 1))
        agreement = xp.clip((self.doubt + by_judges(agree, voice)) / (1 + compared), 0.0, 1.0)
        credence = safe_power(agreement, self.power)
        weight = self.own * own.counts
        sums = self.prior * self.initial + weight * seen + heard(credence, voice * reported)
        trust = sums / (self.prior + weight + heard(credence, voice))
        return FirstHandState(own, said, xp.clip(trust, 0.0, 1.0), credence)

    def preference(self, state: FirstHandState, noise: PerPair) -> PerPair:
        """Return how much each judge wants each provider, shape (S, P, ...). See `TrustModel`."""
        known = heard(state.credence, state.said.counts) + state.own.counts
        return unknown_first(known, state.trust, noise)

    def _remembered(self, evidence: Evidence, ratings: Ratings) -> Evidence:
        """Return the sums s and n after one more round."""
        kept = 1 - (1 - self.keep) * ratings.weights
        return Evidence(
            kept * evidence.counts + ratings.weights,
            kept * evidence.sums + ratings.weights * ratings.values,
        )

    def _voice(self, evidence: Evidence) -> PerPair:
        """Return the weight v of each pair, shape (S, P, ...)."""
        return evidence.counts / (1 + self.limit * evidence.counts)
