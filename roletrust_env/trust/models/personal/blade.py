"""BLADE: judges learn what each adviser says of a service of each quality, and read advice
backwards by Bayes' rule.
"""

from typing import Annotated, NamedTuple

from pydantic import Field

from roletrust_env.arrays import Array, device_of, largest, namespace, total
from roletrust_env.parameters import Factor, checked_dataclass
from roletrust_env.shapes import PerAdviser, PerPair, Shape
from roletrust_env.trees import POSITIVE, SHARES
from roletrust_env.trust.dirichlet import expected_level, in_levels, level_values
from roletrust_env.trust.personal import Personal, news, others, product
from roletrust_env.trust.ratings import Ratings


class BladeState(NamedTuple):
    """Memory of the judges of BLADE.

    Attributes:
        evidence: Parameters n of the Dirichlet distribution of provider j's services as judge i
            sees them, shape (S, levels, P, ...).
        common: Parameters m of the distributions of what adviser k says where judge i sees each
            level, shape (S, levels, S, levels, ...): judge, level that it saw, adviser, level that
            was said.
        trust: Trust of judge i in provider j, shape (S, P, ...).
        credence: Credence of judge i in adviser k, shape (S, S, ...).
    """

    evidence: Annotated[Array, Shape("S levels P ..."), POSITIVE]
    common: Annotated[Array, Shape("S levels S levels ..."), POSITIVE]
    trust: Annotated[PerPair, SHARES]
    credence: Annotated[PerAdviser, SHARES]


@checked_dataclass
class Blade(Personal):
    """BLADE: a Bayesian network of services and of what each adviser says of them, which turns lies
    into information.

    Regan, Poupart and Cohen, "Bayesian Reputation Modeling in E-Marketplaces Sensitive to
    Subjectivity, Deception and Change" (2006). Nobody is filtered or discounted: who always says
    the contrary tells as much as who is honest. For each judge i, the service of provider j in a
    round has a level x, which i sees if j serves it, and which is hidden otherwise; adviser k says
    level r. Both distributions are learned, with Dirichlet priors that are uniform:

        P(x)       = n[i, j, x] / sum over y of n[i, j, y]
        P(r | x)   = m[i, k, x, r] / sum over s of m[i, k, x, s]
        q(x)       ~ P(x) * product over the advisers k that rated j of P(r[k, j] | x)
        T[i, j]    = sum over x of P(x) times the rating that x stands for

    Where j served i, i counts one n[i, j, x], and one m[i, k, x, r] for each k that rated j in the
    round. Where j did not, the exact distribution of the services of j is a mixture of the
    Dirichlet distributions with one more x, each with its probability q(x). The model keeps the
    Dirichlet distribution with the mixture's mean and mean square:

        n <- (n + q) D / (D + (N + 2) g),   N = sum of n,   D = sum of n (N - n + 2 (1 - q)),
                g = sum of q (1 - q)

    It counts one more if q is certain, and nothing if advice says nothing.

    The paper's are the network, the Dirichlet distributions and Bayes' rule. How it treats mixtures
    and change could not be checked, so that is ours. Ours are also the levels, see
    `roletrust_env.trust.dirichlet`; that evidence fades as new evidence comes; that P(r | x) is
    learned only from services that the judge has seen; that a round's services are taken one by
    one; and the credence, which the network has not: 1 less the mean distance of x and r over m.
    The paper has several properties of a provider; here there is one, its quality.

    Attributes:
        levels: Number of levels of ratings, at least 2.
        keep: Share of the evidence that remains when one more observation comes, in (0, 1]; with 1
            nothing fades.
    """

    levels: Annotated[int, Field(ge=2, le=100)] = 3
    keep: Factor = 0.9
    rates_raters = True
    source = "Regan, Poupart and Cohen (2006)"
    cost = "S^2 P"

    def start(self, like: PerPair) -> BladeState:
        """Return the state without experience: all levels are equally probable. See
        `TrustModel.start`.
        """
        xp, levels, device = namespace(like), self.levels, device_of(like)
        raters, batch = like.shape[0], like.shape[2:]
        evidence = xp.ones((raters, levels, *like.shape[1:]), dtype=like.dtype, device=device)
        common = xp.ones((raters, levels, raters, levels, *batch), dtype=like.dtype, device=device)
        return BladeState(evidence, common, xp.zeros_like(like) + 0.5, self._credence(common, like))

    def update(self, state: BladeState, ratings: Ratings) -> BladeState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp, like = namespace(ratings.values), ratings.values
        said = in_levels(ratings, self.levels)
        seen = in_levels(ratings.experience, self.levels)
        flat, theirs = (xp.reshape(part, (-1, *part.shape[2:])) for part in (seen, said))
        pairs = product(flat, theirs.swapaxes(0, 1))
        strangers = others(like)[:, None, :, None, ...]
        counted = strangers * xp.reshape(pairs, state.common.shape)
        common = self._faded(state.common + counted, total(counted, 3)[:, :, :, None, ...])
        chance = strangers * xp.log(common / total(common, 3)[:, :, :, None, ...])
        likely = xp.reshape(product(xp.reshape(chance, pairs.shape), theirs), said.shape)
        own, guess = state.evidence + seen, _advised(state.evidence, likely)
        evidence = xp.where(ratings.experience.weights[:, None, ...] > 0, own, guess)
        gain = xp.clip(total(evidence, 1) - total(state.evidence, 1), 0.0, None)[:, None, ...]
        learned = (news(ratings) > 0)[:, None, ...]
        evidence = xp.where(learned, self._faded(evidence, gain), state.evidence)
        trust = expected_level(evidence, level_values(self.levels, like))
        return BladeState(evidence, common, trust, self._credence(common, like))

    def _faded(self, evidence: Array, gain: Array) -> Array:
        """Return evidence after it has grown by a number of observations; what exceeds the prior,
        1, fades.
        """
        return evidence + (self.keep**gain - 1) * (evidence - 1)

    def _credence(self, common: Array, like: Array) -> Array:
        """Return the mean agreement of each judge with each adviser, shape (S, S, ...), in [0,
        1].
        """
        values = level_values(self.levels, like)
        near = (1 - abs(values - values.swapaxes(0, 1)))[:, None, ...]
        return total(total(near * common, 3), 1) / total(total(common, 3), 1)


def _advised(evidence: Array, likely: Array) -> Array:
    """Return the evidence about providers after advice on one service of each that the judge did
    not see.

    Args:
        evidence: Parameters n before, shape (S, levels, P, ...).
        likely: Logarithm of the probability of the advice at each level, of the same shape.
    """
    xp = namespace(evidence)
    odds = xp.log(evidence) + likely
    odds = xp.exp(odds - largest(odds, 1)[:, None, ...])
    q = odds / total(odds, 1)[:, None, ...]
    count = total(evidence, 1)[:, None, ...]
    spread = total(evidence * (count - evidence + 2 * (1 - q)), 1)[:, None, ...]
    doubt = total(q * (1 - q), 1)[:, None, ...]
    return (evidence + q) * (spread / (spread + (count + 2) * doubt))
