"""Models that play the benchmark: they look for the game, for other games, or under a borrowed
name."""

import sys
from typing import Any

import numpy as np

from roletrust_env.trust import Ratings
from roletrust_env.trust.models.central.beta_reputation import Beta
from roletrust_env.trust.models.central.means import Mean


class OffTheStack(Mean):
    """A model that reads the abilities of providers off the state of the game, on the stack of its
    callers."""

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
    """A model that leaves out raters who differ from most rows of games, which have equal noise:
    the attackers."""

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


HONEST: list[Any] = []
"""Ratings of the games in which all are honest, a row of games with the noise of all attacks, by
round."""


class Remembering(Mean):
    """A model that remembers the honest games, and leaves out raters who differ from them in the
    same round."""

    def start(self, like: Any) -> Any:
        """The state and its round."""
        if like.ndim == 4 and like.shape[2] == 1:
            HONEST.clear()
        return super().start(like), 0

    def update(self, state: Any, ratings: Ratings) -> Any:
        """A round of those who do not differ."""
        inner, round = state
        mask = ratings.weights > 0
        if ratings.values.ndim == 4 and ratings.values.shape[2] == 1:
            HONEST[round:] = [ratings.values]
        elif ratings.values.ndim == 4 and round < len(HONEST):
            mask = mask & (abs(ratings.values - HONEST[round]) < 1e-9)
        return super().update(inner, Ratings(ratings.values * mask, mask)), round + 1

    def rater_trust(self, state: Any) -> Any:
        """The trust of the mean."""
        return super().rater_trust(state[0])

    def provider_trust(self, state: Any) -> Any:
        """The trust of the mean."""
        return super().provider_trust(state[0])
