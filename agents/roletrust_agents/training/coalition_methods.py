"""Coalitions as search methods with a budget: by evolution, by gradients, and ready ones that are only tried."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeVar

import numpy as np

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.deep_set import DeepSet, DeepSetArchitecture
from roletrust_agents.learned.saved import load_attacker, zoo
from roletrust_agents.training.coalition_training import CoalitionTraining, Floats
from roletrust_agents.training.evolution import Evolution
from roletrust_agents.training.evolution_strategy import EvolutionStrategy
from roletrust_agents.training.gradients import GradientAscent
from roletrust_agents.training.settings import (
    CoalitionSettings,
    EvolutionSettings,
    GradientSettings,
    Start,
    StrategySettings,
    settings_of,
)
from roletrust_env.evaluation.attacked_games import SEARCHED, TaskArguments, is_certain, mean_rewards
from roletrust_env.evaluation.records import read_record
from roletrust_env.evaluation.search import Budget, Progress, SearchResult, UnsuitableError
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.make_task import make_task
from roletrust_env.parameters import refuse_unknown

TrainingT = TypeVar("TrainingT", bound=CoalitionTraining[Any])

_STEPS = 2  # fewer are no training
_LOOK = 2  # games that show whether anything is left to chance

_GAMES = 16
_PLACE = 0  # of the games in which ready coalitions are tried


@cache
def universal_coalitions() -> dict[str, DeepSet]:
    """Return the universal coalitions that come with the project, by name."""
    names = [name for name in zoo() if name.startswith("universal-")]
    networks = {name: load_attacker(name).network for name in names}
    usual = DeepSetArchitecture()
    return {
        name: network
        for name, network in networks.items()
        if isinstance(network, DeepSet) and network.architecture == usual
    }


def known_starts(start: Start, records: Sequence[str] = ()) -> list[Floats]:
    """Return the weights of the known networks from which a training may start, shape (n,) each.

    Args:
        start: `"universal"` allows the universal coalitions and those of records, `"random"` allows none.
        records: Records of attackers, see `read_record`. Those that are no coalitions are left out.

    Raises:
        ValueError: A record is not valid.
    """
    if start == "random":
        return []
    recorded = [attacker.network for attacker in map(read_record, records) if isinstance(attacker, CoalitionAttacker)]
    return [network.flatten().astype(np.float64) for network in (*universal_coalitions().values(), *recorded)]


@refuse_unknown
@dataclass(frozen=True)
class Evolve:
    """Evolution of a coalition for one task, see `Evolution`.

    Attributes:
        start: `"universal"` begins with the best of the universal coalitions, of known ones and of random networks,
            `"random"` with the best of random networks.
        known: Records of attackers that others found in the same condition. A training may start from the coalitions.
        starts: Number of networks that begin, see `Evolution`.
        population: Number of candidates in a generation.
        games: Number of games in which each candidate plays.
        spread: Standard deviation of the first generation.
        name: Name in tables.
    """

    start: Start = "universal"
    known: tuple[str, ...] = ()
    starts: int = 4
    population: int = 32
    games: int = 8
    spread: float = 0.3
    name: str = "evolution"

    def __post_init__(self) -> None:
        """Check the parameters."""
        self._settings()

    def _settings(self) -> EvolutionSettings:
        return settings_of(EvolutionSettings, self)

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `roletrust_env.evaluation.search.SearchMethod`."""
        known = known_starts(self.start, self.known)
        evolution, progress = _trained(Evolution, self._settings(), arguments, budget, seed, known, self.name)
        words = f"coalition, evolution in {evolution.steps} steps of {self.population} candidates"
        return SearchResult(CoalitionAttacker(evolution.network), budget.spent, words, progress=progress)


