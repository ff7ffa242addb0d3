"""Exact optima of two attacks on role-trust, for a world without luck: a provider's quality, and raters' single lie.

Both hold for scenarios in which everyone always rates everyone and nothing is left to chance, under the paper's trust
model. They follow the game's own timing: the services of round t are rated in round t + 1, and round 0 rates nothing.
The tasks are small enough for dynamic programming because raters who agree are fully trusted, but for the known rest of
their initial trust. The scores are means per round over a whole game of `max_cycles` rounds.
"""

from dataclasses import dataclass

import numpy as np

from roletrust_agents.planning.grid import Solution, solve
from roletrust_env.arrays import Array
from roletrust_env.world.scenario import Everyone, Scenario


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best attack, as far as a grid can tell.

    Attributes:
        score: mean per round that `actions` reach in the game: a lower bound of the optimum.
        error: how far the optimum may be above it, estimated by refining the grid; see `Solution.error`.
        values: the optimum as seen by the backward pass on grids of 1/4, 1/2 and all of the cells; may lie on either
            side of the truth.
        actions: what to play in each round, shape (T,): the quality, or the lie.
        seconds: that it took to compute.
    """

    score: float
    error: float
    values: tuple[float, ...]
    actions: Array
    seconds: float


@dataclass(frozen=True)
class Exploit:
    """A provider that sells bad service on good trust, among honest raters: state ToP, action quality q.

        reward[t] = ToP[t] * (1 - q[t])
        ToP[t + 1] = lam * sinc(1 - q[t]) * sinc(|q[t] - q[t - 1]|) * ToR[t + 1] * q[t] + (1 - lam) * ToP[t]
        ToR[t] = 1 - (1 - initial) * (1 - lam)^t

    ToP[t] is as updated in round t, by the ratings of q[t - 1]; q[0] has no predecessor to differ from.

    Attributes:
        lam: weight of the newest round.
        initial: trust before any rating.
        rounds: length of the game, T.
    """

    lam: float
    initial: float
    rounds: int

    constant = 0.0

    @property
    def decisions(self) -> int:
        """One in each round."""
        return self.rounds

    @property
    def start(self) -> float:
        """ToP[0]."""
        return self.initial

    def step(self, t: int, state: Array, last: Array, action: Array) -> tuple[Array, Array]:
        """See `roletrust_agents.planning.grid.Task.step`."""
        tor = 1 - (1 - self.initial) * (1 - self.lam) ** (t + 1)
        quality = np.sinc(1 - action) * np.sinc(action - last) * tor * action
        return state * (1 - action), self.lam * quality + (1 - self.lam) * state


@dataclass(frozen=True)
class Damage:
    """A share of the raters gives one lie x to all providers, whose quality is 1: state E, action u = sqrt(1 - x).

    With c the compromised share, and n rounds of ratings behind, the raters' notes lie so that

        E[n] = lam * u[n] + (1 - lam) * E[n - 1],    E[0] = 0
        honest ToR = 1 - sqrt(c) * E - rest,    attacker ToR = 1 - sqrt(1 - c) * E - rest
        rest = (1 - initial) * (1 - lam)^n
        QoP = (1 - c) * honest ToR + c * sinc(1 - x) * sinc(|x - last x|) * attacker ToR * x

    and the score of a round is 1 - ToP - weight * max(0, honest ToR - attacker ToR - tolerance). The sum of ToP over
    the game is linear in every QoP, each of which counts 1 - (1 - lam)^(T - n) in all; so ToP need not be part of the
    state. In u, rather than x, everything but the kink of the penalty is smooth.

    Attributes:
        lam: weight of the newest round.
        initial: trust before any rating.
        rounds: length of the game, T.
        share: c, in (0, 1).
        weight: of the trust gap, at least 0.
        tolerance: the gap that costs nothing, at least 0.
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
        """One in each round but the first, which rates nothing."""
        return self.rounds - 1

    @property
    def constant(self) -> float:
        """The damage that the initial trust alone would leave: sum of 1 - (1 - lam)^t * initial."""
        return float(np.sum(1 - self.initial * (1 - self.lam) ** np.arange(self.rounds)))

    def step(self, t: int, state: Array, last: Array, action: Array) -> tuple[Array, Array]:
        """Decision t is the lie of round t + 1. See `roletrust_agents.planning.grid.Task.step`."""
        unrest = self.lam * action + (1 - self.lam) * state
        return self.pay(t + 1, unrest, rating_weight(action, last)), unrest

    def pay(self, n: Array | int, unrest: Array, counts: Array | float) -> Array:
        """What round n brings with E[n] = `unrest`, if a note of the attacker counts its ToR times `counts`."""
        honest, attacker = self.trust(n, unrest)
        quality = (1 - self.share) * honest + self.share * attacker * counts
        return -self.remaining_weight(n) * quality - self.weight * np.maximum(0, honest - attacker - self.tolerance)

    def trust(self, n: Array | int, unrest: Array) -> tuple[Array, Array]:
        """ToR of the honest raters and of the attackers in round n."""
        trusted = 1 - (1 - self.initial) * (1 - self.lam) ** n
        return trusted - self.share**0.5 * unrest, trusted - (1 - self.share) ** 0.5 * unrest

    def remaining_weight(self, n: Array | int) -> Array:
        """What the QoP of round n counts in the sum of ToP over the game."""
        return 1 - (1 - self.lam) ** (self.rounds - n)


