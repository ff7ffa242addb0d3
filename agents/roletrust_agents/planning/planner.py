"""White-box planner: gradient ascent through the game on a fixed sequence of actions.

The game is differentiable with respect to the actions of the attacker, so one backward pass through
a whole game on torch gives the gradient of all actions. The planner knows the whole game except its
random numbers. The resulting sequence is open-loop: it does not react to the game.
"""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from roletrust_agents.smooth import check_graph, check_service, one_thread, smooth_model
from roletrust_env.evaluation.attackers import OpenLoop
from roletrust_env.evaluation.measurement import (
    SEARCHED,
    TaskArguments,
    is_certain,
    judged_rollout,
    mean_rewards,
    random_sources,
)
from roletrust_env.evaluation.search import Budget, SearchResult, UnsuitableError
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.make_task import make_task
from roletrust_env.parameters import refuse_unknown_parameters
from roletrust_env.randomness import Random, generator
from roletrust_env.trust import Traits


@refuse_unknown_parameters
@dataclass(frozen=True)
class Planner:
    """Gradient ascent by Adam (Kingma and Ba, 2015) on the logits of all actions, from many starts
    as one batch.

    At least a third of the budget is for all starts; the rest is for the best quarter of them. The
    learning rate decays to 0 by a half cosine. In a random task, every step draws new random
    numbers, the same for all starts, because a plan for a fixed sample would overfit it. The result
    is the final sequence with the best score in the exact game.

    A step counts one round for each round of each of its games. The backward pass is not counted.

    Attributes:
        starts: Number of sequences at the start; fewer in a large scenario or with a small budget.
        samples: Number of games per sequence and step in a random task; a deterministic task needs
            one.
        rate: Initial learning rate of the logits.
        name: Name in tables.
    """

    starts: int = 128
    samples: int = 4
    rate: float = 0.3
    name: str = "white-box planner"
    knowledge: ClassVar = "white_box"

    def search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        """See `SearchMethod.search`."""
        with one_thread():
            return self._search(arguments, budget, seed)

    def _search(self, arguments: TaskArguments, budget: Budget, seed: int) -> SearchResult:
        import torch

        true = make_task(**arguments)
        task = _smooth_task(arguments)
        rounds, size = task.game.scenario.max_cycles, task.action_size
        samples = 1 if is_certain(arguments) else self.samples
        budget.spend(2 * rounds)
        check = samples if samples == 1 else 16 * samples
        # The time depends on the number of small arrays; above some thousands of cells, it grows
        # with their size.
        cells = task.game.roster.n_raters * task.game.roster.n_providers * samples
        starts = max(8, min(self.starts, 6400 // cells, budget.rounds // (60 * rounds * samples)))
        survivors = max(2, starts // 4)
        left = budget.left - survivors * check * rounds
        first, second = _steps(left, rounds * samples, starts, survivors)
        if first < 1:
            raise UnsuitableError(
                f"the budget of {budget.rounds} rounds is too small for the planner in games of "
                f"{rounds} rounds"
            )

        noise, chance = random_sources(task, seed, SEARCHED)
        logits = torch.tensor(_starts(generator(seed), rounds, size, starts))
        check_graph(
            task, OpenLoop(torch.sigmoid(logits[:, :, :1].requires_grad_())), starts * samples
        )
        for steps, done in ((first, 0), (second, first)):
            logits.requires_grad_()
            adam = torch.optim.Adam([logits], lr=self.rate)
            for step in range(done, done + steps):
                adam.param_groups[0]["lr"] = (
                    self.rate * 0.5 * (1 + math.cos(math.pi * step / (first + second)))
                )
                score = self._climb(task, logits, adam, noise, chance, samples)
                budget.spend(rounds * samples * logits.shape[2])
            logits = logits.detach()
            if not done:
                logits = logits[:, :, score.argsort(descending=True)[:survivors]].clone()
        actions = torch.sigmoid(logits).numpy()
        attacker = OpenLoop(actions.astype(true.game.like.dtype))
        scores = mean_rewards(true, attacker, seed, (survivors, check), SEARCHED)[0]
        budget.spend(survivors * check * rounds)
        best = int(scores.mean(axis=1).argmax())
        words = f"open loop, best of {starts} starts, {first} + {second} steps"
        return SearchResult(OpenLoop(actions[:, :, best]), budget.spent, words)

    def _climb(
        self, task: AttackTask, logits: Any, adam: Any, noise: Random, chance: Random, samples: int
    ) -> Any:
        """Take a step of Adam, and return the score of each sequence before it."""
        import torch

        attacker = OpenLoop(torch.sigmoid(logits))
        rounds = judged_rollout(task, attacker, (logits.shape[2], samples), noise, chance)
        score = (
            sum(outcome.reward for _, outcome in rounds).mean(dim=1)
            / task.game.scenario.mean_length
        )
        if not score.requires_grad:  # nothing that is judged follows from the actions
            return score
        adam.zero_grad()
        (-score.sum()).backward()
        # Other trust models can have kinks of their own, where the gradient is not finite; it is
        # replaced by 0.
        logits.grad.nan_to_num_(0.0, 0.0, 0.0)
        adam.step()
        return score.detach()


def _smooth_task(arguments: TaskArguments) -> AttackTask:
    """Return the task on torch in double precision, with smoothed role-trust.

    Raises:
        UnsuitableError: The service or the trust model is not differentiable.
    """
    import torch

    game = make_task(**arguments).game
    check_service(game.scenario)
    model = game.model
    if not Traits.of(model).differentiable:
        raise UnsuitableError(
            f"trust jumps under {type(model).__name__}, so it is not differentiable"
        )
    return make_task(
        **{**arguments, "trust_model": smooth_model(model)},
        like=torch.zeros((), dtype=torch.float64),
    )


def _steps(budget: int, price: int, starts: int, survivors: int) -> tuple[int, int]:
    """Return the number of steps of all starts, for a third of the budget, and of the survivors,
    for the rest.

    The second stage has at most three times the steps of the first, as more have no effect. What is
    left then is for the first stage.

    Args:
        budget: Number of rounds.
        price: Number of rounds of a step of one sequence.
        starts: Number of sequences in the first stage.
        survivors: Number of sequences in the second stage.
    """
    first = budget // (3 * price * starts)
    second = (budget - first * price * starts) // (price * survivors)
    if second > 3 * first:
        first = budget // (price * (starts + 3 * survivors))
        second = 3 * first
    return first, second


def _starts(
    random: np.random.Generator, rounds: int, size: int, starts: int
) -> npt.NDArray[np.float64]:
    """Return the initial logits, shape (T, A, R): patterns of 1 to 12 rounds that repeat, with some
    noise.

    Trust forgets quickly, so good attacks are nearly periodic, and gradients cannot change the
    period. In every other pattern all parts of the action are equal.
    """
    logits = np.empty((rounds, size, starts))
    for k in range(starts):
        period = int(random.integers(1, 13))
        pattern = random.normal(0, 2, (period, size if k % 2 else 1))
        logits[..., k] = pattern[np.arange(rounds) % period]
    noisy: npt.NDArray[np.float64] = logits + random.normal(0, 0.1, logits.shape)
    return noisy
