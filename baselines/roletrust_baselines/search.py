"""Search methods over the parameters of attacks: default parameters, random search, and CMA-ES."""

import warnings
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from roletrust_env.evaluation.attackers import Scripted, side_by_side
from roletrust_env.evaluation.measurement import SEARCHED, TaskArguments, is_certain, mean_rewards
from roletrust_env.evaluation.scripts import (
    AttackKind,
    Scripts,
    describe_attack,
)
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError
from roletrust_env.game.make_task import make_task
from roletrust_env.game.policy import Policy
from roletrust_env.parameters import refuse_unknown_parameters
from roletrust_env.randomness import generator

Scores = npt.NDArray[np.float64]
Attack = Mapping[str, Policy]

GAMES = 8
"""Number of games in which an attack is tried if the task is random."""

GENERATION = 16
"""Smallest number of attacks that a budget must allow."""

_FINALISTS = 8  # number of the best attacks that are tried again if the task is random
_CELLS, _ROWS = 400_000, 256  # limits on the ratings of a round and on the attacks in one batch


class ScriptTrial:
    """Trial of scripted attacks within a budget.

    If the task is random, an attack is tried in `GAMES` games, and the best attacks are tried again
    with a part of the budget, because the best of many noisy scores is biased upwards.

    Args:
        arguments: Arguments of the task.
        budget: Budget, which the trial spends.
        seed: Random seed.

    Raises:
        UnsuitableError: The budget is too small.
    """

    def __init__(self, arguments: TaskArguments, budget: Budget, seed: int) -> None:
        self.task = make_task(**arguments)
        self._seed, self._budget, self._batches = seed, budget, 0
        self._rounds = self.task.game.scenario.max_cycles
        certain = is_certain(arguments)
        self._budget.spend(2 * self._rounds)
        self._games = 1 if certain else GAMES
        reserve = 0 if certain else min(budget.rounds // 5, _FINALISTS * 8 * GAMES * self._rounds)
        self._again = reserve // (_FINALISTS * self._rounds)
        if self.left < GENERATION:
            needed = 2 * GENERATION * self._games * self._rounds
            raise UnsuitableError(
                f"the budget of {budget.rounds} rounds is too small for a search; give {needed} or "
                "more"
            )

    @property
    def left(self) -> int:
        """Number of attacks that can still be tried."""
        spare = self._budget.left - self._again * _FINALISTS * self._rounds
        return max(0, spare // (self._rounds * self._games))

    def scores(self, attacks: Sequence[Attack], games: int | None = None) -> Scores:
        """Return the mean score of each attack. All attacks of a batch meet the same random
        numbers.
        """
        games = games or self._games
        cells = self.task.game.roster.n_raters * self.task.game.roster.n_providers * games
        rows = max(1, min(_ROWS, _CELLS // cells))
        means = []
        for at in range(0, len(attacks), rows):
            chunk = attacks[at : at + rows]
            self._batches += 1
            attacker, batch, seed = (
                Scripted(side_by_side(chunk)),
                (len(chunk), games),
                (self._seed, self._batches),
            )
            means.append(mean_rewards(self.task, attacker, seed, batch, SEARCHED)[0].mean(axis=1))
            self._budget.spend(len(chunk) * games * self._rounds)
        scores: Scores = np.concatenate(means).astype(np.float64)
        return scores

    def best(self, attacks: Sequence[Attack], scores: Scores) -> SearchResult:
        """Return the best of the attacks that were tried. The leading ones are tried again if the
        task is random.
        """
        leading = np.argsort(-scores)[:_FINALISTS]
        if self._again:
            leading = leading[np.argsort(-self.scores([attacks[k] for k in leading], self._again))]
        attack = attacks[leading[0]]
        return SearchResult(Scripted(attack), self._budget.spent, describe_attack(attack))


Attacks = tuple[AttackKind, ...] | None
"""Kinds of attack to search, see `Scripts.of`."""


@refuse_unknown_parameters
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
        return SearchResult(Scripted(attack), 0, describe_attack(attack))


@dataclass(frozen=True)
class ScriptSearch(ABC):
    """Search for the best scripted attack within a budget.

    Attributes:
        name: Name in tables.
        attacks: Kinds of attack, see `Scripts.of`.
    """

    name: str
    attacks: Attacks = None

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        trial = ScriptTrial(arguments, budget, seed)
        return trial.best(*self._tried(trial, generator(seed)))

    @abstractmethod
    def _tried(
        self, trial: ScriptTrial, random: np.random.Generator
    ) -> tuple[list[Attack], Scores]:
        """Return the attacks that are tried, and their scores."""

    def _scripts(self, trial: ScriptTrial) -> Scripts:
        """Return the attacks, which must have parameters."""
        scripts = Scripts.of(trial.task, self.attacks)
        if not scripts.size:
            raise UnsuitableError(f"{describe_attack(scripts.default)} has no parameters to search")
        return scripts


@refuse_unknown_parameters
@dataclass(frozen=True)
class RandomSearch(ScriptSearch):
    """Random search: the best of points drawn uniformly from the unit cube of the parameters of
    scripted attackers.
    """

    name: str = "random search"

    def _tried(
        self, trial: ScriptTrial, random: np.random.Generator
    ) -> tuple[list[Attack], Scores]:
        scripts = self._scripts(trial)
        attacks: list[Attack] = [
            scripts.decode(point) for point in random.random((trial.left, scripts.size))
        ]
        return attacks, trial.scores(attacks)


@refuse_unknown_parameters
@dataclass(frozen=True)
class CmaEs(ScriptSearch):
    """CMA-ES (Hansen and Ostermeier, 2001) in the same cube as the random search, restarted at
    random on convergence.

    The implementation is the package `cma` (Hansen, Akimoto and Baudis).

    Attributes:
        spread: Standard deviation of the first generation.
    """

    name: str = "CMA-ES"
    spread: float = 0.3

    def _tried(
        self, trial: ScriptTrial, random: np.random.Generator
    ) -> tuple[list[Attack], Scores]:
        return cma_es(trial, self._scripts(trial), trial.left, self.spread, random)


def cma_es(
    trial: ScriptTrial, scripts: Scripts, tries: int, spread: float, random: np.random.Generator
) -> tuple[list[Attack], Scores]:
    """Return the attacks that CMA-ES has tried, and their scores. It begins again at random on
    convergence.

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


def _begin(size: int, spread: float, random: np.random.Generator) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns about missing plots
        import cma  # type: ignore[import-untyped]
    options = {
        "bounds": [0, 1],
        "popsize": GENERATION,
        "seed": int(random.integers(1, 2**31)),
        "verbose": -9,
    }
    return cma.CMAEvolutionStrategy(random.uniform(0.2, 0.8, size), spread, options)
