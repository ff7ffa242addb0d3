"""Gradients through the game: Adam on the network of a coalition, by back-propagation through whole games.

The games of a step are on torch, and consumers choose with a temperature, see `SmoothTask`. The slope of an observation
is left out. A decision changes trust, and this changes the score, but that later decisions then differ is not followed.
With it the gradients of many rounds explode.

What has no slope does not learn: whether an identity is present, and which provider a rater chooses. Where trust jumps,
the slope is right only between the jumps, and evolution may find more.
"""

import io
import math
from typing import Any

import numpy as np

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.deep_set import DeepSet
from roletrust_agents.training.coalition_training import CoalitionTraining, Floats
from roletrust_agents.training.settings import GradientSettings
from roletrust_env.arrays import Array
from roletrust_env.evaluation.attacked_games import SEARCHED, mean_rewards
from roletrust_env.evaluation.search import UnsuitableError
from roletrust_env.evaluation.smooth import SmoothTask, flat_roots, one_thread
from roletrust_env.metrics.confidence import Mean

_LOST = 0.02
"""Distance to the best score below which weights are given up."""

_COUNTS = ("steps", "skipped", "given_up")
"""Attributes that a checkpoint holds."""


class GradientAscent(CoalitionTraining[GradientSettings]):
    """Gradient ascent in progress: Adam (Kingma and Ba, 2015) on all weights.

    It validates its start, too. A network that is far below the best one in a validation is given up: the next step
    goes on from the best one at half the learning rate. Otherwise a network that has lost its slopes, as its units
    saturate, would stay so. A backward pass counts no rounds.

    For the arguments see `CoalitionTraining`. The learning rate is 0 when the budget is played.

    Attributes:
        skipped: Number of steps without an effect, because their gradient was not finite.
        given_up: Number of networks that were given up.

    Raises:
        UnsuitableError: No slope leads from the objective to the network.
    """

    def _begin(self) -> None:
        import torch

        self.skipped = self.given_up = 0
        self._smooth = [SmoothTask(task, self.settings.temperature) for task in self.tasks]
        self._vector: Any = torch.tensor(self._starts[0], dtype=torch.float32, requires_grad=True)
        self._adam: Any = torch.optim.Adam([self._vector], lr=self.settings.learning_rate)
        if self.best is None:
            self.validate()

    @property
    def weights(self) -> Floats:
        """See `CoalitionTraining.weights`."""
        weights: Floats = self._vector.detach().numpy().astype(np.float64)
        return weights

    def step(self) -> None:
        """Play games forward and backward, and take a step of Adam. See `CoalitionTraining.step`."""
        import torch

        settings, done = self.settings, min(1.0, self.rounds / self.budget)
        rate = settings.learning_rate * 0.5**self.given_up
        self._adam.param_groups[0]["lr"] = rate * 0.5 * (1 + math.cos(math.pi * done))
        self._adam.zero_grad()
        with one_thread():
            with flat_roots():
                score = self.smooth_score(self._vector)
            if not score.requires_grad:
                model = type(self.tasks[0].game.model).__name__
                raise UnsuitableError(
                    f"nothing that the coalition decides has a slope under {model}, so gradients cannot train it"
                )
            (-score).backward()
            norm = torch.nn.utils.clip_grad_norm_([self._vector], settings.clip)
            if bool(norm.isfinite()):
                self._adam.step()
            else:
                self.skipped += 1
        self.rounds += self.step_games * len(self.turn) * self.length
        self.steps += 1

    def smooth_score(self, vector: Array) -> Array:
        """Return the mean score in the games of the next step as a function of the weights, with its slope.

        Args:
            vector: Weights on torch, shape (n,).
        """
        attacker = CoalitionAttacker(_Unswayed.unflatten(self.architecture, vector))
        place, batch = (self.seed, self.steps), (1, self.settings.games)
        scores = [mean_rewards(self._smooth[k], attacker, place, batch, SEARCHED)[0].mean() for k in self.turn]
        return sum(scores) / len(scores)

    def validate(self) -> Mean:
        """See `CoalitionTraining.validate`. Go back to the best weights from much worse ones."""
        import torch

        score = super().validate()
        assert self.best is not None  # it has just been validated
        if score.mean < self.best.score - _LOST:
            with torch.no_grad():
                self._vector.copy_(torch.tensor(self.best.weights))
            self._adam.state.clear()
            self.given_up += 1
        return score

    def state(self) -> bytes:
        """Return the weights and the state of Adam. See `CoalitionTraining.state`."""
        import torch

        file = io.BytesIO()
        counts = {name: getattr(self, name) for name in _COUNTS}
        torch.save({**counts, "weights": self._vector.detach(), "adam": self._adam.state_dict()}, file)
        return file.getvalue()

    def restore(self, state: bytes) -> None:
        """See `CoalitionTraining.restore`. Only tensors and numbers are read, and no code runs."""
        import torch

        saved = torch.load(io.BytesIO(state), weights_only=True)
        for name in _COUNTS:
            setattr(self, name, saved[name])
        with torch.no_grad():
            self._vector.copy_(saved["weights"])
        self._adam.load_state_dict(saved["adam"])


class _Unswayed(DeepSet):
    """A network with a slope in its weights, and none in what it observes."""

    def decide(self, features: Array) -> Array:
        """See `DeepSet.decide`."""
        return super().decide(features.detach())
