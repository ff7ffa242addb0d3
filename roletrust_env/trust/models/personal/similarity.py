"""Judges that keep all ratings so far: by themselves, or weighted by the similarity of the
raters.
"""

from typing import Annotated, NamedTuple

from roletrust_env.arrays import Array, cast, namespace
from roletrust_env.parameters import Lam, Share, checked_dataclass
from roletrust_env.shapes import PerAdviser, PerPair, PerRater
from roletrust_env.trees import SHARES
from roletrust_env.trust.personal import (
    Evidence,
    Personal,
    by_judges,
    credences,
    others,
    product,
    weighted_advice,
)
from roletrust_env.trust.ratings import Ratings, occurred, smooth


class SimilarityState(NamedTuple):
    """Memory of a model that weights raters by their similarity to the judge.

    Attributes:
        own: All services that the judges received.
        said: All ratings that were delivered.
        trust: Trust of each judge in each provider, shape (S, P, ...).
        credence: Credence of each judge in each rater, shape (S, S, ...).
    """

    own: Evidence
    said: Evidence
    trust: Annotated[PerPair, SHARES]
    credence: Annotated[PerAdviser, SHARES]


def disagreement(own: Evidence, said: Evidence) -> tuple[PerAdviser, PerAdviser]:
    """Return the mean squared difference of the means that a judge and an adviser have of common
    providers, and the number of these.

    The differences are taken one by one, in temporary arrays of shape (S, S, P, ...). A matrix
    product would leave the rounding error of large sums for raters who agree, which a root
    magnifies.

    Args:
        own: Evidence of the judges.
        said: Evidence of the advisers.

    Returns:
        The mean squares, shape (S, S, ...), in [0, 1], and 0 without common providers; and the
        number of common providers, of the same shape.
    """
    xp = namespace(own.sums)
    met, rated = occurred(own.counts), occurred(said.counts)
    seen, reported = (
        each.sums / xp.where(each.counts > 0, each.counts, 1.0) for each in (own, said)
    )

    def squares(judges: slice) -> Array:
        apart = met[judges, None] * rated[None] * (seen[judges, None] - reported[None])
        return (apart * apart).sum(axis=2)

    common = product(met, rated.swapaxes(0, 1))
    return by_judges(squares, rated) / xp.where(common > 0, common, 1.0), common


class OwnState(NamedTuple):
    """Memory of the judges.

    Attributes:
        known: All services that the judges received.
        trust: Trust of each judge in each provider, shape (S, P, ...).
    """

    known: Evidence
    trust: Annotated[PerPair, SHARES]


@checked_dataclass
class OwnExperience(Personal):
    """Control without a reputation system: the mean of the services that a judge itself received,
    which no liar reaches.

        T[i, j] = sum of i's perceptions of the services of j / number of these services

    A personal model that is no better than this one gains nothing by listening to others. Published
    trust is the mean of the judges, liars included. Without a service of its own, a judge keeps its
    trust.

    Attributes:
        initial: Trust before any rating, in [0, 1].
    """

    initial: Share = 0.5
    rates_raters = False

    def start(self, like: PerPair) -> OwnState:
        """Return the initial trust of all judges. See `TrustModel.start`."""
        known = Evidence.none(like)
        return OwnState(known, known.sums + self.initial)

    def update(self, state: OwnState, ratings: Ratings) -> OwnState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        known = state.known.after(ratings.experience)
        xp = namespace(ratings.values)
        own = xp.clip(known.means, 0.0, 1.0)
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
    counts for ever. With no provider in common Sim is 0, and a judge's own experience has Sim = 1.
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
        none = Evidence.none(like)
        return SimilarityState(none, none, none.sums + self.initial, credences(like, self.initial))

    def update(self, state: SimilarityState, ratings: Ratings) -> SimilarityState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings.values)
        own, said = state.own.after(ratings.experience), state.said.after(ratings)
        squares, common = disagreement(own, said)
        similarity = 1 - xp.sqrt(squares + _TINY)
        mean, weight = weighted_advice(xp.where(common > 0, similarity, 0.0), said, own)
        trust = xp.where(weight > 0, mean, state.trust)
        return SimilarityState(own, said, trust, xp.where(common > 0, similarity, self.initial))


@checked_dataclass
class Clustering(Personal):
    """Clustering: mean of the ratings by the raters in the judge's own cluster, then the usual
    smoothing.

    The idea is that of iCLUB (Liu et al. 2011). Its clustering could not be checked, so this is not
    claimed to be that model. A rater's vector is its mean rating of every provider so far, and a
    judge's the mean of the services that it received. Two are linked if they know a provider in
    common and their vectors are at most `threshold` apart, as the root mean square over the
    providers in common. A cluster is a connected set of raters (single linkage). A judge's cluster
    are the raters that it is linked to, with their clusters. A rater in it has credence 1. A rater
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
        none = Evidence.none(like)
        return SimilarityState(none, none, none.sums + self.initial, credences(like, self.initial))

    def update(self, state: SimilarityState, ratings: Ratings) -> SimilarityState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings.values)
        own, said = state.own.after(ratings.experience), state.said.after(ratings)
        linked, common = self._links(own, said)
        clusters = _connected(self._links(said, said)[0])
        together = cast(product(linked, clusters) > 0, linked.dtype)
        advice, weight = weighted_advice(
            together, Evidence.of(ratings), Evidence.of(ratings.experience)
        )
        trust = smooth(advice, state.trust, self.lam, weight)
        credence = xp.where((together > 0) | (common > 0), together, self.initial)
        return SimilarityState(own, said, trust, credence)

    def _links(self, own: Evidence, said: Evidence) -> tuple[PerAdviser, PerAdviser]:
        """Return 1 where a judge and an adviser are linked and 0 elsewhere, shape (S, S, ...), and
        the number of providers that they have in common.
        """
        squares, common = disagreement(own, said)
        return cast((common > 0) & (squares <= self.threshold**2), own.sums.dtype), common


def _connected(links: Array) -> Array:
    """Return 1 where a path of links, 0 or 1, shape (S, S, ...), connects two raters, and on the
    diagonal; 0 elsewhere.

    Every squaring doubles the length of the paths, and no path needs more than S - 1 links.
    """
    reached = 1 - others(links) * (1 - links)
    for _ in range(max(links.shape[0] - 2, 0).bit_length()):
        reached = cast(product(reached, reached) > 0, links.dtype)
    return reached
