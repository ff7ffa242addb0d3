"""The white-box planner: gradient ascent through the game itself, on a sequence of actions that is fixed beforehand.

The game is differentiable in what the attacker does, so that one backward pass through a whole game on torch tells how
every action should have been. The planner knows all of the game but its luck; the sequence it comes up with is
open-loop: it reacts to nothing.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import Array, namespace
from roletrust_env.evaluation.attacked_games import (
    SEARCHED,
    TaskArguments,
    is_certain,
    judged_rollout,
    mean_rewards,
    random_sources,
)
from roletrust_env.evaluation.attackers import OpenLoop
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError
from roletrust_env.game.attack_task import AttackTask, make_task
from roletrust_env.randomness import Random
from roletrust_env.trust import RoleTrust, Traits
from roletrust_env.trust.algorithms import MaskedRatings, rater_quality

SOFT = 1e-8
"""Distance from the average note under which the planner's copy of role-trust is smooth; the bias is sqrt(SOFT)."""


class SmoothRoleTrust(RoleTrust):
    """Role-trust with sqrt(|d| + s) - sqrt(s) in place of sqrt(|d|), for gradients only.

    The slope of sqrt(|d|) is infinite at d = 0, where honest raters agree and where masked cells are, and infinity
    times 0 is NaN. Here it is 0 there, as that of |d| is, and nowhere above 1 / (2 sqrt(s)). Trust differs from the
    true one by at most sqrt(s), see `SOFT`; what is planned by it is scored by the true one.
    """

    def _rater_quality(self, masked: MaskedRatings) -> Array:
        return rater_quality(masked, lambda apart: namespace(apart).sqrt(apart + SOFT) - math.sqrt(SOFT))


@dataclass(frozen=True)
class Planner:
    """Gradient ascent by Adam (Kingma and Ba, 2015) on the logits of all actions, from many starts as one batch.

    A third of the budget or more goes to all starts, then the best quarter goes on alone. The learning rate falls to 0
    by a half cosine. Where luck has a part, every step draws new luck, the same for all starts: a plan for one fixed
    sample would fit its accidents. Of the final sequences that one is taken that does best in the true game.

    A step counts as one round per game and round that it plays; its backward pass is not counted again.

    Attributes:
        starts: sequences at first; fewer if the world is large or the budget small.
        samples: games per sequence and step where luck has a part; without luck one is enough.
        rate: learning rate of the logits at first.
        name: in tables.
    """

    starts: int = 128
    samples: int = 4
    rate: float = 0.3
    name: str = "white-box planner"

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        with _one_thread():
            return self._search(arguments, budget, seed)

    def _search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        import torch

        true = make_task(**arguments)
        task = _smooth_task(arguments)
        rounds, size = task.game.scenario.max_cycles, task.action_size
        samples = 1 if is_certain(arguments) else self.samples
        budget.spend(2 * rounds)
        check = samples if samples == 1 else 16 * samples
        # Small arrays cost what their number costs; beyond some thousands of cells time grows with their size.
        cells = task.game.roster.n_raters * task.game.roster.n_providers * samples
        starts = max(8, min(self.starts, 6400 // cells, budget.rounds // (60 * rounds * samples)))
        kept = max(2, starts // 4)
        left = budget.left - kept * check * rounds
        first, second = _steps(left, rounds * samples, starts, kept)
        if first < 1:
            raise UnsuitableError(
                f"the budget of {budget.rounds} rounds is too small for the planner in games of {rounds} rounds"
            )

        noise, chance = random_sources(task, seed, SEARCHED)
        logits = torch.tensor(_starts(np.random.default_rng(seed), rounds, size, starts))
        for steps, done in ((first, 0), (second, first)):
            logits.requires_grad_()
            adam = torch.optim.Adam([logits], lr=self.rate)
            for step in range(done, done + steps):
                adam.param_groups[0]["lr"] = self.rate * 0.5 * (1 + math.cos(math.pi * step / (first + second)))
                score = self._climb(task, logits, adam, noise, chance, samples)
                budget.spend(rounds * samples * logits.shape[2])
            logits = logits.detach()
            if not done:
                logits = logits[:, :, score.argsort(descending=True)[:kept]].clone()
        actions = torch.sigmoid(logits).numpy()
        scores = mean_rewards(true, OpenLoop(actions.astype(true.game.like.dtype)), seed, (kept, check), SEARCHED)[0]
        budget.spend(kept * check * rounds)
        best = int(scores.mean(axis=1).argmax())
        words = f"open loop, best of {starts} starts, {first} + {second} steps"
        return SearchResult(OpenLoop(actions[:, :, best]), budget.spent, words)

    def _climb(self, task: AttackTask, logits: Any, adam: Any, noise: Random, chance: Random, samples: int) -> Any:
        """One step of Adam; returns the scores before it, one for each sequence."""
        import torch

        attacker = OpenLoop(torch.sigmoid(logits))
        rounds = judged_rollout(task, attacker, (logits.shape[2], samples), noise, chance)
        score = sum(outcome.reward for _, outcome in rounds).mean(dim=1) / len(logits)
        adam.zero_grad()
        (-score.sum()).backward()
        # Trust models other than role-trust may have corners of their own; a direction that is lost is no direction.
        logits.grad.nan_to_num_(0.0, 0.0, 0.0)
        adam.step()
        return score.detach()


@contextmanager
def _one_thread() -> Iterator[None]:
    """Let torch use one thread: its arrays are small here, and threads that wait for a busy core cost fourfold."""
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def _smooth_task(arguments: TaskArguments) -> AttackTask:
    """The task on torch in double precision, with role-trust smoothed.

    Raises:
        UnsuitableError: no gradient leads through the service or the trust model.
    """
    import torch

    game = make_task(**arguments).game
    if game.scenario.service != "synthetic":
        raise UnsuitableError("no gradient leads through a camera")
    model = game.model
    if not Traits.of(model).differentiable:
        raise UnsuitableError(f"trust jumps under {type(model).__name__}, so that no gradient leads through it")
    if type(model) is RoleTrust:
        model = SmoothRoleTrust(lam=model.lam, initial=model.initial)
    return make_task(**{**arguments, "trust_model": model}, like=torch.zeros((), dtype=torch.float64))


def _steps(budget: int, price: int, starts: int, kept: int) -> tuple[int, int]:
    """Steps of all the starts, for a third of the budget, and of those that are kept, for the rest.

    The second stage is cut at three times the first, as more brings nothing; the first then has what is left.
    """
    first = budget // (3 * price * starts)
    second = (budget - first * price * starts) // (price * kept)
    if second > 3 * first:
        first = budget // (price * (starts + 3 * kept))
        second = 3 * first
    return first, second


def _starts(random: np.random.Generator, rounds: int, size: int, starts: int) -> npt.NDArray[np.float64]:
    """Logits to start from, (T, A, R): patterns of 1 to 12 rounds, over and over, no round quite like another.

    Trust forgets quickly, so good play is nearly periodic, and a gradient cannot make one period of another. In every
    other pattern all parts of the action do the same.
    """
    logits = np.empty((rounds, size, starts))
    for k in range(starts):
        period = int(random.integers(1, 13))
        pattern = random.normal(0, 2, (period, size if k % 2 else 1))
        logits[..., k] = pattern[np.arange(rounds) % period]
    noisy: npt.NDArray[np.float64] = logits + random.normal(0, 0.1, logits.shape)
    return noisy
