"""Gradients through the game: Adam on the network of a coalition, by back-propagation through whole
games.

The games of a step are on torch, and consumers choose with a temperature, see `SmoothTask`. The
slope of an observation is left out. A decision changes trust, and this changes the score, but that
later decisions then differ is not followed. With it the gradients of many rounds explode.

What has no slope does not learn: whether an identity is present, and which provider a rater
chooses. Where trust jumps, the slope is right only between the jumps, and evolution may find more.
"""

import math

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.deep_set import DeepSet
from roletrust_agents.smooth import SmoothTask, check_graph, flat_roots, one_thread
from roletrust_agents.training.adam_training import AdamTraining
from roletrust_agents.training.settings import GradientSettings
from roletrust_env.arrays import Array
from roletrust_env.evaluation.measurement import SEARCHED, mean_rewards
from roletrust_env.evaluation.search import UnsuitableError
from roletrust_env.metrics.confidence import GameMean

_LOST = 0.02
"""Distance to the best score below which weights are given up."""


class GradientAscent(AdamTraining[GradientSettings]):
    """Gradient ascent in progress.

    A network that is far below the best one in a validation is given up: the next step goes on from
    the best one at half the learning rate. Otherwise a network that has lost its slopes, as its
    units saturate, would stay so. A backward pass counts no rounds.

    For the arguments see `CoalitionTraining`. The learning rate is 0 when the budget is played.

    Attributes:
        skipped: Number of steps without an effect, because their gradient was not finite.
        given_up: Number of networks that were given up.

    Raises:
        UnsuitableError: No slope leads from the objective to the network.
        ValueError: The games of a step do not fit into the memory.
    """

    _counts = ("steps", "skipped", "given_up")

    def _begin(self) -> None:
        self.skipped = self.given_up = 0
        self._smooth = [SmoothTask(task, self.settings.temperature) for task in self.tasks]
        super()._begin()
        with flat_roots():
            for task in self._smooth:
                check_graph(task, self._attacker(self._adam.vector), self.settings.games)

    def step(self) -> None:
        """Play games forward and backward, and take a step of Adam. See
        `CoalitionTraining.step`.
        """
        import torch

        settings = self.settings
        rate = (
            settings.learning_rate * 0.5**self.given_up * 0.5 * (1 + math.cos(math.pi * self.done))
        )
        self._adam.optimiser.zero_grad()
        with one_thread():
            with flat_roots():
                score = self.smooth_score(self._adam.vector)
            if not score.requires_grad:
                model = type(self.tasks[0].game.model).__name__
                raise UnsuitableError(
                    f"nothing that the coalition decides has a slope under {model}, so gradients "
                    "cannot train it"
                )
            (-score).backward()
            norm = torch.nn.utils.clip_grad_norm_([self._adam.vector], settings.clip)
            if bool(norm.isfinite()):
                self._adam.descend(rate)
            else:
                self.skipped += 1
        self.rounds += self.step_games * len(self.turn) * self.length
        self.steps += 1

    def smooth_score(self, vector: Array) -> Array:
        """Return the mean score in the games of the next step as a function of the weights, with
        its slope.

        Args:
            vector: Weights on torch, shape (n,).
        """
        attacker = self._attacker(vector)
        place, batch = (self.seed, self.steps), (1, self.settings.games)
        scores = [
            mean_rewards(self._smooth[k], attacker, place, batch, SEARCHED)[0].mean()
            for k in self.turn
        ]
        return sum(scores) / len(scores)

    def _attacker(self, vector: Array) -> CoalitionAttacker:
        """Return the coalition of weights on torch."""
        return CoalitionAttacker(_Unswayed.unflatten(self.architecture, vector))

    def validate(self) -> GameMean:
        """See `CoalitionTraining.validate`. Go back to the best weights from much worse ones."""
        import torch

        score = super().validate()
        assert self.best is not None  # it has just been validated
        if score.mean < self.best.score - _LOST:
            with torch.no_grad():
                self._adam.vector.copy_(torch.tensor(self.best.weights))
            self._adam.optimiser.state.clear()
            self.given_up += 1
        return score


class _Unswayed(DeepSet):
    """A network with a slope in its weights, and none in what it observes."""

    def decide(self, features: Array) -> Array:
        """See `DeepSet.decide`."""
        return super().decide(features.detach())

    def treatment(self, accounts: Array, features: Array) -> Array:
        """See `DeepSet.treatment`."""
        return super().treatment(accounts.detach(), features.detach())
