"""Judges that listen to nobody, with the choice rules by which a single consumer explores.

They share the trust of `own-experience` and differ in `preference`, the choice rule for scenarios
in which `Choice.by` is `model`. With many providers and few rounds, rules that try only some of the
providers lose least (Bayati, Hamidi, Johari and Khosravi 2020).
"""

import math
from abc import ABC, abstractmethod

from roletrust_env.arrays import largest, namespace, total
from roletrust_env.parameters import Amount, Share, Size, checked_dataclass
from roletrust_env.shapes import PerPair, RaterFlags
from roletrust_env.trust.models.personal.similarity import OwnExperience, OwnState
from roletrust_env.trust.personal import Evidence, unknown_first

_FIRST = 2.0
"""Preference above that of every provider that has served the judge."""


@checked_dataclass
class UpperConfidence(OwnExperience):
    """UCB1: the provider with the highest mean plus a bonus for those that served the judge rarely.

        preference[i, j] = mean[i, j] + width sqrt(2 ln t[i] / n[i, j])

    Auer, Cesa-Bianchi and Fischer, "Finite-time analysis of the multiarmed bandit problem" (2002),
    where `width` is 1. Judge i received n[i, j] services from provider j, and t[i] in all.
    Providers that never served it come first, at random.

    Attributes:
        initial: Trust before any service, in [0, 1].
        width: Weight of the bonus, at least 0.
    """

    width: Amount = 1.0
    source = "Auer, Cesa-Bianchi and Fischer (2002)"

    def preference(self, state: OwnState, noise: PerPair) -> PerPair:
        """Return how much each judge wants each provider, shape (S, P, ...). See `TrustModel`."""
        xp, counts = namespace(noise), state.known.counts
        every = xp.clip(total(counts, 1), 1.0, None)[:, None, ...]
        bonus = self.width * xp.sqrt(2 * xp.log(every) / xp.clip(counts, 1.0, None))
        return unknown_first(counts, state.trust + bonus, noise, 1 + self.width * 10)


@checked_dataclass
class Thompson(OwnExperience):
    """Thompson sampling: the provider with the highest draw from what the judge believes of it.

        preference[i, j] = m + sqrt(m (1 - m) / (n + 3)) (sqrt(3) / pi) ln(u / (1 - u)),
                m = (s + 1) / (n + 2)

    Thompson (1933). Of n services with the sum s, m and the root are the mean and the standard
    deviation of Beta(1 + s, 1 + n - s). The draw is from the logistic distribution with both, since
    one uniform number u makes it.

    Attributes:
        initial: Trust before any service, in [0, 1]; the choice does not depend on it.
    """

    source = "Thompson (1933)"

    def preference(self, state: OwnState, noise: PerPair) -> PerPair:
        """Return how much each judge wants each provider, shape (S, P, ...). See `TrustModel`."""
        xp, (counts, sums) = namespace(noise), state.known
        mean = (sums + 1) / (counts + 2)
        u = xp.clip(noise, 1e-7, 1 - 1e-7)
        spread = xp.sqrt(mean * (1 - mean) / (counts + 3)) * (math.sqrt(3) / math.pi)
        return mean + spread * xp.log(u / (1 - u))


class Searching(OwnExperience, ABC):
    """Base of judges that try providers that never served them until they have seen enough, and
    then stay with the best of those that did.
    """

    @abstractmethod
    def searches(self, known: Evidence) -> RaterFlags:
        """Return whether each judge goes on searching, boolean, shape (S, ...)."""

    def preference(self, state: OwnState, noise: PerPair) -> PerPair:
        """Return how much each judge wants each provider, shape (S, P, ...). See `TrustModel`."""
        xp, counts = namespace(noise), state.known.counts
        return xp.where(
            self.searches(state.known)[:, None, ...],
            unknown_first(counts, state.trust, noise, _FIRST),
            xp.where(counts > 0, state.trust, noise - _FIRST),
        )


@checked_dataclass
class Threshold(Searching):
    """Threshold rule: a judge searches until a provider is good enough, and returns to it as long
    as it stays so.

    Simon, "A behavioral model of rational choice" (1955): a choice that satisfies instead of the
    best one.

    Attributes:
        initial: Trust before any service, in [0, 1].
        level: Mean quality that is good enough, in [0, 1].
    """

    level: Share = 0.8
    source = "Simon (1955)"

    def searches(self, known: Evidence) -> RaterFlags:
        """Return whether no provider is good enough, see `Searching.searches`."""
        return largest(known.means, 1) < self.level


@checked_dataclass
class Subsampled(Searching):
    """Subsampled greedy: a judge tries some providers once, drawn at random, and stays with the
    best of them.

    Bayati, Hamidi, Johari and Khosravi, "Unreasonable effectiveness of greedy algorithms in
    multi-armed bandit with many arms" (2020), who try about the square root of the number of
    rounds.

    Attributes:
        initial: Trust before any service, in [0, 1].
        sample: Number of providers that are tried, at least 1.
    """

    sample: Size = 8
    source = "Bayati et al. (2020)"

    def searches(self, known: Evidence) -> RaterFlags:
        """Return whether fewer providers served the judge, see `Searching.searches`."""
        return total(known.counts > 0, 1) < self.sample