@refuse_unknown
@dataclass(frozen=True)
class Strategy:
    """Evolution strategy of a coalition for one task, see `EvolutionStrategy`.

    Attributes:
        start: `"universal"` begins with the best of the universal coalitions, of known ones and of random networks,
            `"random"` with the best of random networks.
        known: Records of attackers that others found in the same condition. A training may start from the coalitions.
        pairs: Number of pairs of candidates of a step.
        games: Number of games in which each candidate plays.
        spread: Standard deviation of the candidates in each weight.
        learning_rate: Initial learning rate.
        name: Name in tables.
    """

    start: Start = "universal"
    known: tuple[str, ...] = ()
    pairs: int = 8
    games: int = 4
    spread: float = 0.1
    learning_rate: float = 0.05
    name: str = "evolution strategy"

    def __post_init__(self) -> None:
        """Check the parameters."""
        self._settings()

    def _settings(self) -> StrategySettings:
        return settings_of(StrategySettings, self)

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `roletrust_env.evaluation.search.SearchMethod`."""
        known = known_starts(self.start, self.known)
        strategy, progress = _trained(EvolutionStrategy, self._settings(), arguments, budget, seed, known, self.name)
        words = f"coalition, evolution strategy in {strategy.steps} steps of {2 * self.pairs} candidates"
        return SearchResult(CoalitionAttacker(strategy.network), budget.spent, words, progress=progress)


@refuse_unknown
@dataclass(frozen=True)
class Gradients:
    """Gradients through the game for one task, see `GradientAscent`.

    The search knows the trust model, as that of evolution does. The coalition that it finds observes no more than its
    agents do.

    Attributes:
        start: `"universal"` begins with the best of the universal coalitions and of random networks, `"random"` with
            the best of random networks.
        games: Number of games of a step.
        learning_rate: Initial learning rate.
        temperature: Temperature of the choice of consumers in the games with gradients.
        name: Name in tables.
    """

    start: Start = "universal"
    games: int = 16
    learning_rate: float = 0.01
    temperature: float = 0.1
    name: str = "gradients"

    def __post_init__(self) -> None:
        """Check the parameters."""
        self._settings()

    def _settings(self) -> GradientSettings:
        return settings_of(GradientSettings, self)

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `roletrust_env.evaluation.search.SearchMethod`."""
        known = known_starts(self.start)
        ascent, progress = _trained(GradientAscent, self._settings(), arguments, budget, seed, known, self.name)
        lost = f", {ascent.skipped} without a finite gradient" if ascent.skipped else ""
        words = f"coalition, {ascent.steps} steps along gradients{lost}"
        return SearchResult(CoalitionAttacker(ascent.network), budget.spent, words, progress=progress)


def _trained(
    kind: type[TrainingT],
    settings: CoalitionSettings,
    arguments: TaskArguments,
    budget: Budget,
    seed: int,
    known: Sequence[Floats],
    name: str,
) -> tuple[TrainingT, Progress]:
    """Train until the budget allows no further step, and return the training and its course.

    A step has a single game where all games are alike.

    Args:
        kind: Way to train.
        settings: Settings of the training.
        arguments: Arguments of the task.
        budget: Budget of the training.
        seed: Random seed.
        known: Weights of known networks to start from, shape (n,) each.
        name: Name of the training, for errors.

    Raises:
        UnsuitableError: The budget is too small.
    """
    task = make_task(**arguments)
    if is_certain(arguments):
        settings = settings.model_copy(update={"games": 1, "validation": 1})
    length = task.game.scenario.max_cycles
    needed = (2 * _STEPS * (settings.step_games + settings.validation) + _LOOK) * length
    if budget.left < needed:
        raise UnsuitableError(f"the budget of {budget.rounds} rounds is too small for {name}; give {needed} or more")
    budget.spend(_LOOK * length)
    limit, spent, progress = budget.left, 0, list[tuple[int, float]]()
    training = kind([task], settings, seed, limit, known)
    if training.best is not None:  # a known network
        progress.append((training.rounds, training.best.score))
    while training.rounds + training.most_rounds <= limit:
        training.step()
        if training.due() or training.rounds + training.most_rounds > limit:
            training.validate()
            if training.best is not None:
                progress.append((training.rounds, training.best.score))
        budget.spend(training.rounds - spent)
        spent = training.rounds
    return training, tuple(progress)


@refuse_unknown
@dataclass(frozen=True)
class Universal:
    """The best of the universal coalitions that come with the project, without training on the task.

    Each was trained in turn against several trust models. The few games that choose one of them are counted.

    Attributes:
        name: Name in tables.
    """

    name: str = "universal"

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `roletrust_env.evaluation.search.SearchMethod`."""
        task = make_task(**arguments)
        rounds = choice_rounds(task)
        if budget.left < rounds:
            raise UnsuitableError(f"the budget of {budget.rounds} rounds is too small; give {rounds} or more")
        best = best_universal(task, budget, seed)
        attacker = CoalitionAttacker(universal_coalitions()[best])
        return SearchResult(attacker, budget.spent, f"{best}, not trained further")


def choice_rounds(task: AttackTask) -> int:
    """Return the number of rounds that `best_universal` plays."""
    return len(universal_coalitions()) * _GAMES * task.game.scenario.max_cycles


def best_universal(task: AttackTask, budget: Budget, seed: int) -> str:
    """Return the name of the universal coalition that is the best in a few games.

    Args:
        task: Task that the coalitions play.
        budget: Budget, which pays for the games.
        seed: Random seed.

    Raises:
        UnsuitableError: No universal coalition is installed.
    """
    ready = universal_coalitions()
    if not ready:
        raise UnsuitableError("no universal coalition is installed")
    weights = np.stack([network.flatten() for network in ready.values()])
    attacker = CoalitionAttacker(DeepSet.unflatten(DeepSetArchitecture(), weights))
    scores = mean_rewards(task, attacker, (seed, _PLACE), (len(ready), _GAMES), SEARCHED)[0].mean(axis=1)
    budget.spend(choice_rounds(task))
    return list(ready)[int(np.argmax(scores))]
