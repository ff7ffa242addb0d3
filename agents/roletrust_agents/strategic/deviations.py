"""What deviating brings: the best response of one agent to the others, and the best that all could do together."""

from itertools import product
from typing import NamedTuple

import numpy as np

from roletrust_agents.strategic.playing import DEVIATED, SEARCHED_BEST, mean_rewards, play
from roletrust_agents.strategic.strategies import HONEST, Floats, Side, StrategyProfile, uniform_population
from roletrust_env.game.game import Game

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
        gain: Reward that it has more than its own strategy, in games that did not choose it, shape (R,).
        parameters: Parameters of the best deviation, shape (2, R).
    """

    gain: Floats
    parameters: Floats


def best_response(game: Game, population: StrategyProfile, side: Side, seed: int, games: int) -> BestResponse:
    """Search the best deviation of the first agent of a role from a population, while all others stay.

    All strategies of a grid, and its own, play the same games. The best one is chosen in G games, and its gain is
    measured in G others, so that a lucky choice is no gain. The gain may be below 0 for that reason, and is 0 if the
    agent's own strategy is the best.

    Args:
        game: Game to play.
        population: Parameters of all agents in R runs, shape (2, n, R) for each role.
        side: Role of the agent.
        seed: Random seed.
        games: Number of games G.
    """
    grid = np.array(list(product(*_FINE[side])))  # (K, 2)
    runs, many = population.providers.shape[-1], len(grid) + 1
    parts = {name: np.repeat(getattr(population, name)[:, :, None, :, None], many, axis=2) for name in HONEST}
    parts[side][:, 0, 1:] = grid.T[:, :, None, None]
    earned = mean_rewards(game, StrategyProfile(**parts), (DEVIATED, seed), (runs, 2 * games), rows=many)
    roster = game.roster
    own = (roster.providers(earned) if side == "providers" else roster.raters(earned))[0]  # (K + 1, R, 2 G)
    choosing, measuring = (half.mean(axis=-1) for half in np.split(own, 2, axis=-1))
    best, run = np.argmax(choosing, axis=0), np.arange(runs)
    every = np.concatenate(
        [getattr(population, side)[:, 0, None, :], np.repeat(grid.T[..., None], runs, axis=2)], axis=1
    )
    return BestResponse(measuring[best, run] - measuring[0], every[:, best, run])


def best_welfare(game: Game, seed: int, runs: int, games: int) -> Floats:
    """Return the highest welfare of populations in which the agents of a role play alike, shape (R,).

    The population is chosen among those of a grid in G games for all runs together, and measured in G others.

    Args:
        game: Game to play.
        seed: Random seed.
        runs: Number of runs R.
        games: Number of games G of each run.
    """
    pairs = list(product(_COARSE["providers"], _COARSE["raters"]))
    provider, rater = (np.array(part).T for part in zip(*pairs, strict=True))
    population = uniform_population(game, provider, rater, (1, 1))
    welfare = play(game, population, (SEARCHED_BEST, seed), (runs, 2 * games), rows=len(pairs)).welfare
    choosing, measuring = np.split(welfare, 2, axis=-1)
    best: Floats = measuring[np.argmax(choosing.mean(axis=(1, 2)))].mean(axis=-1)
    return best
