"""Models that play the benchmark: they look for the game, for other games, or under a borrowed name."""

import sys
from typing import Any

import numpy as np

from roletrust_env.trust import Ratings
from roletrust_env.trust.models.central.beta_reputation import Beta
from roletrust_env.trust.models.central.means import Mean


class OffTheStack(Mean):
    """A model that reads the abilities of providers off the state of the game, on the stack of its callers."""

    def provider_trust(self, state: Any) -> Any:
        """The abilities, if they can be found."""
        frame = sys._getframe()
        while frame := frame.f_back:  # type: ignore[assignment]
            for value in list(frame.f_locals.values()):
                ability = getattr(getattr(value, "properties", None), "ability", None)
                if ability is not None:
                    batch = [1] * (state.top.ndim - ability.ndim)
                    return ability.reshape(len(ability), *batch, *ability.shape[1:]) + 0 * state.top
        return super().provider_trust(state)


class FirstHand(OffTheStack):
    """The same under the name of a model of the package."""


FirstHand.__module__ = "roletrust_env.trust.models.personal.first_hand"


class RowPeek(Beta):
    """A model that leaves out raters who differ from most rows of games, which have equal noise: the attackers."""

    def start(self, like: Any) -> Any:
        """The state, and how often each rater differed."""
        return super().start(like), np.zeros((len(like), *like.shape[2:]))

    def update(self, state: Any, ratings: Ratings) -> Any:
        """A round of those who did not differ."""
        inner, seen = state
        if ratings.values.ndim == 4 and seen.shape[1] > 2:  # a small trial gives nothing away
            usual = np.median(ratings.values, axis=2, keepdims=True)
            seen = seen + (abs(ratings.values - usual) > 1e-9).any(axis=1)
        mask = (ratings.weights > 0) & (seen < 2)[:, None]
        return super().update(inner, Ratings(ratings.values * mask, mask)), seen

    def rater_trust(self, state: Any) -> Any:
        """The trust of beta."""
        return super().rater_trust(state[0])

    def provider_trust(self, state: Any) -> Any:
        """The trust of beta."""
        return super().provider_trust(state[0])
