"""How strategic agents learn: games that they play, steps uphill, and what deviating brings."""

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np

from roletrust_agents.strategic.strategies import (
    BOUNDS,
    HONEST,
    Floats,
    Side,
    StrategyProfile,
    departure,
    uniform_population,
)
from roletrust_env.game.consumer import buy
from roletrust_env.game.game import Game
from roletrust_env.game.rollout import rollout

LEARNED, MEASURED, DEVIATED, SEARCHED_BEST = range(4)
"""Kinds of random numbers: those that agents learn from, and those of the three measurements."""


class Played(NamedTuple):
    """What games came to, means over their rounds with the weights of these.

    Attributes:
        rewards: Reward of each agent, raters first, shape (N, ...).
        quality: Mean quality that the providers chose, as a share of what they are able to, shape
            (...).
        welfare: Welfare, shape (...), see `play`.
        utility: Quality that consumers got as a share of the best that was on offer, shape (...).
    """

    rewards: Floats
    quality: Floats
    welfare: Floats
    utility: Floats


def mean_rewards(
    game: Game,
    population: StrategyProfile,
    seed: tuple[int, ...],
    batch: tuple[int, ...],
    rows: int,
) -> Floats:
    """Return the mean reward of each agent in each game, raters first, shape (N, K, *batch).

    Args:
        game: Game to play.
        population: Parameters of the agents, with axes for the rows and for the batch.
        seed: Random seed.
        batch: Shape of the batch.
        rows: Number of rows K of games that meet the same noise.
    """
    noise = game.random(int(np.random.SeedSequence(seed).generate_state(1)[0]))
    total: Floats | float = 0.0
    for played in rollout(population.seated(game), noise, noise, batch, rows=rows):
        total = total + played.weight * played.rewards
    return np.asarray(total, np.float64) / game.scenario.mean_length


def play(
    game: Game,
    population: StrategyProfile,
    seed: tuple[int, ...],
    batch: tuple[int, ...],
    rows: int,
) -> Played:
    """Play games and measure them, arguments as for `mean_rewards`.

    Welfare is what consumers get, less what it costs:

        W = mean over rounds of (mean over raters of the quality that each gets where it trusts most
                                 - mean over providers of the cost of their services)

    A rater goes by the trust that it knows, see `Game.known_trust`. A cost is the part of a
    provider's trust that its reward lacks, so that the rules of the game have it. Trust itself is
    no part of welfare.
    """
    noise = game.random(int(np.random.SeedSequence(seed).generate_state(1)[0]))
    weight, roster = game.scenario.rewards.provider_trust, game.roster
    sums: list[Floats | float] = [0.0] * 5
    for before, actions, state, rewards, round_weight in rollout(
        population.seated(game), noise, noise, batch, rows=rows
    ):
        offered = game.offered(before, actions, state)
        trust = game.known_trust(before)
        bought = buy(trust, np.broadcast_to(offered[None, ...], trust.shape), axis=1)
        cost = weight * game.published(state)[1] - roster.providers(rewards)
        parts = (
            rewards,
            actions.quality.mean(axis=0),
            bought.got.mean(axis=0),
            bought.best.mean(axis=0),
            cost.mean(axis=0),
        )
        sums = [whole + round_weight * part for whole, part in zip(sums, parts, strict=True)]
    earned, quality, got, best, cost = (
        np.asarray(part, np.float64) / game.scenario.mean_length for part in sums
    )
    return Played(
        earned, quality, got - cost, np.divide(got, best, out=np.zeros_like(got), where=best > 0)
    )


_FINE: dict[Side, tuple[tuple[float, ...], ...]] = {
    "providers": ((0.0, 0.25, 0.5, 0.75, 1.0), (-1.0, -0.5, 0.0, 0.5, 1.0)),
    "raters": ((-1.0, -0.5, -0.2, 0.0, 0.2, 0.5, 1.0), (0.0, 0.1, 0.25, 0.5, 1.0)),
}
_COARSE: dict[Side, tuple[tuple[float, float], ...]] = {
    "providers": tuple(product((0.0, 0.5, 1.0), (-1.0, 0.0, 1.0))),
    "raters": (HONEST["raters"], (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0)),
}


class BestResponse(NamedTuple):
    """The best deviation of one agent in R runs.

    Attributes:
        gain: Reward that it has more than its own strategy, in games that did not choose it, shape
            (R,).
        parameters: Parameters of the best deviation, shape (2, R).
    """

    gain: Floats
    parameters: Floats


