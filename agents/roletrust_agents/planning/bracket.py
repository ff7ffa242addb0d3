"""Optimum of raters under `damage` with stealth: a lower bound by an attack, and a proven upper
bound.

The scenarios are those of `roletrust_agents.planning.exact`, but the lies can differ between
providers.

Lower bound: the providers are divided into two groups, with one lie about each group in a round. A
local search improves the best periodic sequences of 0 and 1, and the best single lie.

Upper bound, for one compromised rater: with the symbols of `Damage`, N = T - 1 rounds of ratings, s
= sinc, and the contribution g(x, l) = x s(1 - x) s(x - l) of a rating x after the rating l,

    for all x, l in [0, 1]:  g(x, l) + 2 sqrt(1 - x) >= 1 + s(1 - l) - s(1 - x)
            (1)

In words: if a rating contributes little, it or the rating before is far from the truth. The first
rating contributes no less than after a rating of 1. So the sum over the rounds, with s(0) = 1 at
its start and s <= 1 at its end, averaged over the providers, is

    sum of G[n] >= N - 2 sum of U[n],    U[n] = (E[n] - (1 - lam) E[n - 1]) / lam
            (2)

for the means G of g and U of u over the providers. The ratings of the attacker reduce the damage of
round n by v[n] G[n] with v[n] = share * remaining_weight * ToR of the attacker. As 0 <= G <= 1,
this is at least p G[n] - max(0, p - v[n]) for every price p >= 0. With (2), the score of a game is
at most

    constant - p N + sum over n of the maximum over E of
            reward(n, E, 0) + max(0, p - v[n](E)) + 2 p k[n] E         (3)

where k is 1, and 1 / lam in the last round. Every E[n] is now chosen independently, between 0 and 1
- (1 - lam)^n. The function to maximise is linear except for two kinks, so the maximum is at one of
four points. The price is the one with the lowest bound.

Proof of (1). Let e = 1 - x, m = 1 - l, q = sqrt(e). On [-1, 1], s(y) >= 1 - abs(y), and s falls
with abs(y). If m >= e / 2, then abs(e - m) <= m, so s(e - m) >= s(m), and the left side minus the
right side is at least 2 q + s(e) - 1 - s(m) (1 - (1 - e) s(e)) >= 2 q + (2 - e) s(e) - 2 >= 2 q +
(2 - e) (1 - e) - 2 = q (1 - q)^2 (2 + q). If m < e / 2, then 0 <= e - m <= e, so s(e - m) >= s(e),
and it is at least 2 q + s(e) + (1 - e) s(e)^2 - 2. By s(e) >= 1 - e that is at least (1 - q)^2 ((1
- q) (1 + q)^3 - 1), which is not negative up to e = 0.7. Beyond, with y = 1 - e: s(e) >= y (1 + y)
(1 - (pi y)^2 / 6) >= y + y^2 / 3, and 2 q >= 2 - y - 0.3 y^2, together at least 2.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import minimize_scalar  # type: ignore[import-untyped]

from roletrust_agents.planning.exact import Damage, damage_task, optimal_rater, rating_weight
from roletrust_agents.planning.grid import polish
from roletrust_env.arrays import Array
from roletrust_env.world.scenario import Scenario

_MAX_BITS = 3  # largest number of bits that a sequence repeats


@dataclass(frozen=True, eq=False)
class Bracket:
    """Lower and upper bound of the optimum of raters.

    Attributes:
        score: Mean score per round of `lies` in the game, the lower bound.
        bound: Upper bound; None for several raters, whose lies can differ from each other.
        lies: Ratings by each of the raters, shape (T, P). Those of round 0, in which there are no
            ratings, are 1.
    """

    score: float
    bound: float | None
    lies: Array


def bracket_rater(
    scenario: Scenario,
    *,
    compromised: int = 1,
    weight: float = 2.0,
    tolerance: float = 0.1,
    cells: int = 200,
) -> Bracket:
    """Return bounds of the optimum of some raters under `damage` with stealth.

    Args:
        scenario: Deterministic scenario, see `roletrust_agents.planning.exact.check_certain`.
        compromised: Number of raters that lie, all with the same lies. At least one rater is
            honest.
        weight: Weight of the trust gap beyond the tolerance.
        tolerance: Trust gap without penalty.
        cells: Number of grid cells for the best single lie, a multiple of 4.

    Raises:
        ValueError: The scenario is not supported, or an argument is outside its range.
    """
    task = damage_task(scenario, compromised=compromised, weight=weight, tolerance=tolerance)
    providers = sum(group.count for group in scenario.agents if group.role == "SP")
    best_lies = optimal_rater(
        scenario,
        compromised=compromised,
        weight=weight,
        tolerance=tolerance,
        cells=cells,
    )
    single = np.sqrt(1 - best_lies.actions[1:])
    starts = [(providers // 2, np.stack([single, single], axis=1)), _best_bits(task, providers)]
    maxima = [_climb(task, first, providers, start) for first, start in starts]
    total, lies = max(maxima, key=lambda maximum: maximum[0])
    bound = _bound(task) / task.rounds if compromised == 1 else None
    return Bracket(total / task.rounds, bound, np.concatenate([np.ones((1, providers)), lies]))


def _total(task: Damage, shares: Array, moves: Array) -> Array:
    """Return the total scores, shape (...), of lies about two groups of providers.

    Args:
        task: Task of the raters.
        shares: Share of each group among the providers, shape (2,).
        moves: Lies as sqrt(1 - lie), shape (D, 2, ...).
    """
    score, deviation = task.constant, 0.0
    weights = rating_weight(moves, np.concatenate([moves[:1], moves[:-1]]))
    for n, (move, weight) in enumerate(zip(moves, weights, strict=True), start=1):
        deviation = task.lam * (shares @ move) + (1 - task.lam) * deviation
        score = score + task.reward(n, deviation, shares @ weight)
    return score


def _best_bits(task: Damage, providers: int) -> tuple[int, Array]:
    """Return the number of providers in the first group and the best two periodic sequences of 0
    and 1, (D, 2).
    """
    best, result = -np.inf, (0, np.zeros((task.decisions, 2)))
    for bits in range(2, _MAX_BITS + 1):
        words = np.array(list(product((0.0, 1.0), repeat=2 * bits))).T.reshape(2, bits, -1)
        moves = words[:, np.arange(task.decisions) % bits].swapaxes(0, 1)
        for first in range(providers // 2 + 1):
            totals = _total(task, _shares(first, providers), moves) + 0 * words[0, 0]
            if totals.max() > best:
                best, result = totals.max(), (first, moves[..., totals.argmax()])
    return result


def _climb(task: Damage, first: int, providers: int, start: Array) -> tuple[float, Array]:
    """Return the local maximum of the total near two sequences, (D, 2), and its lies, (D, P)."""
    shares = _shares(first, providers)

    def score(flat: Array) -> Array:
        return _total(task, shares, flat.reshape(*start.shape, *flat.shape[1:]))

    moves = polish(score, start.ravel())
    lies = 1 - moves.reshape(start.shape) ** 2
    return float(score(moves)), np.repeat(lies, [first, providers - first], axis=1)


def _shares(first: int, providers: int) -> Array:
    return np.array([first, providers - first]) / providers


def _bound(task: Damage) -> float:
    """Return the lowest bound (3) on the total of one rater."""
    n, share = np.arange(1, task.rounds), task.share
    farthest = 1 - (1 - task.lam) ** n
    last = np.where(n < task.decisions, 1.0, 1 / task.lam)
    spread = (1 - share) ** 0.5 - share**0.5
    tolerated = (
        task.tolerance / spread if spread else 1.0
    )  # with two raters, both are equally far from the mean

    def bound(price: float) -> float:
        def term(deviation: Array) -> Array:
            value = share * task.remaining_weight(n) * task.trust(n, deviation)[1]
            return (
                task.reward(n, deviation, 0.0)
                + np.maximum(0, price - value)
                + 2 * price * last * deviation
            )

        kink = (task.trust(n, 0.0)[1] - price / (share * task.remaining_weight(n))) / (
            1 - share
        ) ** 0.5
        corners = [np.clip(corner, 0, farthest) for corner in (0.0, tolerated, kink, farthest)]
        total = np.max([term(corner) for corner in corners], axis=0).sum()
        return float(task.constant - price * task.decisions + total)

    # Every price gives a valid bound, so an approximate minimum is enough.
    return min(bound(0.0), float(minimize_scalar(bound, bounds=(0, share), method="bounded").fun))
