"""Rungs that try scripted attackers: as they are, on a grid, at random, and by CMA-ES."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from roletrust_env.evaluation.attack_space import AttackKind
from roletrust_env.evaluation.attacked_games import SEARCHED, TaskArguments, is_certain, mean_rewards
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.composite import side_by_side
from roletrust_env.evaluation.scripts import Scripts, describe
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError
from roletrust_env.game.attack_task import make_task
from roletrust_env.game.policy import Policy

Points = npt.NDArray[np.float64]
Attack = Mapping[str, Policy]
Attacks = tuple[AttackKind, ...] | None
"""The kinds of attack that are searched, see `Scripts.of`."""

GAMES = 8
"""Games in which an attack is tried where luck has a part."""

_FINALISTS = 8  # how many of the best are tried again where luck has a part
_GENERATION = 16
_CELLS, _ROWS = 400_000, 256  # ratings of a round, and attacks, that are computed in one go


@dataclass(frozen=True)
class PaperAttacks:
    """The scripted attackers with their default parameters, those of the paper."""

    name: str = "scripted, default"
    attacks: Attacks = None

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        attack = Scripts.of(make_task(**arguments), self.attacks).default
        return SearchResult(Scripted(attack), 0, describe(attack))


@dataclass(frozen=True)
class Grid:
    """The best of a small grid of the scripted attackers' parameters, see `Scripts.grid`."""

    name: str = "scripted, best of grid"
    attacks: Attacks = None

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        trial = _Trial(arguments, self.attacks, budget, seed)
        attacks = trial.scripts.grid
        if len(attacks) > trial.left:
            attacks = [attacks[k] for k in np.random.default_rng(seed).permutation(len(attacks))[: trial.left]]
        return trial.best(attacks, trial.scores(attacks))


@dataclass(frozen=True)
class RandomSearch:
    """The best of points drawn uniformly from the cube of the scripted attackers' parameters."""

    name: str = "random search"
    attacks: Attacks = None

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        trial = _Trial(arguments, self.attacks, budget, seed)
        points = np.random.default_rng(seed).random((trial.left, trial.dimensions(1)))
        return trial.best_point(points, trial.score_points(points))


@dataclass(frozen=True)
class CmaEs:
    """CMA-ES (Hansen and Ostermeier, 2001) in the same cube, begun anew at random wherever it has converged.

    The library is `cma` (Hansen, Akimoto and Baudis).

    Attributes:
        spread: standard deviation of the first generation.
        name: in tables.
        attacks: see `Scripts.of`.
    """

    spread: float = 0.3
    name: str = "CMA-ES"
    attacks: Attacks = None

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        trial = _Trial(arguments, self.attacks, budget, seed)
        random = np.random.default_rng(seed)
        size = trial.dimensions(2)  # in one it does not work; a further coordinate counts for nothing
        points, scores = np.empty((0, size)), np.empty(0)
        while trial.left >= _GENERATION:
            search = self._begin(size, random)
            while trial.left >= _GENERATION and not search.stop():
                generation = search.ask()
                found = trial.score_points(np.asarray(generation))
                search.tell(generation, (-found).tolist())
                points, scores = np.concatenate([points, generation]), np.concatenate([scores, found])
        return trial.best_point(points, scores)

    def _begin(self, size: int, random: np.random.Generator) -> Any:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it would like matplotlib's plots
            import cma  # type: ignore[import-untyped]
        options = {"bounds": [0, 1], "popsize": _GENERATION, "seed": int(random.integers(1, 2**31)), "verbose": -9}
        return cma.CMAEvolutionStrategy(random.uniform(0.2, 0.8, size), self.spread, options)


class _Trial:
    """Tries scripted attacks, as long as there is budget.

    Where luck has a part an attack is tried in `GAMES` games, and a share of the budget is kept for the best, which
    are tried again: the best of many noisy scores is mostly the luckiest.
    """

    def __init__(self, arguments: TaskArguments, attacks: Attacks, budget: Budget, seed: int) -> None:
        self.task = make_task(**arguments)
        self.scripts = Scripts.of(self.task, attacks)
        self._seed, self._budget, self._luck = seed, budget, 0
        self._rounds = self.task.game.scenario.max_cycles
        certain = is_certain(arguments)
        self._budget.spend(2 * self._rounds)
        self._games = 1 if certain else GAMES
        reserve = 0 if certain else min(budget.rounds // 5, _FINALISTS * 8 * GAMES * self._rounds)
        self._again = reserve // (_FINALISTS * self._rounds)
        if self.left < _GENERATION:
            needed = 2 * _GENERATION * self._games * self._rounds
            raise UnsuitableError(
                f"the budget of {budget.rounds} rounds is too small for a search; give {needed} or more"
            )

    @property
    def left(self) -> int:
        """How many more attacks can be tried."""
        spare = self._budget.left - self._again * _FINALISTS * self._rounds
        return max(0, spare // (self._rounds * self._games))

    def dimensions(self, least: int) -> int:
        """Of the cube to search, at least so many.

        Raises:
            UnsuitableError: there is nothing to search.
        """
        if not self.scripts.size:
            raise UnsuitableError(f"{describe(self.scripts.default)} has no parameters to search")
        return max(least, self.scripts.size)

    def scores(self, attacks: Sequence[Attack], games: int | None = None) -> Points:
        """Mean score of each attack; all those tried in one go meet the same luck."""
        games = games or self._games
        cells = self.task.game.roster.n_raters * self.task.game.roster.n_providers * games
        rows = max(1, min(_ROWS, _CELLS // cells))
        found = []
        for at in range(0, len(attacks), rows):
            some = attacks[at : at + rows]
            self._luck += 1
            attacker, batch = Scripted(side_by_side(some)), (len(some), games)
            found.append(mean_rewards(self.task, attacker, (self._seed, self._luck), batch, SEARCHED)[0].mean(axis=1))
            self._budget.spend(len(some) * games * self._rounds)
        scores: Points = np.concatenate(found).astype(np.float64)
        return scores

    def score_points(self, points: Points) -> Points:
        """Mean score of the attacks at some points of the cube, (K, size)."""
        return self.scores([self.scripts.decode(point) for point in points])

    def best_point(self, points: Points, scores: Points) -> SearchResult:
        """The best of the points that were tried."""
        order = np.argsort(-scores)[:_FINALISTS]
        return self.best([self.scripts.decode(point) for point in points[order]], scores[order])

    def best(self, attacks: Sequence[Attack], scores: Points) -> SearchResult:
        """The best of the attacks that were tried, the leading ones tried again if luck has a part."""
        leading = np.argsort(-scores)[:_FINALISTS]
        if self._again:
            leading = leading[np.argsort(-self.scores([attacks[k] for k in leading], self._again))]
        attack = attacks[leading[0]]
        return SearchResult(Scripted(attack), self._budget.spent, describe(attack))
