"""Games that are smooth enough for gradients.

The games are on torch, so that a backward pass through a whole game gives the gradient of all
decisions in it.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice, pairwise
from typing import Any

from roletrust_env.arrays import Array, namespace
from roletrust_env.evaluation.attackers import Attacker
from roletrust_env.evaluation.measurement import SEARCHED, judged_rollout, random_sources
from roletrust_env.evaluation.resources import pairs
from roletrust_env.evaluation.search import UnsuitableError
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.memory import check_memory
from roletrust_env.trust import RoleTrust, TrustModel
from roletrust_env.trust.algorithms import rater_quality
from roletrust_env.trust.ratings import Ratings
from roletrust_env.world import Scenario

SOFT = 1e-8
"""Smoothing of the copy of role-trust, as a distance to the mean rating; the bias is sqrt(SOFT)."""


_ANYWHERE = 1_000_000
"""Number of pairs of agents in all rounds of all games whose gradients fit into any memory."""

_TRIED, _GAMES = 2, 4
"""Number of rounds that are tried out, and of games: what games share counts once for all."""


class SmoothRoleTrust(RoleTrust):
    """Role-trust with sqrt(|d| + s) - sqrt(s) instead of sqrt(|d|), for gradients only.

    The slope of sqrt(|d|) is infinite at d = 0, where honest raters agree and where cells are
    masked, and infinity times 0 is NaN. Here the slope is 0 at d = 0, like that of |d|, and never
    above 1 / (2 sqrt(s)). The trust differs from that of role-trust by at most sqrt(s), see `SOFT`.
    Attacks that are found are scored by the exact role-trust.
    """

    def _rater_quality(self, ratings: Ratings) -> Array:
        return rater_quality(
            ratings, lambda apart: namespace(apart).sqrt(apart + SOFT) - math.sqrt(SOFT)
        )


def smooth_model(model: TrustModel[Any]) -> TrustModel[Any]:
    """Return a trust model, or its smooth copy if it has one."""
    return (
        SmoothRoleTrust(lam=model.lam, initial=model.initial) if type(model) is RoleTrust else model
    )


def check_service(scenario: Scenario) -> None:
    """Check that the perceived quality follows the delivered one smoothly.

    Raises:
        UnsuitableError: The service is not differentiable.
    """
    if scenario.service != "synthetic":
        raise UnsuitableError("the camera service is not differentiable")


def check_graph(task: AttackTask, attacker: Attacker, games: int) -> None:
    """Refuse games whose gradients do not fit into the memory: a backward pass keeps arrays of all
    rounds.

    What fits anywhere is not tried out.

    Args:
        task: Task on torch.
        attacker: A single attacker whose actions have gradients.
        games: Number of games that are played at once.

    Raises:
        ValueError: They do not fit. The message says what they would take, and about how many fit.
    """
    rounds = task.game.scenario.max_cycles
    if games * rounds * pairs(task.game) > _ANYWHERE:
        hint = f" for gradients through {rounds:,} rounds"
        check_memory("games at once:", games, _kept(task, attacker) * rounds, hint)


def _kept(task: AttackTask, attacker: Attacker) -> int:
    """Return the size of the arrays that a round of a game keeps for its gradients, in bytes: the
    largest of the first.

    In the first round there is nothing to rate, so that it keeps less.
    """
    import torch

    sizes: dict[int, int] = {}

    def keep(part: Any) -> Any:
        storage = part.untyped_storage()
        sizes[storage.data_ptr()] = storage.nbytes()
        return part

    with torch.autograd.graph.saved_tensors_hooks(keep, lambda part: part):
        played = judged_rollout(task, attacker, (1, _GAMES), *random_sources(task, 0, SEARCHED))
        graph, after = [], [0]
        for _, outcome in islice(played, _TRIED):
            graph.append(outcome.reward)  # alive, so that no place is taken twice
            after.append(sum(sizes.values()))
    del graph
    return max(b - a for a, b in pairwise(after)) // _GAMES


@contextmanager
def one_thread() -> Iterator[None]:
    """Let torch use one thread. The arrays are small, and on a busy machine more threads take four
    times as long.
    """
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
