"""Judges that keep all ratings so far: by themselves, or weighted by the similarity of the
raters.
"""

from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, cast, namespace
from roletrust_env.parameters import Lam, Share, checked_dataclass
from roletrust_env.shapes import PerAdviser, PerPair, PerRater
from roletrust_env.trees import COUNTS, SHARES, ValueRange
from roletrust_env.trust.personal import (
    Personal,
    by_pairs,
    credences,
    mean_of_sums,
    product,
    weighted_advice,
    with_self,
)
from roletrust_env.trust.ratings import Ratings, occurred, smooth


class Experience(NamedTuple):
    """All ratings so far, by rater and provider.

    Attributes:
        counts: Number of ratings, shape (S, P, ...).
        sums: Sum of the ratings, shape (S, P, ...).
    """

    counts: Annotated[PerPair, COUNTS]
    sums: Annotated[PerPair, ValueRange(0, "counts")]

    @classmethod
    def none(cls, like: PerPair) -> "Experience":
        """Return the experience before any rating; for `like` see `TrustModel.start`."""
        xp = namespace(like)
        return cls(xp.zeros_like(like), xp.zeros_like(like))

    def after(self, ratings: Ratings) -> "Experience":
        """Return the experience after one more round."""
        return Experience(self.counts + ratings.weights, self.sums + ratings.values)


class SimilarityState(NamedTuple):
    """Memory of a model that weights raters by their similarity to the judge.

    Attributes:
        known: All ratings so far.
        trust: Trust of each judge in each provider, shape (S, P, ...).
        credence: Credence of each judge in each rater, shape (S, S, ...).
    """

    known: Experience
    trust: Annotated[PerPair, SHARES]
    credence: Annotated[PerAdviser, SHARES]


def disagreement(known: Experience) -> tuple[PerAdviser, PerAdviser]:
    """Return the mean squared difference of two raters' mean ratings over common providers, and
    their number.

    The differences are taken one by one, in temporary arrays of shape (S, S, P, ...). A matrix
    product would leave the rounding error of large sums for raters who agree, which a root
    magnifies.

    Returns:
        The mean squares, shape (S, S, ...), in [0, 1], and 0 without common providers; and the
        number of common providers, of the same shape.
    """
    xp = namespace(known.sums)
    rated = occurred(known.counts)
    means = known.sums / xp.where(known.counts > 0, known.counts, 1.0)

    def squares(judges: slice, advisers: slice) -> Array:
        apart = (
            rated[judges, None]
            * rated[None, advisers]
            * (means[judges, None] - means[None, advisers])
        )
        return (apart * apart).sum(axis=2)

    common = product(rated, rated.swapaxes(0, 1))
    return by_pairs(squares, rated) / xp.where(common > 0, common, 1.0), common


class OwnState(NamedTuple):
    """Memory of the judges.

    Attributes:
        known: All ratings so far.
        trust: Trust of each judge in each provider, shape (S, P, ...).
    """

    known: Experience
    trust: Annotated[PerPair, SHARES]


@checked_dataclass
class OwnExperience(Personal):
    """Control without a reputation system: the mean of a judge's own ratings so far, which no liar
    reaches.

        T[i, j] = sum of the ratings of j by i / number of these ratings

    A personal model that is no better than this one gains nothing by listening to others. Published
    trust is the mean of the judges, liars included. Without a rating of its own, a judge keeps its
    trust.

    Attributes:
        initial: Trust before any rating, in [0, 1].
    """

    initial: Share = 0.5
    rates_raters = False

    def start(self, like: PerPair) -> OwnState:
        """Return the initial trust of all judges. See `TrustModel.start`."""
        known = Experience.none(like)
        return OwnState(known, known.sums + self.initial)

    def update(self, state: OwnState, ratings: Ratings) -> OwnState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        known = state.known.after(ratings)
        xp = namespace(ratings.values)
        own = xp.clip(mean_of_sums(known.sums, known.counts), 0.0, 1.0)
        return OwnState(known, xp.where(known.counts > 0, own, state.trust))

    def rater_trust(self, state: OwnState) -> PerRater:
        """Return 1 for each rater, since nobody is asked, shape (S, ...)."""
        return 0 * state.trust[:, 0] + 1


