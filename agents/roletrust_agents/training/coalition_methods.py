"""Trainings of a coalition as search methods with a budget: CMA-ES and an evolution strategy."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, ClassVar

import numpy as np

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.deep_set import DeepSetArchitecture
from roletrust_agents.training.coalition_training import CoalitionTraining, Floats, start_games
from roletrust_agents.training.evolution import Evolution
from roletrust_agents.training.evolution_strategy import EvolutionStrategy
from roletrust_agents.training.settings import (
    CoalitionSettings,
    EvolutionSettings,
    Start,
    StrategySettings,
    settings_of,
)
from roletrust_agents.training.universal import known_starts, mean_scores
from roletrust_env.evaluation.measurement import TaskArguments, is_certain
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.make_task import make_task
from roletrust_env.parameters import refuse_unknown_parameters

_STEPS = 2  # fewer are no training
_LOOK = 2  # games that show whether anything is left to chance
_CHOICE, _KEPT = (
    4,
    4,
)  # a quarter of the rounds chooses among known networks, and a quarter of these plays again
_PLACE = 1_000_000_010  # of the games of this choice, beside those of a training


@dataclass(frozen=True)
class CoalitionSearch(ABC):
    """Training of a coalition for one task, until the budget allows no further step.

    Attributes:
        start: `"universal"` begins with the best of the universal coalitions, of known ones and of
            random networks, `"random"` with the best of random networks.
        known: Records of attackers that others found in the same condition. With records a quarter
            of the rounds chooses the start among their coalitions and the universal ones.
        wide: Whether the network also decides on silence, and on the treatment of each rater.
        name: Name in tables.
    """

    start: Start = "universal"
    known: tuple[str, ...] = ()
    wide: bool = True
    name: str = "coalition"
    known_start: ClassVar = True

    _training: ClassVar[type[CoalitionTraining[Any]]]
    _settings: ClassVar[type[CoalitionSettings]]

    def __post_init__(self) -> None:
        """Check the parameters."""
        settings_of(self._settings, self)

    @abstractmethod
    def _words(self, training: Any) -> str:
        """Return what a training was, in words."""

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """Train. A step has a single game where all games are alike. See `SearchMethod.search`."""
        task, settings = make_task(**arguments), settings_of(self._settings, self)
        if is_certain(arguments):
            settings = settings.model_copy(update={"games": 1, "validation": 1})
        length = task.game.scenario.max_cycles
        known = known_starts(self.start, self.known, wide=self.wide)
        first = start_games(settings, len(known)) if self.wide else 0
        needed = (first + 2 * _STEPS * (settings.step_games + settings.validation) + _LOOK) * length
        if budget.left < needed:
            raise UnsuitableError(
                f"the budget of {budget.rounds} rounds is too small for {self.name}; give {needed} "
                "or more"
            )
        budget.spend(_LOOK * length)
        if self.known and (best := self._best(task, known, settings, budget, seed)):
            known, settings = best, settings.model_copy(update={"candidates": 1})
        limit, spent, progress = budget.left, 0, list[tuple[int, float]]()
        training = self._training([task], settings, seed, limit, known)
        for judged in chain(
            [True], training.within(limit)
        ):  # a known network is judged before the first step
            if judged and training.best is not None:
                progress.append((training.rounds, training.best.score))
            budget.spend(training.rounds - spent)
            spent = training.rounds
        attacker, words = CoalitionAttacker(training.network), f"coalition, {self._words(training)}"
        return SearchResult(attacker, budget.spent, words, progress=tuple(progress))

    def _best(
        self,
        task: AttackTask,
        known: Sequence[Floats],
        settings: CoalitionSettings,
        budget: Budget,
        seed: int,
    ) -> list[Floats]:
        """Return the best of the known networks that fit: all play a few games, and the best of
        them further ones.
        """
        architecture, length = (
            DeepSetArchitecture.of(settings.units, wide=settings.wide),
            task.game.scenario.max_cycles,
        )
        left, rounds = (
            [vector for vector in known if len(vector) == architecture.size],
            budget.left // _CHOICE // 2,
        )
        for look, n_kept in enumerate((-(-len(left) // _KEPT), 1)):
            if left[1:]:
                games = max(1, rounds // (len(left) * length))
                scores = mean_scores(task, architecture, left, games, (seed, _PLACE + look))
                budget.spend(len(left) * games * length)
                left = [left[k] for k in np.argsort(-scores, kind="stable")[:n_kept]]
        return left


@refuse_unknown_parameters
@dataclass(frozen=True)
class EvolutionSearch(CoalitionSearch):
    """Evolution of a coalition for one task, see `Evolution`.

    For the other attributes see `CoalitionSearch`.

    Attributes:
        starts: Number of networks that begin, see `Evolution`.
        population: Number of candidates in a generation.
        games: Number of games in which each candidate plays.
        spread: Standard deviation of the first generation.
    """

    name: str = "evolution"
    starts: int = 4
    population: int = 32
    games: int = 8
    spread: float = 0.3

    _training = Evolution
    _settings = EvolutionSettings

    def _words(self, training: Evolution) -> str:
        return f"evolution in {training.steps} steps of {self.population} candidates"


@refuse_unknown_parameters
@dataclass(frozen=True)
class EvolutionStrategySearch(CoalitionSearch):
    """Evolution strategy of a coalition for one task, see `EvolutionStrategy`.

    For the other attributes see `CoalitionSearch`.

    Attributes:
        pairs: Number of pairs of candidates of a step.
        games: Number of games in which each candidate plays.
        spread: Standard deviation of the candidates in each weight.
        learning_rate: Initial learning rate.
    """

    name: str = "evolution strategy"
    pairs: int = 8
    games: int = 4
    spread: float = 0.1
    learning_rate: float = 0.05

    _training = EvolutionStrategy
    _settings = StrategySettings

    def _words(self, training: EvolutionStrategy) -> str:
        return f"evolution strategy in {training.steps} steps of {2 * self.pairs} candidates"
