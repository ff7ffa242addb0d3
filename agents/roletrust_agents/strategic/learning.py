"""Independent learners: each agent follows the slope of its own reward, while all others do the same."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from roletrust_agents.strategic.playing import LEARNED, mean_rewards
from roletrust_agents.strategic.strategies import BOUNDS, Floats, Side, StrategyProfile, departure
from roletrust_env.game.game import Game

_MEAN, _SQUARE, _LEAST = 0.9, 0.99, 1e-8  # Adam
_LAST = 0.1
"""Learning rate and spread at the end, as shares of the initial ones.

Agents that try much are noise for the others: a rater that has learnt to ignore quality still informs providers while
it tries other strategies.
"""


class LearningSettings(NamedTuple):
    """Settings of the learners.

    Attributes:
        steps: Number of steps, at least 1.
        pairs: Number of pairs of games in a step, for each run.
        spread: Initial standard deviation of the parameters that are tried.
        rate: Initial learning rate of Adam.
    """

    steps: int = 100
    pairs: int = 16
    spread: float = 0.15
    rate: float = 0.05


class LearnedProfile(NamedTuple):
    """What agents have learnt in R runs.

    Attributes:
        population: Parameters after the last step, shape (2, n, R) for each role.
        course: Mean departure from honest play by step, shape (steps, 2, R): of the providers, then of the raters.
    """

    population: StrategyProfile
    course: Floats


def learn(
    game: Game,
    start: StrategyProfile,
    settings: LearningSettings,
    seed: int,
    *,
    shuffled: bool = False,
    advance: Callable[[], object] = lambda: None,
) -> LearnedProfile:
    """Let all agents learn at once, each for itself, in R runs side by side.

    Each agent has an evolution strategy of its own, after Salimans, Ho, Chen, Sidor and Sutskever (2017). In a step
    every agent i tries w_i + s e_ik and w_i - s e_ik in the games of pair k, with e_ik ~ N(0, 1) of its own, and all
    agents try at once. The slope of its mean reward R_i is estimated by

        g_i = 1 / (2 s n) sum_k (R_i(k, +) - R_i(k, -)) e_ik,

    in which the moves of the others are noise with mean 0, and Adam follows it. The spread s and the learning rate fall
    linearly to a tenth. Parameters stay in their ranges. An agent whose reward does not depend on what it does stays
    where it is.

    Args:
        game: Game, without agents of both roles.
        start: Parameters before the first step, shape (2, n, R) for each role.
        settings: Settings.
        seed: Random seed; the runs have other games in the batch.
        shuffled: Whether each agent gets its rewards of a step in another order of the pairs, so that they say nothing
            of its strategy. What it does then is drift, with which learning has to be compared.
        advance: Called after each step.
    """
    runs = start.providers.shape[-1]
    sides: tuple[Side, ...] = ("providers", "raters")
    weights = {side: part.copy() for side, part in zip(sides, start, strict=True)}
    means, squares = ({side: np.zeros_like(part) for side, part in weights.items()} for _ in range(2))
    course = np.empty((settings.steps, 2, runs))
    for step in range(settings.steps):
        rng = np.random.default_rng((seed, step))
        moves = {side: rng.standard_normal((*part.shape, settings.pairs)) for side, part in weights.items()}
        left = 1 - (1 - _LAST) * step / settings.steps
        rate, spread = settings.rate * left, settings.spread * left
        tried = StrategyProfile(*(_tried(side, weights[side], moves[side], spread) for side in sides))
        earned = mean_rewards(game, tried, (LEARNED, seed, step), (runs, settings.pairs), rows=2)
        lead = earned[:, 0] - earned[:, 1]
        if shuffled:
            lead = rng.permuted(lead, axis=-1)
        own = {"providers": game.roster.providers(lead), "raters": game.roster.raters(lead)}
        for side in sides:
            slope = (own[side] * moves[side]).mean(axis=-1) / (2 * spread)
            means[side] = _MEAN * means[side] + (1 - _MEAN) * slope
            squares[side] = _SQUARE * squares[side] + (1 - _SQUARE) * slope**2
            mean, square = means[side] / (1 - _MEAN ** (step + 1)), squares[side] / (1 - _SQUARE ** (step + 1))
            weights[side] = _within(side, weights[side] + rate * mean / (np.sqrt(square) + _LEAST))
        course[step] = [departure(side, weights[side]).mean(axis=0) for side in sides]
        advance()
    return LearnedProfile(StrategyProfile(*(weights[side] for side in sides)), course)


def _tried(side: Side, weights: Floats, moves: Floats, spread: float) -> Floats:
    """Return the parameters of both games of each pair, shape (2, n, 2, R, pairs)."""
    away = spread * moves
    middle = weights[..., None]
    return _within(side, np.stack([middle + away, middle - away], axis=2))


def _within(side: Side, parameters: Floats) -> Floats:
    """Return parameters cut to their ranges."""
    return np.stack([np.clip(row, *bounds) for row, bounds in zip(parameters, BOUNDS[side], strict=True)])