_TINY = (
    1e-30  # keeps the slope of a root finite where raters agree; elsewhere it is lost in rounding
)


@checked_dataclass
class PeerTrust(Personal):
    """PeerTrust (PSM): mean of all ratings so far, each weighted by the similarity of its rater to
    the judge.

        Sim(v, w) = 1 - sqrt(mean over providers both have rated of the squared difference of their
                mean ratings)
        T[w, j]   = sum over ratings x of j by v of Sim(v, w) x / sum over the same of Sim(v, w)

    Xiong and Liu (2004), with the personalised similarity measure for the credibility of raters;
    without the factors of transaction and community context, and without time windows: every rating
    counts for ever. With no provider in common Sim is 0, and a judge's own ratings have Sim = 1.
    Added where the paper leaves something open: a judge without any ratings to use keeps its trust,
    and `initial` is the credence of two raters with nothing in common.

    Attributes:
        initial: Trust before any rating, in [0, 1].
    """

    initial: Share = 0.5
    rates_raters = True
    source = "Xiong and Liu (2004)"
    cost = "S^2 P"

    def start(self, like: PerPair) -> SimilarityState:
        """Return the initial trust of all agents. See `TrustModel.start`."""
        known = Experience.none(like)
        return SimilarityState(known, known.sums + self.initial, credences(like, self.initial))

    def update(self, state: SimilarityState, ratings: Ratings) -> SimilarityState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings.values)
        known = state.known.after(ratings)
        squares, common = disagreement(known)
        similarity = 1 - xp.sqrt(squares + _TINY)
        mean, weight = weighted_advice(
            xp.where(common > 0, similarity, 0.0), known.sums, known.counts
        )
        trust = xp.where(weight > 0, mean, state.trust)
        return SimilarityState(known, trust, xp.where(common > 0, similarity, self.initial))


@checked_dataclass
class Clustering(Personal):
    """Clustering: mean of the ratings by the raters in the judge's own cluster, then the usual
    smoothing.

    The idea is that of iCLUB (Liu et al. 2011). Its clustering could not be checked, so this is not
    claimed to be that model. A rater's vector is its mean rating of every provider so far. Two
    raters are linked if they have rated a provider in common and their vectors are at most
    `threshold` apart, as the root mean square over the providers in common. A cluster is a
    connected set of raters (single linkage). A rater in the judge's cluster has credence 1. A rater
    outside has 0 if the two have a provider in common, and `initial` otherwise.

    Attributes:
        lam: Weight of the newest round in the trust of a provider, in [0.5, 1).
        initial: Trust before any rating, in [0, 1].
        threshold: Maximum distance of two linked raters, in [0, 1].
    """

    lam: Lam = 0.5
    initial: Share = 0.5
    threshold: Share = 0.3
    rates_raters = True
    source = "after Liu et al. (2011)"
    differentiable = False
    cost = "S^2 P + S^3 log S"

    def start(self, like: PerPair) -> SimilarityState:
        """Return the initial trust of all agents. See `TrustModel.start`."""
        known = Experience.none(like)
        return SimilarityState(known, known.sums + self.initial, credences(like, self.initial))

    def update(self, state: SimilarityState, ratings: Ratings) -> SimilarityState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings.values)
        known = state.known.after(ratings)
        squares, common = disagreement(known)
        together = _connected(
            cast((common > 0) & (squares <= self.threshold**2), ratings.values.dtype)
        )
        heard, weight = weighted_advice(together, ratings.values, ratings.weights)
        trust = smooth(heard, state.trust, self.lam, weight)
        credence = xp.where((together > 0) | (common > 0), together, self.initial)
        return SimilarityState(known, trust, credence)


def _connected(links: Array) -> Array:
    """Return 1 where a path of links, 0 or 1, shape (S, S, ...), connects two raters, and on the
    diagonal; 0 elsewhere.

    Every squaring doubles the length of the paths, and no path needs more than S - 1 links.
    """
    reached = with_self(links)
    for _ in range(max(links.shape[0] - 2, 0).bit_length()):
        reached = cast(product(reached, reached) > 0, links.dtype)
    return reached
