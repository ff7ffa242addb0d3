"""Search methods over scripted attackers: default parameters, grid search, random search, and CMA-ES."""

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
from roletrust_env.game.make_task import make_task
from roletrust_env.game.policy import Policy
from roletrust_env.parameters import refuse_unknown

Points = npt.NDArray[np.float64]
Attack = Mapping[str, Policy]
Attacks = tuple[AttackKind, ...] | None
"""Kinds of attack to search, see `Scripts.of`."""

GAMES = 8
"""Number of games in which an attack is tried if the task is random."""

_FINALISTS = 8  # number of the best attacks that are tried again if the task is random
_GENERATION = 16
_CELLS, _ROWS = 400_000, 256  # limits on the ratings of a round and on the attacks in one batch


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
        trial = _Trial(arguments, self.attacks, budget, seed)
        attacks = trial.scripts.grid
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
        trial = _Trial(arguments, self.attacks, budget, seed)
        points = np.random.default_rng(seed).random((trial.left, trial.dimensions(1)))
        return trial.best_point(points, trial.score_points(points))


@refuse_unknown
@dataclass(frozen=True)
class CmaEs:
    """CMA-ES (Hansen and Ostermeier, 2001) in the same cube as the random search, restarted at random on convergence.

    The implementation is the package `cma` (Hansen, Akimoto and Baudis).

    Attributes:
        spread: Standard deviation of the first generation.
        name: Name in tables.
        attacks: Kinds of attack, see `Scripts.of`.
        alike: Whether all agents of a role play the same attack. The cube is then as small as that of one agent.
    """

    spread: float = 0.3
    name: str = "CMA-ES"
    attacks: Attacks = None
    alike: bool = False

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        trial = _Trial(arguments, self.attacks, budget, seed, self.alike)
        random = np.random.default_rng(seed)
        size = trial.dimensions(2)  # CMA-ES needs two coordinates; a surplus one has no effect
        points, scores = np.empty((0, size)), np.empty(0)
        while trial.left >= _GENERATION:
            search = self._begin(size, random)
            while trial.left >= _GENERATION and not search.stop():
                generation = search.ask()
                generation_scores = trial.score_points(np.asarray(generation))
                search.tell(generation, (-generation_scores).tolist())
                points, scores = np.concatenate([points, generation]), np.concatenate([scores, generation_scores])
        return trial.best_point(points, scores)

    def _begin(self, size: int, random: np.random.Generator) -> Any:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it warns about missing plots
            import cma  # type: ignore[import-untyped]
        options = {"bounds": [0, 1], "popsize": _GENERATION, "seed": int(random.integers(1, 2**31)), "verbose": -9}
        return cma.CMAEvolutionStrategy(random.uniform(0.2, 0.8, size), self.spread, options)


def agreed_search(attacks: Attacks = None) -> CmaEs:
    """CMA-ES over scripted attacks that all agents of a role play alike.

    Args:
        attacks: Kinds of attack, see `Scripts.of`.
    """
    return CmaEs(name="agreed CMA-ES", attacks=attacks, alike=True)


class _Trial:
    """Trial of scripted attacks within a budget.

    If the task is random, an attack is tried in `GAMES` games, and the best attacks are tried again with a part of the
    budget, because the best of many noisy scores is biased upwards.
    """

    def __init__(
        self, arguments: TaskArguments, attacks: Attacks, budget: Budget, seed: int, alike: bool = False
    ) -> None:
        self.task = make_task(**arguments)
        self.scripts = Scripts.of(self.task, attacks, alike)
        self._seed, self._budget, self._batches = seed, budget, 0
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
        """Number of attacks that can still be tried."""
        spare = self._budget.left - self._again * _FINALISTS * self._rounds
        return max(0, spare // (self._rounds * self._games))

    def dimensions(self, least: int) -> int:
        """Return the number of dimensions of the cube to search, but not less than `least`.

        Raises:
            UnsuitableError: The attacks have no parameters to search.
        """
        if not self.scripts.size:
            raise UnsuitableError(f"{describe(self.scripts.default)} has no parameters to search")
        return max(least, self.scripts.size)

    def scores(self, attacks: Sequence[Attack], games: int | None = None) -> Points:
        """Return the mean score of each attack. All attacks of a batch meet the same random numbers."""
        games = games or self._games
        cells = self.task.game.roster.n_raters * self.task.game.roster.n_providers * games
        rows = max(1, min(_ROWS, _CELLS // cells))
        means = []
        for at in range(0, len(attacks), rows):
            chunk = attacks[at : at + rows]
            self._batches += 1
            attacker, batch, seed = Scripted(side_by_side(chunk)), (len(chunk), games), (self._seed, self._batches)
            means.append(mean_rewards(self.task, attacker, seed, batch, SEARCHED)[0].mean(axis=1))
            self._budget.spend(len(chunk) * games * self._rounds)
        scores: Points = np.concatenate(means).astype(np.float64)
        return scores

    def score_points(self, points: Points) -> Points:
        """Return the mean scores of the attacks at points of the cube, shape (K, size)."""
        return self.scores([self.scripts.decode(point) for point in points])

    def best_point(self, points: Points, scores: Points) -> SearchResult:
        """Return the best attack among the points that were tried."""
        order = np.argsort(-scores)[:_FINALISTS]
        return self.best([self.scripts.decode(point) for point in points[order]], scores[order])

    def best(self, attacks: Sequence[Attack], scores: Points) -> SearchResult:
        """Return the best of the attacks that were tried. The leading ones are tried again if the task is random."""
        leading = np.argsort(-scores)[:_FINALISTS]
        if self._again:
            leading = leading[np.argsort(-self.scores([attacks[k] for k in leading], self._again))]
        attack = attacks[leading[0]]
        return SearchResult(Scripted(attack), self._budget.spent, describe(attack))
