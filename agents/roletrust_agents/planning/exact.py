"""Exact optima of two attacks on role-trust in deterministic scenarios: the quality of a provider,
and a single lie.

Both hold for scenarios in which every rater rates every provider in every round and nothing is
random, under the trust model of the paper. The timing is that of the game: the services of round t
are rated in round t + 1, and there are no ratings in round 0. The tasks are small enough for
dynamic programming because raters that agree have full trust, except for a known remainder of their
initial trust. The scores are means per round over a whole game of `max_cycles` rounds.
"""

from dataclasses import dataclass, replace

import numpy as np

from roletrust_agents.planning.grid import Optimum, solve
from roletrust_env.arrays import Array
from roletrust_env.parameters import whole_number
from roletrust_env.world.scenario import Everyone, Scenario


@dataclass(frozen=True)
class Exploit:
    """Task of a provider that exploits its trust among honest raters: the state is ToP, the action
    is the quality q.

        reward[t] = ToP[t] * (1 - q[t])
        ToP[t + 1] = lam * sinc(1 - q[t]) * sinc(|q[t] - q[t - 1]|) * ToR[t + 1] * q[t] + (1 - lam)
                * ToP[t]
        ToR[t] = 1 - (1 - initial) * (1 - lam)^t

    ToP[t] is updated in round t by the ratings of q[t - 1]. For q[0], the term with the last action
    is left out.

    Attributes:
        lam: Weight of the newest round.
        initial: Trust before any rating.
        rounds: Length of the game, T.
    """

    lam: float
    initial: float
    rounds: int

    constant = 0.0

    @property
    def decisions(self) -> int:
        """Number of decisions: one in each round."""
        return self.rounds

    @property
    def start(self) -> float:
        """State before the first decision, ToP[0]."""
        return self.initial

    def step(self, t: int, state: Array, last: Array, action: Array) -> tuple[Array, Array]:
        """Return reward and next state. See `roletrust_agents.planning.grid.Task.step`."""
        tor = 1 - (1 - self.initial) * (1 - self.lam) ** (t + 1)
        quality = np.sinc(1 - action) * np.sinc(action - last) * tor * action
        return state * (1 - action), self.lam * quality + (1 - self.lam) * state


@dataclass(frozen=True)
class Damage:
    """Task of a share of the raters that rates all providers x, though their quality is 1.

    The state is E, and the action is u = sqrt(1 - x). With the compromised share c, after n rounds
    of ratings,

        E[n] = lam * u[n] + (1 - lam) * E[n - 1],    E[0] = 0
        honest ToR = 1 - sqrt(c) * E - rest,    attacker ToR = 1 - sqrt(1 - c) * E - rest
        rest = (1 - initial) * (1 - lam)^n
        QoP = (1 - c) * honest ToR + c * sinc(1 - x) * sinc(|x - last x|) * attacker ToR * x

    and the score of a round is 1 - ToP - weight * max(0, honest ToR - attacker ToR - tolerance).
    The sum of ToP over the game is linear in every QoP, each of which has the weight 1 - (1 -
    lam)^(T - n), so ToP need not be part of the state. As functions of u instead of x, all terms
    except the penalty are smooth.

    Attributes:
        lam: Weight of the newest round.
        initial: Trust before any rating.
        rounds: Length of the game, T.
        share: Compromised share of the raters, c, in (0, 1).
        weight: Weight of the trust gap, at least 0.
        tolerance: Trust gap without penalty, at least 0.
    """

    lam: float
    initial: float
    rounds: int
    share: float
    weight: float
    tolerance: float

    start = 0.0

    @property
    def decisions(self) -> int:
        """Number of decisions: one in each round except the first, which has no ratings."""
        return self.rounds - 1

    @property
    def constant(self) -> float:
        """Damage if trust were only the remainder of the initial trust: sum of 1 - (1 - lam)^t *
        initial.
        """
        return float(np.sum(1 - self.initial * (1 - self.lam) ** np.arange(self.rounds)))

    def step(self, t: int, state: Array, last: Array, action: Array) -> tuple[Array, Array]:
        """Return reward and next state. Decision t is the lie of round t + 1. See `Task.step` in
        `planning.grid`.
        """
        deviation = self.lam * action + (1 - self.lam) * state
        return self.reward(t + 1, deviation, rating_weight(action, last)), deviation

    def reward(self, n: Array | int, deviation: Array, weight: Array | float) -> Array:
        """Return the reward of round n.

        Args:
            n: Number of rounds of ratings.
            deviation: Exponential mean E[n].
            weight: Weight of a rating of the attacker in relation to its ToR, see `rating_weight`.
        """
        honest, attacker = self.trust(n, deviation)
        quality = (1 - self.share) * honest + self.share * attacker * weight
        return -self.remaining_weight(n) * quality - self.weight * np.maximum(
            0, honest - attacker - self.tolerance
        )

    def trust(self, n: Array | int, deviation: Array) -> tuple[Array, Array]:
        """Return the ToR of the honest raters and of the attackers in round n."""
        full = 1 - (1 - self.initial) * (1 - self.lam) ** n
        return full - self.share**0.5 * deviation, full - (1 - self.share) ** 0.5 * deviation

    def remaining_weight(self, n: Array | int) -> Array:
        """Return the weight of the QoP of round n in the sum of ToP over the game."""
        return 1 - (1 - self.lam) ** (self.rounds - n)


