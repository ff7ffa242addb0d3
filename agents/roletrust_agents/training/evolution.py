"""Evolution of the network of a coalition: diagonal CMA-ES on whole games, many candidates in one
batch.

All candidates of a generation meet the same random numbers, so their scores compare.
"""

import warnings
from typing import Any

import numpy as np

from roletrust_agents.training.coalition_training import CoalitionTraining, Floats
from roletrust_agents.training.settings import EvolutionSettings

_RACE = 0.4
"""Share of the rounds in which several starts compete."""

_JUDGED, _LEAST = 3, 3  # generations that judge a start, and the fewest between two judgements


class Evolution(CoalitionTraining[EvolutionSettings]):
    """An evolution in progress: separable CMA-ES (Ros and Hansen, 2008) as the package `cma` has
    it.

    What is found depends on the start, and the best start is not the one that is best at first. So
    several evolve side by side, and the worse half of them is dropped again and again until one is
    left (successive halving, Jamieson and Talwalkar, 2016). A step is a generation of each.

    The state follows from the seed and the scores so far, so a run continues from these.

    For the arguments see `CoalitionTraining`.

    Attributes:
        scores: Scores of each step so far, shape (starts that are left, population) each.
    """

    def _begin(self) -> None:
        self.scores: list[Floats] = []
        many, self._judged_at = self._race()
        starts = enumerate(self._starts[:many])
        self._strategies = [_strategy(start, self.settings, (self.seed, k)) for k, start in starts]

    @property
    def weights(self) -> Floats:
        """The mean of the best generation of the last step. See `CoalitionTraining.weights`."""
        last = self.scores[-1].mean(axis=1) if self.scores else [0.0]
        leader = int(np.argmax(last)) if len(last) == len(self._strategies) else 0
        mean: Floats = np.asarray(self._strategies[leader].mean)
        return mean

    @property
    def step_games(self) -> int:
        """See `CoalitionTraining.step_games`."""
        return self.settings.step_games * len(self._strategies)

    def step(self) -> None:
        """Play a generation of each start. See `CoalitionTraining.step`."""
        points = [strategy.ask() for strategy in self._strategies]
        networks, tasks = self.networks(np.concatenate(points)), [self.tasks[k] for k in self.turn]
        played = [self.play(task, networks, self.settings.games, self.steps) for task in tasks]
        self.rounds += self.step_games * len(tasks) * self.length
        self._learn(points, np.mean(played, axis=(0, 2)).reshape(len(points), -1))

    def state(self) -> bytes:
        """Return the scores. See `CoalitionTraining.state`."""
        return np.concatenate(self.scores).tobytes()

    def restore(self, state: bytes) -> None:
        """Repeat all generations by their scores. See `CoalitionTraining.restore`."""
        rows = np.frombuffer(state).reshape(-1, self.settings.population)
        while len(rows):
            many = len(self._strategies)
            self._learn([strategy.ask() for strategy in self._strategies], rows[:many])
            rows = rows[many:]

    def _race(self) -> tuple[int, list[int]]:
        """Return the number of starts, and the steps after which half of them is dropped."""
        starts = 2 ** int(np.log2(min(self.settings.starts, len(self._starts))))
        halvings = starts.bit_length() - 1
        generation = self.settings.step_games * len(self.turn) * self.length
        share = int(
            _RACE * self.budget / generation / max(1, halvings)
        )  # generations for each number of starts
        if share // starts < _LEAST:
            return 1, []
        return starts, np.cumsum([share // (starts >> k) for k in range(halvings)]).tolist()

    def _learn(self, points: list[list[Floats]], scores: Floats) -> None:
        """Give the strategies the scores of their candidates, shape (starts, population)."""
        self.scores.append(scores)
        self.steps += 1
        for k, strategy in enumerate(self._strategies):
            strategy.tell(points[k], (-scores[k]).tolist())
            if strategy.stop():  # it has converged: begin again from there, as wide as at first
                self._strategies[k] = _strategy(
                    np.array(strategy.mean), self.settings, (self.seed, self.steps, k)
                )
        if self.steps in self._judged_at:
            means = np.mean([step.mean(axis=1) for step in self.scores[-_JUDGED:]], axis=0)
            survivors = np.sort(np.argsort(-means, kind="stable")[: len(means) // 2])
            self._strategies = [self._strategies[k] for k in survivors]


def _strategy(start: Floats, settings: EvolutionSettings, seed: tuple[int, ...]) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns about missing plots
        import cma  # type: ignore[import-untyped]
    random = np.random.default_rng(seed)  # not the global one, which others draw from, too
    options = {
        "CMA_diagonal": True,
        "popsize": settings.population,
        "randn": lambda rows, size: random.standard_normal((rows, size)),
        "seed": np.nan,
        "verbose": -9,
    }
    return cma.CMAEvolutionStrategy(start, settings.spread, options)
