"""Clustering: a judge believes the raters in its own cluster."""

from roletrust_env.arrays import Array, cast, namespace
from roletrust_env.parameters import Lam, Share, checked_dataclass
from roletrust_env.trust.judges import (
    Personal,
    credences,
    product,
    published_raters,
    weighted_advice,
    with_self,
)
from roletrust_env.trust.ratings import Ratings, smooth
from roletrust_env.trust.similarity import Experience, Likened, disagreement


@checked_dataclass
class Clustering(Personal):
    """Clustering: mean of the ratings by the raters in the judge's own cluster, then the usual smoothing.

    The idea is that of iCLUB (Liu et al. 2011). Its clustering could not be checked, so this is not claimed to be that
    model. A rater's vector is its mean rating of every provider so far. Two raters are linked if they have rated
    a provider in common and their vectors are at most `threshold` apart, as the root mean square over the providers in
    common. A cluster is a connected set of raters (single linkage). A rater in the judge's cluster has credence 1. A
    rater outside has 0 if the two have a provider in common, and `initial` otherwise.

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

    def start(self, like: Array) -> Likened:
        """Return the initial trust of all agents. See `TrustModel.start`."""
        known = Experience.none(like)
        return Likened(known, known.sums + self.initial, credences(like, self.initial))

    def update(self, state: Likened, ratings: Ratings) -> Likened:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings.values)
        known = state.known.after(ratings)
        squares, common = disagreement(known)
        together = _connected(cast((common > 0) & (squares <= self.threshold**2), ratings.values.dtype))
        heard, weight = weighted_advice(together, ratings.values, ratings.weights)
        trust = smooth(heard, state.trust, self.lam, weight)
        credence = xp.where((together > 0) | (common > 0), together, self.initial)
        return Likened(known, trust, credence)

    def rater_trust(self, state: Likened) -> Array:
        """Return the other judges' mean credence in each rater, shape (S, ...)."""
        return published_raters(state.credence)


def _connected(links: Array) -> Array:
    """Return 1 where a path of links, 0 or 1, shape (S, S, ...), connects two raters, and on the diagonal; 0 elsewhere.

    Every squaring doubles the length of the paths, and no path needs more than S - 1 links.
    """
    reached = with_self(links)
    for _ in range(max(links.shape[0] - 2, 0).bit_length()):
        reached = cast(product(reached, reached) > 0, links.dtype)
    return reached
