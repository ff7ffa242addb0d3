"""PeerTrust with personalised similarity: who rates as the judge does is believed."""

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import checked_dataclass
from roletrust_env.ranges import Share
from roletrust_env.trust.algorithms import Notes
from roletrust_env.trust.judges import credences, heeded, published_providers, published_raters
from roletrust_env.trust.similarity import Experience, Likened, disagreement

_TINY = 1e-30  # keeps the slope of a root finite where raters agree, and is lost in rounding everywhere else


@checked_dataclass
class PeerTrust:
    """PeerTrust (PSM): the mean of all ratings so far, each weighted by how alike its rater and the judge have rated.

        Sim(v, w) = 1 - sqrt(mean over providers both have rated of the squared difference of their mean ratings)
        T[w, j]   = sum over ratings x of j by v of Sim(v, w) x / sum over the same of Sim(v, w)

    Xiong and Liu (2004), with the personalised similarity measure for the credibility of raters; without the factors
    of transaction and community context, and without windows of time: every rating counts for ever. With no provider
    in common Sim is 0, and a judge's own ratings have Sim = 1. Read into it: a judge with nothing to go by
    keeps its trust, and where two have nothing in common yet, `initial` is published as their credence.

    Attributes:
        initial: trust before any rating, in [0, 1].
    """

    initial: Share = 0.5
    rates_raters = True
    family = "personal"
    source = "Xiong and Liu (2004)"
    cost = "S^2 P"

    def start(self, like: Array) -> Likened:
        """Initial trust for everyone. See `TrustModel.start`."""
        known = Experience.none(like)
        return Likened(known, known.sums + self.initial, credences(like, self.initial))

    def update(self, state: Likened, ratings: Array, mask: Array) -> Likened:
        """One round of ratings. See `TrustModel.update`."""
        xp = namespace(ratings)
        known = state.known.after(Notes.of(ratings, mask))
        squares, common = disagreement(known)
        similarity = 1 - xp.sqrt(squares + _TINY)
        mean, weight = heeded(xp.where(common > 0, similarity, 0.0), known.sums, known.counts)
        trust = xp.where(weight > 0, mean, state.trust)
        return Likened(known, trust, xp.where(common > 0, similarity, self.initial))

    def rater_trust(self, state: Likened) -> Array:
        """The mean of the other judges' similarity to each rater, shape (S, ...)."""
        return published_raters(state.credence)

    def provider_trust(self, state: Likened) -> Array:
        """The mean of the judges' trust, shape (P, ...)."""
        return published_providers(state.trust)
