"""The best response of an attacker: a coalition that is trained against a mixture of trust models."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.training.adam_training import EvolutionStrategy
from roletrust_agents.training.settings import StrategySettings
from roletrust_agents.training.universal import known_starts
from roletrust_env.benchmarking.known_attacks import KnownAttack
from roletrust_env.evaluation.attackers import Attacker
from roletrust_env.game.make_task import make_task

_LEAST = 0.02  # share of a model below which a training leaves it out
_STEPS = 4  # fewer are no training


def least_budget(length: int) -> int:
    """Return the number of rounds below which no training of an attacker can be made, in games of some length."""
    settings = StrategySettings()
    return _STEPS * (settings.step_games + settings.validation) * length


def respond_by_attack(
    arguments: Mapping[str, Mapping[str, Any]],
    shares: Mapping[str, float],
    known: Sequence[KnownAttack],
    budget: int,
    seed: int,
) -> tuple[Attacker, int]:
    """Train a coalition against a mixture of trust models, from the known coalitions and the universal ones.

    Args:
        arguments: Arguments of the attack task against each trust model, by its spec.
        shares: Probability of each trust model, by its spec.
        known: Known attackers of the condition.
        budget: Number of game rounds that the training may play.
        seed: Random seed.

    Returns:
        The coalition and the number of rounds that were played.

    Raises:
        ValueError: The budget allows no step against so many models.
    """
    many = {model: share for model, share in shares.items() if share >= _LEAST}
    tasks = [make_task(**arguments[model]) for model in many]
    weights = np.array(list(many.values()))
    starts = known_starts("universal", [one.record for one in known])
    training = EvolutionStrategy(tasks, StrategySettings(), seed, budget, starts, (weights / weights.sum()).tolist())
    needed = training.rounds + training.most_rounds
    if needed > budget:
        raise ValueError(
            f"--budget is {budget} rounds; training an attacker against {len(many)} models needs {needed} or more"
        )
    for _ in training.within(budget):
        pass
    return CoalitionAttacker(training.network), training.rounds
