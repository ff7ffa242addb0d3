"""Clustering: a judge believes the raters whose ratings lie in its own cluster."""

from roletrust_env.arrays import Array, cast, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import Lam, Share
from roletrust_env.trust.algorithms import Notes, smooth
from roletrust_env.trust.judges import credences, heeded, product, published_providers, published_raters, with_self
from roletrust_env.trust.similarity import Experience, Likened, disagreement


@checked_dataclass
class Clustering:
    """Clustering: the mean of the ratings by the raters in the judge's own cluster, then the usual smoothing.

    The idea is that of iCLUB (Liu et al. 2011); how it clusters could not be checked, so this is a reading and not
    that model. A rater's vector is its mean rating of every provider so far. Two raters are linked if they have rated
    a provider in common and their vectors are at most `threshold` apart, as the root mean square over the providers in
    common; a cluster is all that links lead to (single linkage). A rater of the judge's cluster has credence 1. One
    outside has 0 if they have a provider in common, and `initial` as long as there is nothing to compare.

    Attributes:
        lam: weight of the newest round in the trust of a provider, in [0.5, 1).
        initial: trust before any rating, in [0, 1].
        threshold: how far apart two linked raters may be, in [0, 1].
    """

    lam: Lam = 0.5
    initial: Share = 0.5
    threshold: Share = 0.3
    rates_raters = True
    family = "personal"
    source = "after Liu et al. (2011)"
    smooth = False
    cost = "S^2 P + S^3 log S"

    def start(self, like: Array) -> Likened:
        """Initial trust for everyone. See `TrustModel.start`."""
        known = Experience.none(like)
        return Likened(known, known.sums + self.initial, credences(like, self.initial))

    def update(self, state: Likened, ratings: Array, mask: Array) -> Likened:
        """One round of ratings. See `TrustModel.update`."""
        xp, notes = namespace(ratings), Notes.of(ratings, mask)
        known = state.known.after(notes)
        squares, common = disagreement(known)
        together = _connected(cast((common > 0) & (squares <= self.threshold**2), ratings.dtype))
        heard, weight = heeded(together, notes.values, notes.weights)
        trust = smooth(heard, state.trust, self.lam, weight)
        credence = xp.where((together > 0) | (common > 0), together, self.initial)
        return Likened(known, trust, credence)

    def rater_trust(self, state: Likened) -> Array:
        """The mean of the other judges' credence in each rater, shape (S, ...)."""
        return published_raters(state.credence)

    def provider_trust(self, state: Likened) -> Array:
        """The mean of the judges' trust, shape (P, ...)."""
        return published_providers(state.trust)


def _connected(links: Array) -> Array:
    """1 where links, of 0 and 1, shape (S, S, ...), lead from one to the other, and in oneself; 0 elsewhere.

    Every squaring doubles how many links a way may have, and no way needs more than S - 1.
    """
    reached = with_self(links)
    for _ in range(max(links.shape[0] - 2, 0).bit_length()):
        reached = cast(product(reached, reached) > 0, links.dtype)
    return reached