def best_response(
    game: Game, population: StrategyProfile, side: Side, seed: int, games: int
) -> BestResponse:
    """Search the best deviation of the first agent of a role from a population, while all others
    stay.

    All strategies of a grid, and its own, play the same games. The best one is chosen in G games,
    and its gain is measured in G others, so that a lucky choice is no gain. The gain may be below 0
    for that reason, and is 0 if the agent's own strategy is the best.

    Args:
        game: Game to play.
        population: Parameters of all agents in R runs, shape (2, n, R) for each role.
        side: Role of the agent.
        seed: Random seed.
        games: Number of games G.
    """
    grid = np.array(list(product(*_FINE[side])))  # (K, 2)
    runs, many = population.providers.shape[-1], len(grid) + 1
    parts = {
        name: np.repeat(getattr(population, name)[:, :, None, :, None], many, axis=2)
        for name in HONEST
    }
    parts[side][:, 0, 1:] = grid.T[:, :, None, None]
    earned = mean_rewards(
        game, StrategyProfile(**parts), (DEVIATED, seed), (runs, 2 * games), rows=many
    )
    roster = game.roster
    own = (roster.providers(earned) if side == "providers" else roster.raters(earned))[
        0
    ]  # (K + 1, R, 2 G)
    choosing, measuring = (half.mean(axis=-1) for half in np.split(own, 2, axis=-1))
    best, run = np.argmax(choosing, axis=0), np.arange(runs)
    every = np.concatenate(
        [getattr(population, side)[:, 0, None, :], np.repeat(grid.T[..., None], runs, axis=2)],
        axis=1,
    )
    return BestResponse(measuring[best, run] - measuring[0], every[:, best, run])


def best_welfare(game: Game, seed: int, runs: int, games: int) -> Floats:
    """Return the highest welfare of populations in which the agents of a role play alike, shape
    (R,).

    The population is chosen among those of a grid in G games for all runs together, and measured in
    G others.

    Args:
        game: Game to play.
        seed: Random seed.
        runs: Number of runs R.
        games: Number of games G of each run.
    """
    pairs = list(product(_COARSE["providers"], _COARSE["raters"]))
    provider, rater = (np.array(part).T for part in zip(*pairs, strict=True))
    population = uniform_population(game, provider, rater, (1, 1))
    welfare = play(
        game, population, (SEARCHED_BEST, seed), (runs, 2 * games), rows=len(pairs)
    ).welfare
    choosing, measuring = np.split(welfare, 2, axis=-1)
    best: Floats = measuring[np.argmax(choosing.mean(axis=(1, 2)))].mean(axis=-1)
    return best


_MEAN, _SQUARE, _LEAST = 0.9, 0.99, 1e-8  # Adam
_LAST = 0.1
"""Learning rate and spread at the end, as shares of the initial ones.

Agents that try much are noise for the others: a rater that has learnt to ignore quality still
informs providers while it tries other strategies.
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
        course: Mean departure from honest play by step, shape (steps, 2, R): of the providers, then
            of the raters.
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

    Each agent has an evolution strategy of its own, after Salimans, Ho, Chen, Sidor and Sutskever
    (2017). In a step every agent i tries w_i + s e_ik and w_i - s e_ik in the games of pair k, with
    e_ik ~ N(0, 1) of its own, and all agents try at once. The slope of its mean reward R_i is
    estimated by

        g_i = 1 / (2 s n) sum_k (R_i(k, +) - R_i(k, -)) e_ik,

    in which the moves of the others are noise with mean 0, and Adam follows it. The spread s and
    the learning rate fall linearly to a tenth. Parameters stay in their ranges. An agent whose
    reward does not depend on what it does stays where it is.

    Args:
        game: Game, without agents of both roles.
        start: Parameters before the first step, shape (2, n, R) for each role.
        settings: Settings.
        seed: Random seed; the runs have other games in the batch.
        shuffled: Whether each agent gets its rewards of a step in another order of the pairs, so
            that they say nothing of its strategy. What it does then is drift, with which learning
            has to be compared.
        advance: Called after each step.
    """
    runs = start.providers.shape[-1]
    sides: tuple[Side, ...] = ("providers", "raters")
    weights = {side: part.copy() for side, part in zip(sides, start, strict=True)}
    means, squares = (
        {side: np.zeros_like(part) for side, part in weights.items()} for _ in range(2)
    )
    course = np.empty((settings.steps, 2, runs))
    for step in range(settings.steps):
        rng = np.random.default_rng((seed, step))
        moves = {
            side: rng.standard_normal((*part.shape, settings.pairs))
            for side, part in weights.items()
        }
        left = 1 - (1 - _LAST) * step / settings.steps
        rate, spread = settings.rate * left, settings.spread * left
        tried = StrategyProfile(
            *(_tried(side, weights[side], moves[side], spread) for side in sides)
        )
        earned = mean_rewards(game, tried, (LEARNED, seed, step), (runs, settings.pairs), rows=2)
        lead = earned[:, 0] - earned[:, 1]
        if shuffled:
            lead = rng.permuted(lead, axis=-1)
        own = {"providers": game.roster.providers(lead), "raters": game.roster.raters(lead)}
        for side in sides:
            slope = (own[side] * moves[side]).mean(axis=-1) / (2 * spread)
            means[side] = _MEAN * means[side] + (1 - _MEAN) * slope
            squares[side] = _SQUARE * squares[side] + (1 - _SQUARE) * slope**2
            mean, square = (
                means[side] / (1 - _MEAN ** (step + 1)),
                squares[side] / (1 - _SQUARE ** (step + 1)),
            )
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
    return np.stack(
        [np.clip(row, *bounds) for row, bounds in zip(parameters, BOUNDS[side], strict=True)]
    )
