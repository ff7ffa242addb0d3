"""Judges that trust the mean of two models."""

from typing import NamedTuple

from roletrust_env.parameters import checked_dataclass
from roletrust_env.shapes import PerAdviser, PerPair
from roletrust_env.trust.models.personal.first_hand import FirstHand, FirstHandState
from roletrust_env.trust.models.personal.habit import Habit, HabitState
from roletrust_env.trust.personal import Personal
from roletrust_env.trust.ratings import Ratings

_FIRST_HAND, _HABIT = FirstHand(), Habit()


class EnsembleState(NamedTuple):
    """Memory of both models."""

    first_hand: FirstHandState
    habit: HabitState

    @property
    def trust(self) -> PerPair:
        """Trust of each judge in each provider, shape (S, P, ...)."""
        return (self.first_hand.trust + self.habit.trust) / 2

    @property
    def credence(self) -> PerAdviser:
        """Credence of each judge in each rater, shape (S, S, ...)."""
        return self.first_hand.credence


@checked_dataclass
class Ensemble(Personal):
    """Ensemble: the mean of the trust of `first-hand` and of `habit`.

        T[i, j] = (first-hand T[i, j] + habit T[i, j]) / 2

    The two models use reports in different ways: `first-hand` discounts raters that disagree with
    the judge, and `habit` (Teacy et al. 2012) learns which providers behave alike. An attack has to
    mislead both. Both have their default parameters. The credence in raters is that of
    `first-hand`.
    """

    rates_raters = True
    cost = "S^2 P + S P^2"

    def start(self, like: PerPair) -> EnsembleState:
        """Return the states of both models. See `TrustModel.start`."""
        return EnsembleState(_FIRST_HAND.start(like), _HABIT.start(like))

    def update(self, state: EnsembleState, ratings: Ratings) -> EnsembleState:
        """Return the states after one round of ratings. See `TrustModel.update`."""
        return EnsembleState(
            _FIRST_HAND.update(state.first_hand, ratings), _HABIT.update(state.habit, ratings)
        )
