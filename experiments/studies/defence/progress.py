"""What each iteration of a game says: how much either side wins by a best response, and the equilibrium's value."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from roletrust_agents.training.defence import Floats
from roletrust_env.metrics.confidence import Interval, over_seeds
from studies.defence.double_oracle import Game, label

Measured = Mapping[str, Floats]
"""What one run has measured, by the name of a column, each in its games, shape (G,)."""

Key = TypeVar("Key")


class Iteration(NamedTuple):
    """The equilibrium of what is known, and what the best responses to it win.

    Mixtures and responses are chosen in one set of games, and all numbers are of other games: means over the
    conditions with 95% intervals over games, and over trainings if there are several runs. A response is the best of
    those that are known after the iteration.

    Attributes:
        number: Number of iterations before.
        value: Skill of the defence's mixture against the attackers' mixture.
        attack: What the attackers win by a best response to the defence's mixture, in each condition.
        defence: What the defence wins by a best response to the attackers' mixtures.
        nash_conv: The sum of both, a lower bound of the NashConv of the mixtures in the whole game.
        worst: Skill of the defence's mixture under the best responses to it.
        single: Skill of the trust model that is the best one alone, under the worst attackers for it.
        weights: Probability of each trust model, by name.
    """

    number: int
    value: Interval
    attack: Interval
    defence: Interval
    nash_conv: Interval
    worst: Interval
    single: Interval
    weights: dict[str, float]


def iterations(games: Sequence[Game]) -> list[Iteration]:
    """Return the numbers of each iteration, over games with other seeds that are played to their end."""
    numbers = range(games[0].setup.iterations)
    found = over_runs({k: [_measured(game, k) for game in games] for k in numbers})
    mixed = {k: np.mean([game.solution(k).models for game in games], axis=0).tolist() for k in numbers}
    return [
        Iteration(number=k, weights=dict(zip(games[0].known(k).defences, mixed[k], strict=True)), **found[k])
        for k in numbers
    ]


def over_runs(measured: Mapping[Key, Sequence[Measured]]) -> dict[Key, dict[str, Interval]]:
    """Return means with 95% intervals over games, and over runs if there are several, see `over_seeds`.

    Args:
        measured: What each run has measured, by what it is about. A column that a run lacks is left out.
    """
    found: dict[Key, dict[str, Interval]] = {key: {} for key in measured}
    for column in next(iter(measured.values()))[0]:
        if all(column in run for runs in measured.values() for run in runs):
            values = np.array([[run[column] for run in runs] for runs in measured.values()])
            for key, one in zip(measured, over_seeds(values, len(values)).estimates, strict=True):
                found[key][column] = one.interval
    return found


def best_trained(game: Game, learner: str) -> int:
    """Return the iteration, from 0, whose model of a learner has the best worst case at the end.

    The worst case is over all known attackers, in the games that choose.
    """
    last = game.setup.iterations
    worst = _least(game, last)
    return max(range(last), key=lambda k: worst[label(learner, k)])


def _least(game: Game, k: int) -> dict[str, float]:
    """Return the skill of each trust model under the worst attackers after k iterations, in the games that choose."""
    least = np.mean([one.chosen.mean(axis=2).min(axis=1) for one in game.payoffs(k)], axis=0)
    return dict(zip(game.known(k).defences, least.tolist(), strict=True))


def worst_of(game: Game, k: int, name: str) -> Floats:
    """Return the skill of a trust model under the worst known attacker of each condition, the mean over them, (G,)."""
    at = list(game.known(k).defences).index(name)
    rows = [one.measured[at, np.argmin(one.chosen[at].mean(axis=1))] for one in game.payoffs(k)]
    mean: Floats = np.mean(rows, axis=0)
    return mean


def _measured(game: Game, k: int) -> Measured:
    """Return the columns of an iteration."""
    solution, after = game.solution(k), game.payoffs(k + 1)
    models = len(solution.models)
    value, worst = [], []
    replies = np.zeros(len(after[0].chosen))
    for one, weights in zip(after, solution.attacks, strict=True):
        attackers = len(weights)
        mixed, measured = (np.tensordot(solution.models, part[:models], 1) for part in (one.chosen, one.measured))
        value.append(weights @ measured[:attackers] / weights.sum())
        worst.append(measured[np.argmin(mixed.mean(axis=1))])
        replies += one.chosen.mean(axis=2)[:, :attackers] @ weights / weights.sum()
    best = int(np.argmax(replies))
    replied = [
        weights @ one.measured[best, : len(weights)] / weights.sum()
        for one, weights in zip(after, solution.attacks, strict=True)
    ]
    at, under, reply = (np.mean(part, axis=0) for part in (value, worst, replied))
    known = _least(game, k)
    return {
        "value": at,
        "attack": at - under,
        "defence": reply - at,
        "nash_conv": reply - under,
        "worst": under,
        "single": worst_of(game, k + 1, max(known, key=lambda name: known[name])),
    }