def rating_weight(action: Array, last: Array) -> Array:
    """What a note x counts after the note before, rho x, in [0, 1]; both given as sqrt(1 - x)."""
    return np.sinc(action**2) * np.sinc(action**2 - last**2) * (1 - action**2)


def optimal_provider(scenario: Scenario, *, levels: int = 200, points: int = 200) -> Optimum:
    """The best that one provider can do under `exploit`, its raters being honest; see `Exploit`.

    Args:
        scenario: without luck, see `check_certain`.
        levels: cells into which the range of quality is cut, a multiple of 4.
        points: cells into which the range of ToP is cut, a multiple of 4.

    Returns:
        The optimum; `actions` are the qualities.

    Raises:
        ValueError: the scenario leaves something to chance, or an argument is outside its range.
    """
    check_certain(scenario)
    task = Exploit(scenario.lam, scenario.initial_trust, scenario.max_cycles)
    found = solve(task, levels=levels, points=points)
    return _optimum(found, scenario, found.actions)


def optimal_rater(
    scenario: Scenario,
    *,
    compromised: int = 1,
    weight: float = 2.0,
    tolerance: float = 0.1,
    levels: int = 200,
    points: int = 200,
) -> Optimum:
    """The best that some raters can do under `damage` with stealth, by one lie about all providers; see `Damage`.

    Lies that differ from provider to provider do more; see `roletrust_agents.planning.bracket`.

    Args:
        scenario: without luck, see `check_certain`.
        compromised: number of raters that lie; at least one rater is honest.
        weight: of the trust gap beyond the tolerance; with 0 it is best to rate 0 in every round.
        tolerance: the trust gap that costs nothing.
        levels: cells into which the range of sqrt(1 - lie) is cut, a multiple of 4.
        points: cells into which the range of its exponential mean is cut, a multiple of 4.

    Returns:
        The optimum; `actions` are the lies, of which that of round 0, 1, has nothing to lie about.

    Raises:
        ValueError: the scenario leaves something to chance, or an argument is outside its range.
    """
    task = damage_task(scenario, compromised=compromised, weight=weight, tolerance=tolerance)
    found = solve(task, levels=levels, points=points)
    return _optimum(found, scenario, np.append(1.0, 1 - found.actions**2))


def damage_task(scenario: Scenario, *, compromised: int, weight: float, tolerance: float) -> Damage:
    """The task of raters in a scenario. Arguments and errors as for `optimal_rater`."""
    check_certain(scenario)
    raters = sum(group.count for group in scenario.agents if group.role == "SR")
    if not isinstance(compromised, int) or not 1 <= compromised < raters:
        raise ValueError(f"compromised is {compromised!r}; of {raters} raters, 1 to {raters - 1} can be compromised")
    for name, value in (("weight", weight), ("tolerance", tolerance)):
        if not 0 <= value < np.inf:
            raise ValueError(f"{name} is {value!r}; it must be a finite number, 0 or more")
    return Damage(scenario.lam, scenario.initial_trust, scenario.max_cycles, compromised / raters, weight, tolerance)


def check_certain(scenario: Scenario) -> None:
    """Refuse a scenario whose optimum is not computed here.

    Raises:
        ValueError: names all that would have to be otherwise.
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
        "agents play both roles": any(group.role == "SR+SP" for group in groups),
    }
    met = [text for text, holds in obstacles.items() if holds]
    if met:
        raise ValueError(f"scenario {scenario.name!r} has no exact optimum here: {', '.join(met)}")


def _optimum(found: Solution, scenario: Scenario, actions: Array) -> Optimum:
    """A solution in sums, as means per round."""
    rounds = scenario.max_cycles
    values = tuple(value / rounds for value in found.values)
    return Optimum(found.total / rounds, found.error / rounds, values, actions, found.seconds)
