"""Evolution of the network of a coalition: diagonal CMA-ES on whole games, many candidates in one batch.

All candidates of a generation meet the same random numbers, so their scores compare. With several tasks a generation
plays two of them in turn; the result is an attacker for all.
"""

import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.deep_set import DeepSet, DeepSetArchitecture, random_weights
from roletrust_agents.training.settings import EvolutionSettings
from roletrust_env.evaluation.attacked_games import SEARCHED, mean_rewards
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.metrics.confidence import Mean, over_games

Floats = npt.NDArray[np.float64]

_VALIDATION, _START = 1_000_000_000, 1_000_000_001
"""Places of the games for validation and of those that choose the start, beside the numbers of the generations."""

_START_GAMES = 4  # but no more than a validation has
_TASKS_AT_ONCE = 2
_CELLS = 400_000  # limit on the ratings of a round in one batch


class Validated(NamedTuple):
    """A network and its score in the games for validation."""

    weights: Floats
    score: float


class Evolution:
    """An evolution in progress: separable CMA-ES (Ros and Hansen, 2008) as the package `cma` has it.

    Its state follows from the seed and the scores so far, so a run continues from these.

    Args:
        tasks: Tasks with the same reward, one or more.
        settings: Settings.
        seed: Random seed.
        budget: Number of rounds that the whole evolution may play.
        known: Weights of known networks to start from, shape (n,) each, besides the random ones.

    Attributes:
        architecture: Architecture of the network.
        scores: Scores of each generation so far, shape (population,) each.
        rounds: Number of rounds that were played.
        best: Best validated network; None before the first validation.
    """

    def __init__(
        self,
        tasks: Sequence[AttackTask],
        settings: EvolutionSettings,
        seed: int,
        budget: int,
        known: Sequence[Floats] = (),
    ) -> None:
        self.tasks, self.settings, self._seed = tuple(tasks), settings, seed
        self.architecture = DeepSetArchitecture(units=settings.units)
        self.scores: list[Floats] = []
        self.rounds = 0
        self.best: Validated | None = None
        start = self._start(budget, [weights for weights in known if len(weights) == self.architecture.size])
        self._strategy = _strategy(start, settings, (seed, 0))

    @property
    def most_rounds(self) -> int:
        """Largest number of rounds of a generation, with a validation after it."""
        settings, many = self.settings, len(self.tasks)
        played = settings.population * settings.games * min(_TASKS_AT_ONCE, many)
        return (played + settings.validation * many) * self._length

    @property
    def network(self) -> DeepSet:
        """The best validated network, on NumPy in single precision."""
        weights = self._strategy.mean if self.best is None else self.best.weights
        return self._networks(np.asarray(weights))

    def generation(self, scores: Floats | None = None) -> None:
        """Play a generation, or repeat one by its scores.

        Args:
            scores: Scores of the generation from an earlier run; None plays it.
        """
        number, settings = len(self.scores), self.settings
        points = self._strategy.ask()
        if scores is None:
            networks = self._networks(np.asarray(points))
            first, many = _TASKS_AT_ONCE * number, min(_TASKS_AT_ONCE, len(self.tasks))
            tasks = [self.tasks[(first + k) % len(self.tasks)] for k in range(many)]
            played = [self._play(task, networks, settings.games, number) for task in tasks]
            scores = np.mean(played, axis=(0, 2))
            self.rounds += settings.population * settings.games * many * self._length
        assert scores is not None
        self.scores.append(scores)
        self._strategy.tell(points, (-scores).tolist())
        if self._strategy.stop():  # it has converged: begin again from there, as wide as at first
            self._strategy = _strategy(np.array(self._strategy.mean), settings, (self._seed, number + 1))

    def due(self) -> bool:
        """Return whether a validation is due."""
        return len(self.scores) % self.settings.validate_every == 0

    def validate(self) -> Mean:
        """Return the score of the mean of the generation in the games for validation, and keep it if it is the best."""
        mean = np.array(self._strategy.mean)
        games, network = self.settings.validation, self._networks(mean[None, :])
        score = over_games(np.mean([self._play(task, network, games, _VALIDATION)[0] for task in self.tasks], axis=0))
        self.rounds += games * len(self.tasks) * self._length
        if self.best is None or score.mean > self.best.score:
            self.best = Validated(mean, float(score.mean))
        return score

    @property
    def _length(self) -> int:
        return self.tasks[0].game.scenario.max_cycles

    def _start(self, budget: int, known: list[Floats]) -> Floats:
        """Return the best of the known networks and of random ones."""
        games = min(_START_GAMES, self.settings.validation)
        each = games * self._length * len(self.tasks)
        many = max(0, min(self.settings.candidates, budget // 10 // each - len(known)))
        random = np.random.default_rng(self._seed)
        candidates: list[Floats] = [
            *known,
            *(random_weights(self.architecture, random) for _ in range(max(many, not known))),
        ]
        if len(candidates) == 1:
            return candidates[0]
        networks, k = self._networks(np.stack(candidates)), len(candidates)
        scores = np.mean([self._play(task, networks, games, _START) for task in self.tasks], axis=(0, 2))
        self.rounds += k * each
        return candidates[int(np.argmax(scores))]

    def _networks(self, weights: Floats) -> DeepSet:
        return DeepSet.unflatten(self.architecture, weights.astype(np.float32))

    def _play(self, task: AttackTask, networks: DeepSet, games: int, place: int) -> Floats:
        """Return the scores of K networks in G games, shape (K, G). As many play at once as fit."""
        step = max(1, _CELLS // (task.game.roster.n_raters * task.game.roster.n_providers * games))
        rows, parts = len(networks.weights["layer2.bias"]), []
        for at in range(0, rows, step):
            part = DeepSet(networks.architecture, {name: w[at : at + step] for name, w in networks.weights.items()})
            batch, seed = (min(step, rows - at), games), (self._seed, place)
            parts.append(mean_rewards(task, CoalitionAttacker(part), seed, batch, SEARCHED)[0])
        scores: Floats = np.concatenate(parts).astype(np.float64)
        return scores


def _strategy(start: Floats, settings: EvolutionSettings, seed: tuple[int, int]) -> Any:
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
