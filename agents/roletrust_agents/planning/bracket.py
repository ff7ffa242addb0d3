"""The best that a rater can do under `damage` with stealth: an attack from below, a proof from above.

In the world of `roletrust_agents.planning.exact`, but with a lie of its own about every provider.

From below: the providers are cut into two groups, about each of which there is one lie in a round. The best sequences
that repeat a few bits, and the best single lie, climb each to the top of its hill.

From above, for one compromised rater, with the names of `Damage`, N = T - 1 rounds of ratings, s = sinc, and
g(x, l) = x s(1 - x) s(x - l) what a note x counts after the note l:

    for all x, l in [0, 1]:  g(x, l) + 2 sqrt(1 - x) >= 1 + s(1 - l) - s(1 - x)                                      (1)

A note that counts little is far from the truth, or the notes around it are. The first note counts no less than it would
after a 1. So the sum over the rounds, with s(0) = 1 at its begin and s <= 1 at its end, averaged over the providers, is

    sum of G[n] >= N - 2 sum of U[n],    U[n] = (E[n] - (1 - lam) E[n - 1]) / lam                                    (2)

for the means G of g and U of u over the providers. As 0 <= G <= 1, for every price p >= 0 the damage that round n loses
by the attacker's own notes, v[n] G[n] with v[n] = share * remaining_weight * ToR of the attacker, is at least
p G[n] - max(0, p - v[n]). With (2), the score of a game is at most

    constant - p N + sum over n of the maximum over E of  pay(n, E, 0) + max(0, p - v[n](E)) + 2 p k[n] E            (3)

where k is 1, and 1 / lam in the last round: every E[n] is now chosen for itself, between 0 and 1 - (1 - lam)^n. What
is maximised is linear but for two kinks, so that four points decide. The price is the one with the lowest bound.

Proof of (1). Let e = 1 - x, m = 1 - l, q = sqrt(e). On [-1, 1], s(y) >= 1 - abs(y), and s falls with abs(y).
If m >= e / 2, then abs(e - m) <= m, so s(e - m) >= s(m), and the left side less the right side is at least
2 q + s(e) - 1 - s(m) (1 - (1 - e) s(e)) >= 2 q + (2 - e) s(e) - 2 >= 2 q + (2 - e) (1 - e) - 2 = q (1 - q)^2 (2 + q).
If m < e / 2, then 0 <= e - m <= e, so s(e - m) >= s(e), and it is at least 2 q + s(e) + (1 - e) s(e)^2 - 2. By
s(e) >= 1 - e that is at least (1 - q)^2 ((1 - q) (1 + q)^3 - 1), which is not negative up to e = 0.7. Beyond, with
y = 1 - e: s(e) >= y (1 + y) (1 - (pi y)^2 / 6) >= y + y^2 / 3, and 2 q >= 2 - y - 0.3 y^2, together at least 2.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import minimize_scalar  # type: ignore[import-untyped]

from roletrust_agents.planning.exact import Damage, damage_task, optimal_rater, rating_weight
from roletrust_agents.planning.grid import polish
from roletrust_env.arrays import Array
from roletrust_env.world.scenario import Scenario

_LONGEST = 3  # bits of the sequences that are repeated


@dataclass(frozen=True, eq=False)
class Bracket:
    """What some raters can do at least, and at most.

    Attributes:
        score: mean per round that `lies` reach in the game.
        bound: that no attack exceeds; None for several raters, whose lies may differ from one to the other.
        lies: what each of them rates, (T, P); those of round 0, 1, have nothing to lie about.
    """

    score: float
    bound: float | None
    lies: Array


def bracket_rater(
    scenario: Scenario, *, compromised: int = 1, weight: float = 2.0, tolerance: float = 0.1, cells: int = 200
) -> Bracket:
    """The best that some raters can do under `damage` with stealth, from both sides.

    Args:
        scenario: without luck, see `roletrust_agents.planning.exact.check_certain`.
        compromised: number of raters that lie, all the same lies; at least one rater is honest.
        weight: of the trust gap beyond the tolerance.
        tolerance: the trust gap that costs nothing.
        cells: of the grid on which the best single lie is looked for, a multiple of 4.

    Raises:
        ValueError: the scenario leaves something to chance, or an argument is outside its range.
    """
    task = damage_task(scenario, compromised=compromised, weight=weight, tolerance=tolerance)
    providers = sum(group.count for group in scenario.agents if group.role == "SP")
    one = optimal_rater(
        scenario, compromised=compromised, weight=weight, tolerance=tolerance, levels=cells, points=cells
    )
    single = np.sqrt(1 - one.actions[1:])
    starts = [(providers // 2, np.stack([single, single], axis=1)), _best_bits(task, providers)]
    climbed = [_climb(task, first, providers, start) for first, start in starts]
    total, lies = max(climbed, key=lambda found: found[0])
    bound = _bound(task) / task.rounds if compromised == 1 else None
    return Bracket(total / task.rounds, bound, np.concatenate([np.ones((1, providers)), lies]))


def _total(task: Damage, shares: Array, moves: Array) -> Array:
    """The total score, (...), of u = sqrt(1 - lie) about two groups of providers, (D, 2, ...), with these shares."""
    score, unrest = task.constant, 0.0
    counts = rating_weight(moves, np.concatenate([moves[:1], moves[:-1]]))
    for n, (move, count) in enumerate(zip(moves, counts, strict=True), start=1):
        unrest = task.lam * (shares @ move) + (1 - task.lam) * unrest
        score = score + task.pay(n, unrest, shares @ count)
    return score


def _best_bits(task: Damage, providers: int) -> tuple[int, Array]:
    """The best two sequences, (D, 2), that repeat a few bits, and how many providers the first of them is for."""
    best, found = -np.inf, (0, np.zeros((task.decisions, 2)))
    for bits in range(2, _LONGEST + 1):
        words = np.array(list(product((0.0, 1.0), repeat=2 * bits))).T.reshape(2, bits, -1)
        moves = words[:, np.arange(task.decisions) % bits].swapaxes(0, 1)
        for first in range(providers // 2 + 1):
            totals = _total(task, _shares(first, providers), moves) + 0 * words[0, 0]
            if totals.max() > best:
                best, found = totals.max(), (first, moves[..., totals.argmax()])
    return found


def _climb(task: Damage, first: int, providers: int, start: Array) -> tuple[float, Array]:
    """The total on top of the hill that two sequences, (D, 2), are on, and its lies, (D, P)."""
    shares = _shares(first, providers)

    def score(flat: Array) -> Array:
        return _total(task, shares, flat.reshape(*start.shape, *flat.shape[1:]))

    moves = polish(score, start.ravel())
    lies = 1 - moves.reshape(start.shape) ** 2
    return float(score(moves)), np.repeat(lies, [first, providers - first], axis=1)


def _shares(first: int, providers: int) -> Array:
    return np.array([first, providers - first]) / providers


def _bound(task: Damage) -> float:
    """The lowest bound (3) on the total of one rater."""
    n, share = np.arange(1, task.rounds), task.share
    farthest = 1 - (1 - task.lam) ** n
    last = np.where(n < task.decisions, 1.0, 1 / task.lam)
    spread = (1 - share) ** 0.5 - share**0.5
    tolerated = task.tolerance / spread if spread else 1.0  # of two raters, one is as far from the mean as the other

    def bound(price: float) -> float:
        def best(unrest: Array) -> Array:
            value = share * task.remaining_weight(n) * task.trust(n, unrest)[1]
            return task.pay(n, unrest, 0.0) + np.maximum(0, price - value) + 2 * price * last * unrest

        worth = (task.trust(n, 0.0)[1] - price / (share * task.remaining_weight(n))) / (1 - share) ** 0.5
        corners = [np.clip(corner, 0, farthest) for corner in (0.0, tolerated, worth, farthest)]
        sums = np.max([best(corner) for corner in corners], axis=0).sum()
        return float(task.constant - price * task.decisions + sums)

    # Every price gives a bound, so it need not be the very best one.
    return min(bound(0.0), float(minimize_scalar(bound, bounds=(0, share), method="bounded").fun))
