"""Search methods over scripted attackers: default parameters, grid search, random search, and CMA-ES."""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from roletrust_baselines.search.trial import GENERATION, Attack, Scores, Trial
from roletrust_env.evaluation.attack_space import AttackKind
from roletrust_env.evaluation.attacked_games import TaskArguments
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.scripts import Scripts, describe
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError
from roletrust_env.game.make_task import make_task
from roletrust_env.parameters import refuse_unknown

Attacks = tuple[AttackKind, ...] | None
"""Kinds of attack to search, see `Scripts.of`."""


@refuse_unknown
@dataclass(frozen=True)
class PaperAttacks:
    """Scripted attackers with their default parameters, those of the paper.

    Attributes:
        name: Name in tables.
        attacks: Kinds of attack, see `Scripts.of`.
    """

    name: str = "scripted, default"
    attacks: Attacks = None

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        attack = Scripts.of(make_task(**arguments), self.attacks).default
        return SearchResult(Scripted(attack), 0, describe(attack))


@refuse_unknown
@dataclass(frozen=True)
class Grid:
    """Grid search over a small grid of the parameters of scripted attackers, see `Scripts.grid`.

    Attributes:
        name: Name in tables.
        attacks: Kinds of attack, see `Scripts.of`.
    """

    name: str = "scripted, best of grid"
    attacks: Attacks = None

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        trial = Trial(arguments, budget, seed)
        attacks = Scripts.of(trial.task, self.attacks).grid
        if len(attacks) > trial.left:
            attacks = [attacks[k] for k in np.random.default_rng(seed).permutation(len(attacks))[: trial.left]]
        return trial.best(attacks, trial.scores(attacks))


@refuse_unknown
@dataclass(frozen=True)
class RandomSearch:
    """Random search: the best of points drawn uniformly from the unit cube of the parameters of scripted attackers.

    Attributes:
        name: Name in tables.
        attacks: Kinds of attack, see `Scripts.of`.
    """

    name: str = "random search"
    attacks: Attacks = None

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        trial = Trial(arguments, budget, seed)
        scripts = Scripts.of(trial.task, self.attacks)
        check_parameters(scripts)
        points = np.random.default_rng(seed).random((trial.left, scripts.size))
        attacks = [scripts.decode(point) for point in points]
        return trial.best(attacks, trial.scores(attacks))


@refuse_unknown
@dataclass(frozen=True)
class CmaEs:
    """CMA-ES (Hansen and Ostermeier, 2001) in the same cube as the random search, restarted at random on convergence.

    The implementation is the package `cma` (Hansen, Akimoto and Baudis).

    Attributes:
        spread: Standard deviation of the first generation.
        name: Name in tables.
        attacks: Kinds of attack, see `Scripts.of`.
    """

    spread: float = 0.3
    name: str = "CMA-ES"
    attacks: Attacks = None

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        trial = Trial(arguments, budget, seed)
        scripts = Scripts.of(trial.task, self.attacks)
        check_parameters(scripts)
        attacks, scores = cma_es(trial, scripts, trial.left, self.spread, np.random.default_rng(seed))
        return trial.best(attacks, scores)


def cma_es(
    trial: Trial, scripts: Scripts, tries: int, spread: float, random: np.random.Generator
) -> tuple[list[Attack], Scores]:
    """Return the attacks that CMA-ES has tried, and their scores. It begins again at random on convergence.

    Args:
        trial: Trial of attacks.
        scripts: Attacks to search.
        tries: Number of attacks to try.
        spread: Standard deviation of the first generation.
        random: Random numbers.
    """
    size = max(2, scripts.size)  # CMA-ES needs two coordinates; a surplus one has no effect
    attacks: list[Attack] = []
    scores: list[Scores] = [np.empty(0)]
    while tries - len(attacks) >= GENERATION:
        search = _begin(size, spread, random)
        while tries - len(attacks) >= GENERATION and not search.stop():
            generation = search.ask()
            attacks += [scripts.decode(point) for point in generation]
            scores.append(trial.scores(attacks[-GENERATION:]))
            search.tell(generation, (-scores[-1]).tolist())
    return attacks, np.concatenate(scores)


def check_parameters(scripts: Scripts) -> None:
    """Check that there is something to search.

    Raises:
        UnsuitableError: The attacks have no parameters.
    """
    if not scripts.size:
        raise UnsuitableError(f"{describe(scripts.default)} has no parameters to search")


def _begin(size: int, spread: float, random: np.random.Generator) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns about missing plots
        import cma  # type: ignore[import-untyped]
    options = {"bounds": [0, 1], "popsize": GENERATION, "seed": int(random.integers(1, 2**31)), "verbose": -9}
    return cma.CMAEvolutionStrategy(random.uniform(0.2, 0.8, size), spread, options)
