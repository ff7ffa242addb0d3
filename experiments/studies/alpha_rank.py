"""Alpha-rank: how often each trust model is in use where defenders and attackers copy what does better."""

import numpy as np

from roletrust_env.benchmarking.worst_case import Floats

_POPULATION = 50
"""Number of individuals in either population."""


def alpha_rank(scores: Floats, intensity: float = 100.0) -> Floats:
    """Return the share of the time in which each model is in use, shape (M,), in a zero-sum game.

    Omidshafiei et al. (2019): a population of defenders has one model, and one of attackers has one attack. Now and
    then an individual tries something else. It takes over its population with the probability

        rho(d) = (1 - exp(-a d)) / (1 - exp(-n a d)),   1 / n where d = 0

    where d is what it gains, a the `intensity`, and n = 50 the size of the population. Each model and each attack is
    tried as often. The result is the stationary distribution of this chain, summed over the attacks.

    Args:
        scores: Scores of M models under A attacks, shape (M, A).
        intensity: Intensity of selection, above 0. The larger, the more surely what is better takes over.

    Example:
        >>> alpha_rank(np.array([[0.0, -1.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 1.0, 0.0]])).round(3).tolist()
        [0.333, 0.333, 0.333]
    """
    models, attacks = scores.shape
    chain = np.zeros((models, attacks, models, attacks))
    each = 1 / max(models + attacks - 2, 1)
    for attack in range(attacks):
        of = scores[:, attack]
        chain[:, attack, :, attack] += each * _takes_over(intensity * (of[None] - of[:, None]))
    for model in range(models):
        of = scores[model]
        chain[model, :, model, :] += each * _takes_over(intensity * (of[:, None] - of[None]))
    flow = chain.reshape(models * attacks, -1)
    np.fill_diagonal(flow, 0.0)
    np.fill_diagonal(flow, 1 - flow.sum(axis=1))
    # The distribution p has p = p flow and the sum 1; one of the equations follows from the others.
    system, right = flow.T - np.eye(len(flow)), np.zeros(len(flow))
    system[-1], right[-1] = 1.0, 1.0
    share: Floats = np.linalg.solve(system, right).reshape(models, attacks).sum(axis=1).clip(0.0, None)
    shares: Floats = share / share.sum()
    return shares


def _takes_over(gain: Floats) -> Floats:
    """Return the probability rho, of gains times the intensity, in a form that does not overflow."""
    size = abs(gain)
    with np.errstate(invalid="ignore"):
        rising = np.where(size > 0, np.expm1(-size) / np.expm1(-_POPULATION * size), 1 / _POPULATION)
    found: Floats = np.where(gain < 0, rising * np.exp(-(_POPULATION - 1) * size), rising)
    return found
