"""Trial of scripted attacks within a budget of rounds."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from roletrust_env.evaluation.attacked_games import SEARCHED, TaskArguments, is_certain, mean_rewards
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.composite import side_by_side
from roletrust_env.evaluation.scripts import describe
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError
from roletrust_env.game.make_task import make_task
from roletrust_env.game.policy import Policy

Scores = npt.NDArray[np.float64]
Attack = Mapping[str, Policy]

GAMES = 8
"""Number of games in which an attack is tried if the task is random."""

GENERATION = 16
"""Smallest number of attacks that a budget must allow."""

_FINALISTS = 8  # number of the best attacks that are tried again if the task is random
_CELLS, _ROWS = 400_000, 256  # limits on the ratings of a round and on the attacks in one batch


class Trial:
    """Trial of scripted attacks within a budget.

    If the task is random, an attack is tried in `GAMES` games, and the best attacks are tried again with a part of the
    budget, because the best of many noisy scores is biased upwards.

    Args:
        arguments: Arguments of the task.
        budget: Budget, which the trial spends.
        seed: Random seed.

    Attributes:
        task: The task.

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
                f"the budget of {budget.rounds} rounds is too small for a search; give {needed} or more"
            )

    @property
    def left(self) -> int:
        """Number of attacks that can still be tried."""
        spare = self._budget.left - self._again * _FINALISTS * self._rounds
        return max(0, spare // (self._rounds * self._games))

    def scores(self, attacks: Sequence[Attack], games: int | None = None) -> Scores:
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
        scores: Scores = np.concatenate(means).astype(np.float64)
        return scores

    def best(self, attacks: Sequence[Attack], scores: Scores) -> SearchResult:
        """Return the best of the attacks that were tried. The leading ones are tried again if the task is random."""
        leading = np.argsort(-scores)[:_FINALISTS]
        if self._again:
            leading = leading[np.argsort(-self.scores([attacks[k] for k in leading], self._again))]
        attack = attacks[leading[0]]
        return SearchResult(Scripted(attack), self._budget.spent, describe(attack))
