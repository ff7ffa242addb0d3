"""PeerTrust with personalised similarity: raters count by their similarity to the judge."""

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import Share, checked_dataclass
from roletrust_env.trust.judges import Personal, credences, published_raters, weighted_advice
from roletrust_env.trust.ratings import Ratings
from roletrust_env.trust.similarity import Experience, Likened, disagreement

_TINY = 1e-30  # keeps the slope of a root finite where raters agree; elsewhere it is lost in rounding


@checked_dataclass
class PeerTrust(Personal):
    """PeerTrust (PSM): mean of all ratings so far, each weighted by the similarity of its rater to the judge.

        Sim(v, w) = 1 - sqrt(mean over providers both have rated of the squared difference of their mean ratings)
        T[w, j]   = sum over ratings x of j by v of Sim(v, w) x / sum over the same of Sim(v, w)

    Xiong and Liu (2004), with the personalised similarity measure for the credibility of raters; without the factors of
    transaction and community context, and without time windows: every rating counts for ever. With no provider in
    common Sim is 0, and a judge's own ratings have Sim = 1. Added where the paper leaves something open: a judge
    without any ratings to use keeps its trust, and `initial` is the credence of two raters with nothing in common.

    Attributes:
        initial: Trust before any rating, in [0, 1].
    """

    initial: Share = 0.5
    rates_raters = True
    source = "Xiong and Liu (2004)"
    cost = "S^2 P"

    def start(self, like: Array) -> Likened:
        """Return the initial trust of all agents. See `TrustModel.start`."""
        known = Experience.none(like)
        return Likened(known, known.sums + self.initial, credences(like, self.initial))

    def update(self, state: Likened, ratings: Ratings) -> Likened:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings.values)
        known = state.known.after(ratings)
        squares, common = disagreement(known)
        similarity = 1 - xp.sqrt(squares + _TINY)
        mean, weight = weighted_advice(xp.where(common > 0, similarity, 0.0), known.sums, known.counts)
        trust = xp.where(weight > 0, mean, state.trust)
        return Likened(known, trust, xp.where(common > 0, similarity, self.initial))

    def rater_trust(self, state: Likened) -> Array:
        """Return the other judges' mean similarity to each rater, shape (S, ...)."""
        return published_raters(state.credence)
