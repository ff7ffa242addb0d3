"""The control for personal models: each judge goes by its own ratings alone, and nobody is asked."""

from typing import NamedTuple

from roletrust_env.arrays import Array, namespace
from roletrust_env.parameters import Share, checked_dataclass
from roletrust_env.trust.judges import Personal, mean
from roletrust_env.trust.ratings import Ratings
from roletrust_env.trust.similarity import Experience


class OwnState(NamedTuple):
    """Memory of the judges.

    Attributes:
        known: All ratings so far.
        trust: Trust of each judge in each provider, shape (S, P, ...).
    """

    known: Experience
    trust: Array


@checked_dataclass
class OwnExperience(Personal):
    """Control without a reputation system: the mean of a judge's own ratings so far, which no liar reaches.

        T[i, j] = sum of the ratings of j by i / number of these ratings

    A personal model that is no better than this one gains nothing by listening to others. Published trust is the mean
    of the judges, liars included. Without a rating of its own, a judge keeps its trust.

    Attributes:
        initial: Trust before any rating, in [0, 1].
    """

    initial: Share = 0.5
    rates_raters = False

    def start(self, like: Array) -> OwnState:
        """Return the initial trust of all judges. See `TrustModel.start`."""
        known = Experience.none(like)
        return OwnState(known, known.sums + self.initial)

    def update(self, state: OwnState, ratings: Ratings) -> OwnState:
        """Return the state after one round of ratings. See `TrustModel.update`."""
        known = state.known.after(ratings)
        xp = namespace(ratings.values)
        own = xp.clip(mean(known.sums, known.counts), 0.0, 1.0)
        return OwnState(known, xp.where(known.counts > 0, own, state.trust))

    def rater_trust(self, state: OwnState) -> Array:
        """Return 1 for each rater, since nobody is asked, shape (S, ...)."""
        return 0 * state.trust[:, 0] + 1
