"""The game between trust models and attackers that a run has played: its equilibrium, and what mixing models is worth.

The payoff is the score of the suite, a zero-sum game. The defender picks a trust model for each game at random, with
one set of probabilities for all conditions, since it does not know who attacks. The attacker knows the probabilities
and the condition, but not the model that was drawn. Only attacks that were played on every model are its strategies: a
search that was trained on one model has no payoff against the others.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog  # type: ignore[import-untyped]

from roletrust_env.benchmarking.suite import WITHOUT_SEARCH
from roletrust_env.benchmarking.worst_case import AttackScores, Condition, Floats
from roletrust_env.metrics.confidence import Interval
from studies.alpha_rank import alpha_rank

SHARED = WITHOUT_SEARCH | {"universal"}
"""Methods that play the same attacks on every model."""


_LEAST = 1e-6  # a probability that is smaller is rounding


class Payoffs(NamedTuple):
    """Scores of one condition, in the games for choosing and in the games for measuring.

    Attributes:
        condition: Condition.
        attacks: Names of the attacks that were played on every model.
        chosen: Scores of M models under A attacks in the games for choosing, shape (M, A, G).
        measured: Scores in the games for measuring, shape (M, A, G).
    """

    condition: Condition
    attacks: tuple[str, ...]
    chosen: Floats
    measured: Floats


class Solution(NamedTuple):
    """Equilibrium of the game in which each condition counts alike.

    Attributes:
        value: Score that the defender has, at least, whatever the attacker does.
        models: Probability of each model, shape (M,).
        attacks: Probability of each attack, by condition, shape (A,) each.
    """

    value: float
    models: Floats
    attacks: tuple[Floats, ...]


class Equilibrium(NamedTuple):
    """Equilibrium of a run, with 95% intervals that resample games.

    Mixtures and attacks are chosen in the games for choosing, and all scores are of the games for measuring.

    Attributes:
        names: Names of the models.
        weights: Probability of each model in the equilibrium.
        alone: Score of each model alone under the best response to it.
        exploitability: What the mixture has over each model alone.
        mixture: Score of the mixture under the best response to it.
        gain: What the mixture has over the model that is the best one alone.
        informed: Score of a defender that knows the condition, and takes the best model alone of each.
        informed_mixture: Score of one that knows the condition, and has the mixture of each.
        attacks: Probability of each attack in the equilibrium by condition, those above 0.
        alpha_rank: Share of each model by `alpha_rank`, the mean over the conditions, without an interval.
    """

    names: tuple[str, ...]
    weights: tuple[Interval, ...]
    alone: tuple[Interval, ...]
    exploitability: tuple[Interval, ...]
    mixture: Interval
    gain: Interval
    informed: Interval
    informed_mixture: Interval
    attacks: dict[Condition, dict[str, float]]
    alpha_rank: tuple[float, ...]


def payoffs(attacks: Iterable[AttackScores], models: Sequence[str]) -> list[Payoffs]:
    """Return the payoffs of each condition in which agents attack.

    Args:
        attacks: Scores of all attacks of a run.
        models: Names of the models.

    Raises:
        ValueError: No attack was played on all models in some condition, or in none an agent attacks.
    """
    groups: dict[Condition, dict[tuple[str, str], dict[str, AttackScores]]] = {}
    for one in attacks:
        if one.condition.share and one.model in models:
            group = groups.setdefault(one.condition, {})
            if one.method in SHARED:
                group.setdefault((one.method, one.attack), {})[one.model] = one
    if not groups:
        raise ValueError("the results have no condition with an attack")
    found = []
    for condition, group in groups.items():
        common = {name: rows for (_, name), rows in group.items() if _complete(rows, models)}
        if not common:
            raise ValueError(f"no attack was played on all {len(models)} models in {condition.description}")
        chosen, measured = (
            np.array([[np.ravel(getattr(rows[m], part)) for rows in common.values()] for m in models])
            for part in ("chosen", "score")
        )
        found.append(Payoffs(condition, tuple(common), chosen, measured))
    return found


def _complete(rows: dict[str, AttackScores], models: Sequence[str]) -> bool:
    return len(rows) == len(models) and not any(
        np.isnan(x).any() for one in rows.values() for x in (one.chosen, one.score)
    )


def solve(games: Sequence[Floats]) -> Solution:
    """Return the equilibrium of mean scores, one matrix of shape (M, A) for each condition, by linear programming.

    The defender's program is: maximise the mean of v[c] with v[c] <= sum over the models of x[m] U[c][m, a] for every
    attack a. The attacker's mixtures are its dual.

    Example:
        >>> rock_paper = np.array([[0.0, -1.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 1.0, 0.0]])
        >>> found = solve([rock_paper])
        >>> round(found.value, 6) + 0.0, found.models.round(3).tolist()
        (0.0, [0.333, 0.333, 0.333])
    """
    models, conditions = len(games[0]), len(games)
    rows = [np.hstack([-game.T, np.eye(conditions)[[c] * game.shape[1]]]) for c, game in enumerate(games)]
    cost = np.r_[np.zeros(models), np.full(conditions, -1 / conditions)]
    whole = np.r_[np.ones(models), np.zeros(conditions)][None]
    bounds = [(0.0, None)] * models + [(None, None)] * conditions
    below = np.vstack(rows)
    found = linprog(cost, below, np.zeros(len(below)), whole, [1.0], bounds, method="highs")
    if not found.success:
        raise ValueError(f"the game has no solution: {found.message}")
    weights = np.clip(found.x[:models], 0.0, None)
    ends = np.cumsum([game.shape[1] for game in games])[:-1]
    duals = np.split(np.clip(-found.ineqlin.marginals, 0.0, None) * conditions, ends)
    return Solution(float(-found.fun), weights / weights.sum(), tuple(duals))


def responded(weights: Floats, chosen: Sequence[Floats], measured: Sequence[Floats]) -> float:
    """Return the mean score of a mixture over the conditions, each under the attack that is worst when it is chosen.

    Args:
        weights: Probability of each model, shape (M,).
        chosen: Mean scores in the games for choosing, shape (M, A) for each condition.
        measured: Mean scores in the games for measuring.
    """
    worst = [
        weights @ measure[:, np.argmin(weights @ choose)] for choose, measure in zip(chosen, measured, strict=True)
    ]
    return float(np.mean(worst))


def equilibrium(games: Sequence[Payoffs], models: Sequence[str], resamples: int = 200, seed: int = 0) -> Equilibrium:
    """Return the equilibrium with intervals: games are drawn anew, and everything is chosen and measured in the draw.

    Args:
        games: Payoffs of each condition.
        models: Names of the models.
        resamples: Number of draws.
        seed: Random seed of the draws.
    """
    rng = np.random.default_rng(seed)
    numbers, solution = _numbers(games, None)
    draws = np.array([_numbers(games, rng)[0] for _ in range(resamples)])
    low, high = np.percentile(draws, [2.5, 97.5], axis=0)
    ends = [Interval(*map(float, ends)) for ends in zip(numbers, low, high, strict=True)]
    m = len(models)
    mixture, gain, informed, informed_mixture = ends[3 * m :]
    return Equilibrium(
        names=tuple(models),
        weights=tuple(ends[:m]),
        alone=tuple(ends[m : 2 * m]),
        exploitability=tuple(ends[2 * m : 3 * m]),
        mixture=mixture,
        gain=gain,
        informed=informed,
        informed_mixture=informed_mixture,
        attacks={
            game.condition: {name: float(w) for name, w in zip(game.attacks, weights, strict=True) if w > _LEAST}
            for game, weights in zip(games, solution.attacks, strict=True)
        },
        alpha_rank=tuple(np.mean([alpha_rank(game.chosen.mean(axis=2)) for game in games], axis=0).tolist()),
    )


def _numbers(games: Sequence[Payoffs], rng: np.random.Generator | None) -> tuple[Floats, Solution]:
    """Return all numbers of an equilibrium in one row, of the games as they are or of a draw, and its solution."""
    chosen, measured = (
        [_means(part, rng) for part in parts] for parts in zip(*(game[2:] for game in games), strict=True)
    )
    pairs = [([c], [m]) for c, m in zip(chosen, measured, strict=True)]
    found, single = solve(chosen), np.eye(len(chosen[0]))
    alone = np.array([responded(row, chosen, measured) for row in single])
    mixture = responded(found.models, chosen, measured)
    least = np.array([game.min(axis=1) for game in chosen])  # (C, M)
    best = alone[np.argmax(least.mean(axis=0))]
    informed = np.mean([responded(single[np.argmax(row)], *pair) for row, pair in zip(least, pairs, strict=True)])
    mixed = np.mean([responded(solve(pair[0]).models, *pair) for pair in pairs])
    return np.r_[found.models, alone, mixture - alone, mixture, mixture - best, informed, mixed], found


def _means(scores: Floats, rng: np.random.Generator | None) -> Floats:
    """Return the mean over the games, shape (M, A), or over as many games that are drawn from them."""
    count = scores.shape[2]
    drawn = np.arange(count) if rng is None else rng.integers(count, size=count)
    means: Floats = scores @ np.bincount(drawn, minlength=count) / count
    return means
