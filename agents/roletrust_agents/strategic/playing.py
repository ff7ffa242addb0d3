"""Games of strategic populations: what each agent earns, and what the games are worth to consumers and providers."""

from typing import NamedTuple

import numpy as np

from roletrust_agents.strategic.strategies import Floats, StrategyProfile
from roletrust_env.game.consumer import buy
from roletrust_env.game.game import Game
from roletrust_env.game.rollout import rollout

LEARNED, MEASURED, DEVIATED, SEARCHED_BEST = range(4)
"""Kinds of random numbers: those that agents learn from, and those of the three measurements."""


class Played(NamedTuple):
    """What games came to, means over their rounds.

    Attributes:
        rewards: Reward of each agent, raters first, shape (N, ...).
        quality: Mean quality that the providers chose, as a share of what they are able to, shape (...).
        welfare: Welfare, shape (...), see `play`.
        utility: Quality that consumers got as a share of the best that was on offer, shape (...).
    """

    rewards: Floats
    quality: Floats
    welfare: Floats
    utility: Floats


def mean_rewards(
    game: Game, population: StrategyProfile, seed: tuple[int, ...], batch: tuple[int, ...], rows: int
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
        total = total + played.rewards
    return np.asarray(total, np.float64) / game.scenario.max_cycles


def play(game: Game, population: StrategyProfile, seed: tuple[int, ...], batch: tuple[int, ...], rows: int) -> Played:
    """Play games and measure them, arguments as for `mean_rewards`.

    Welfare is what consumers get, less what it costs:

        W = mean over rounds of (mean over raters of the quality that each gets where it trusts most
                                 - mean over providers of the cost of their services)

    A rater goes by the trust that it knows, see `Game.known_trust`. A cost is the part of a provider's trust that its
    reward lacks, so that the rules of the game have it. Trust itself is no part of welfare.
    """
    noise = game.random(int(np.random.SeedSequence(seed).generate_state(1)[0]))
    weight, roster = game.scenario.rewards.provider_trust, game.roster
    sums: list[Floats | float] = [0.0] * 5
    for before, actions, state, rewards in rollout(population.seated(game), noise, noise, batch, rows=rows):
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
        sums = [whole + part for whole, part in zip(sums, parts, strict=True)]
    earned, quality, got, best, cost = (np.asarray(part, np.float64) / game.scenario.max_cycles for part in sums)
    return Played(earned, quality, got - cost, np.divide(got, best, out=np.zeros_like(got), where=best > 0))