def rating_weight(action: Array, last: Array) -> Array:
    """Return the contribution rho x of a rating x after the last rating, in [0, 1]; both are given
    as sqrt(1 - x).
    """
    return np.sinc(action**2) * np.sinc(action**2 - last**2) * (1 - action**2)


def optimal_provider(scenario: Scenario, *, cells: int = 200) -> Optimum:
    """Return the optimum of one provider under `exploit` among honest raters; see `Exploit`.

    Args:
        scenario: Deterministic scenario, see `check_certain`.
        cells: Number of grid cells of the quality, and of ToP, a multiple of 4.

    Returns:
        The optimum, with the qualities as `actions`.

    Raises:
        ValueError: The scenario is not supported, or an argument is outside its range.
    """
    check_certain(scenario)
    task = Exploit(scenario.lam, scenario.initial_trust, scenario.max_cycles)
    return solve(task, cells)


def optimal_rater(
    scenario: Scenario,
    *,
    compromised: int = 1,
    weight: float = 2.0,
    tolerance: float = 0.1,
    cells: int = 200,
) -> Optimum:
    """Return the optimum of some raters under `damage` with stealth, with one lie about all
    providers; see `Damage`.

    Lies that differ between providers do more damage; see `roletrust_agents.planning.bracket`.

    Args:
        scenario: Deterministic scenario, see `check_certain`.
        compromised: Number of raters that lie. At least one rater is honest.
        weight: Weight of the trust gap beyond the tolerance. With 0, the best lie is 0 in every
            round.
        tolerance: Trust gap without penalty.
        cells: Number of grid cells of sqrt(1 - lie), and of its exponential mean, a multiple of 4.

    Returns:
        The optimum, with the lies as `actions`. The one of round 0, which has no ratings, is 1.

    Raises:
        ValueError: The scenario is not supported, or an argument is outside its range.
    """
    task = damage_task(scenario, compromised=compromised, weight=weight, tolerance=tolerance)
    best = solve(task, cells)
    return replace(best, actions=np.append(1.0, 1 - best.actions**2))


def damage_task(scenario: Scenario, *, compromised: int, weight: float, tolerance: float) -> Damage:
    """Return the task of raters in a scenario. The arguments and errors are those of
    `optimal_rater`.
    """
    check_certain(scenario)
    raters = sum(group.count for group in scenario.agents if group.role == "SR")
    if not 1 <= whole_number("compromised", compromised) < raters:
        raise ValueError(
            f"compromised is {compromised!r}; of {raters} raters, 1 to {raters - 1} can be "
            "compromised"
        )
    for name, value in (("weight", weight), ("tolerance", tolerance)):
        if not 0 <= value < np.inf:
            raise ValueError(f"{name} is {value!r}; it must be a finite number, 0 or more")
    return Damage(
        scenario.lam,
        scenario.initial_trust,
        scenario.max_cycles,
        compromised / raters,
        weight,
        tolerance,
    )


def check_certain(scenario: Scenario) -> None:
    """Refuse a scenario that is not deterministic, or not supported for another reason.

    Raises:
        ValueError: The scenario is not supported. The message gives all reasons.
    """
    rules, groups = scenario, scenario.agents
    obstacles = {
        "the service is seen through a camera": rules.service != "synthetic",
        "not everyone is served by everyone": not isinstance(rules.access, Everyone),
        "raters perceive with noise": any(group.noise > 0 for group in groups),
        "providers differ in ability": any(group.ability != 1 for group in groups),
        "raters are subjective": any(group.subjective for group in groups),
        "services are perturbed": bool(rules.perturbations),
        "ratings get lost or come late": rules.ratings.lost > 0 or rules.ratings.late > 0,
        "agents come and go": any(group.open for group in groups),
        "agents can be cut off": rules.admission is not None,
        "games end at random": rules.continuation < 1,
        "agents play both roles": any(group.role == "SR+SP" for group in groups),
    }
    reasons = [text for text, holds in obstacles.items() if holds]
    if reasons:
        raise ValueError(
            f"scenario {scenario.name!r} has no exact optimum here: {', '.join(reasons)}"
        )
