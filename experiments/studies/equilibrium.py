"""The game between trust models and attackers that a benchmark has played: is a mixture worth more
than the best model?

The payoff is the score of the suite, a zero-sum game. The defender picks a trust model for each
game at random, with one set of probabilities for all conditions, since it does not know who
attacks. The attacker knows the probabilities and the condition, but not the model that was drawn.
Only attacks that were played on every model are its strategies: a search that was trained on one
model has no payoff against the others. Each condition counts alike.

Mixtures and attacks are chosen in one set of games, and scored in another. Intervals resample
games. A minute, once `make benchmark` has run.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog  # type: ignore[import-untyped]

from roletrust_env.benchmarking.suite import WITHOUT_SEARCH
from roletrust_env.benchmarking.worst_case import AttackScores, Condition, Floats, attack_scores
from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.markdown import markdown_table
from roletrust_experiments.commands.leaderboard import read_run
from roletrust_experiments.plots.charts import Panel, Series, panels_figure
from studies.study import Recipe, Study, with_ends

SHARED = WITHOUT_SEARCH | {"universal"}
"""Methods that play the same attacks on every model."""

_LEAST = 1e-6  # a probability that is smaller is rounding
_SHOWN = 0.005  # least probability of an attack in the text
_COLUMNS = ("weight", "alone", "exploitability")


class Options(NamedTuple):
    """Results of a benchmark of trust models.

    Attributes:
        results: Its file.
        resamples: Number of draws of games for the intervals.
    """

    results: Path = Path("results/standard/results.sqlite")
    resamples: int = 200


FILES = ("equilibrium.md", "equilibrium.csv", "equilibrium.png", "attacks.csv")
RECIPES = {"equilibrium": Recipe(Options(), {name: f"equilibrium/{name}" for name in FILES})}


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


FACTS = {
    "mixture": "best mixture",
    "gain": "what it has over the best model alone",
    "informed": "best model alone in each condition, if the condition is known",
    "informed_mixture": "best mixture in each condition, if the condition is known",
}
"""Scores of a defender, by name. One that knows the condition takes the best model, or the mixture,
of each."""


def main(study: Study[Options]) -> None:
    """Solve the game of a results file, and write its equilibrium."""
    results, resamples = study.options
    suite, stored = read_run(results)
    names = suite.model_names
    games = payoffs(attack_scores(suite, stored), names)
    values, attacks = (
        equilibrium(games, resamples, study.seed),
        solve(_means(games, None)[0]).attacks,
    )
    order = sorted(range(len(names)), key=lambda k: -values["alone"][k].value)
    rows = [(names[k], [values[column][k] for column in _COLUMNS]) for k in order]
    header = ("model", *with_ends(_COLUMNS))
    study.csv(
        "equilibrium.csv",
        header,
        [[name, *(x for interval in parts for x in interval)] for name, parts in rows],
    )
    mixed = [
        (
            game.condition,
            {name: float(w) for name, w in zip(game.attacks, weights, strict=True) if w > _LEAST},
        )
        for game, weights in zip(games, attacks, strict=True)
    ]
    lines = [(*where, name, weight) for where, mixture in mixed for name, weight in mixture.items()]
    study.csv("attacks.csv", ("scenario", "track", "share", "attack", "weight"), lines)
    mixtures = [
        [
            where.description,
            ", ".join(f"{name} {weight:.0%}" for name, weight in of.items() if weight >= _SHOWN),
        ]
        for where, of in mixed
    ]
    weights = [[f"`{name}`", *map(_text, parts)] for name, parts in rows]
    facts = [[words, _text(values[name][0])] for name, words in FACTS.items()]
    note = f"suite {suite.name}, {len(games)} conditions, 95% intervals over games"
    study.page(
        "equilibrium.md",
        markdown_table(["model", *_COLUMNS], weights, names=1),
        markdown_table(["defender", suite.score], facts, names=1),
        markdown_table(["condition", "the attacker's mixture"], mixtures, names=2),
        f"{note}. Made by `{study.command}`.",
    )
    at = [name for name, _ in rows]
    weight, alone = ([parts[k] for _, parts in rows] for k in (0, 1))
    panels = [
        Panel("alone, under its worst attack", "", suite.score, [Series(suite.score, at, alone)]),
        Panel("in the equilibrium", "", "probability", [Series("probability", at, weight)]),
    ]
    title = "What is a mixture of trust models worth against attackers who know it?"
    study.figure("equilibrium.png", panels_figure(title, panels, note))


def payoffs(attacks: Iterable[AttackScores], models: Sequence[str]) -> list[Payoffs]:
    """Return the payoffs of each condition in which agents attack.

    Raises:
        ValueError: No attack was played on all models in some condition, or in none an agent
            attacks.
    """
    groups: dict[Condition, dict[tuple[str, str], dict[str, AttackScores]]] = {}
    games = 0  # of every attack; the worst ones of a model may have more
    for attack in attacks:
        if attack.condition.share and attack.model in models:
            group = groups.setdefault(attack.condition, {})
            games = min(games or attack.chosen.shape[1], attack.chosen.shape[1])
            if attack.method in SHARED:
                group.setdefault((attack.method, attack.attack), {})[attack.model] = attack
    if not groups:
        raise ValueError("the results have no condition with an attack")
    payoffs_of_conditions = []
    for condition, group in groups.items():
        common = {
            name: rows
            for (_, name), rows in group.items()
            if len(rows) == len(models)
            and not any(
                np.isnan([attack.chosen[:, :games], attack.score[:, :games]]).any()
                for attack in rows.values()
            )
        }
        if not common:
            raise ValueError(
                f"no attack was played on all {len(models)} models in {condition.description}"
            )
        chosen, measured = (
            np.array(
                [
                    [np.ravel(getattr(rows[m], part)[:, :games]) for rows in common.values()]
                    for m in models
                ]
            )
            for part in ("chosen", "score")
        )
        payoffs_of_conditions.append(Payoffs(condition, tuple(common), chosen, measured))
    return payoffs_of_conditions


def solve(games: Sequence[Floats]) -> Solution:
    """Return the equilibrium of mean scores, one matrix of shape (M, A) for each condition, by
    linear programming.

    The defender's program is: maximise the mean of v[c] with v[c] <= sum over the models of x[m]
    U[c][m, a] for every attack a. The attacker's mixtures are its dual.

    Example:
        >>> rock_paper = np.array([[0.0, -1.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 1.0, 0.0]])
        >>> found = solve([rock_paper])
        >>> round(found.value, 6) + 0.0, found.models.round(3).tolist()
        (0.0, [0.333, 0.333, 0.333])
    """
    models, conditions = len(games[0]), len(games)
    rows = [
        np.hstack([-game.T, np.eye(conditions)[[c] * game.shape[1]]])
        for c, game in enumerate(games)
    ]
    cost = np.r_[np.zeros(models), np.full(conditions, -1 / conditions)]
    whole = np.r_[np.ones(models), np.zeros(conditions)][None]
    bounds = [(0.0, None)] * models + [(None, None)] * conditions
    below = np.vstack(rows)
    solution = linprog(cost, below, np.zeros(len(below)), whole, [1.0], bounds, method="highs")
    if not solution.success:
        raise ValueError(f"the game has no solution: {solution.message}")
    weights = np.clip(solution.x[:models], 0.0, None)
    ends = np.cumsum([game.shape[1] for game in games])[:-1]
    duals = np.split(np.clip(-solution.ineqlin.marginals, 0.0, None) * conditions, ends)
    return Solution(float(-solution.fun), weights / weights.sum(), tuple(duals))


def responded(weights: Floats, chosen: Sequence[Floats], measured: Sequence[Floats]) -> float:
    """Return the mean score of a mixture over the conditions, each under the attack that is worst
    when it is chosen.

    Args:
        weights: Probability of each model, shape (M,).
        chosen: Mean scores in the games for choosing, shape (M, A) for each condition.
        measured: Mean scores in the games for measuring.
    """
    worst = [
        weights @ measure[:, np.argmin(weights @ choose)]
        for choose, measure in zip(chosen, measured, strict=True)
    ]
    return float(np.mean(worst))


def equilibrium(
    games: Sequence[Payoffs], resamples: int = 200, seed: int = 0
) -> dict[str, list[Interval]]:
    """Return the equilibrium with 95% intervals: games are drawn anew, and all is chosen and
    measured in the draw.

    Mixtures and attacks are chosen in the games for choosing, and all scores are of the games for
    measuring.

    Returns:
        For each model `weight`, its probability in the equilibrium; `alone`, its score alone under
        the best response to it; `exploitability`, what the mixture has over it. Single numbers are
        `mixture`, the score of the mixture under the best response to it, `gain`, what it has over
        the model that is the best one alone, `informed` and `informed_mixture`, see `FACTS`.
    """
    rng = np.random.default_rng(seed)
    numbers = _numbers(*_means(games, None))
    draws = [_numbers(*_means(games, rng)) for _ in range(resamples)]
    intervals = {}
    for name, value in numbers.items():
        low, high = np.percentile([draw[name] for draw in draws], [2.5, 97.5], axis=0)
        intervals[name] = [
            Interval(*map(float, ends)) for ends in zip(value, low, high, strict=True)
        ]
    return intervals


def _numbers(chosen: Sequence[Floats], measured: Sequence[Floats]) -> dict[str, Floats]:
    """Return the numbers of an equilibrium from mean scores, see `equilibrium`."""
    pairs = [([c], [m]) for c, m in zip(chosen, measured, strict=True)]
    weights, single = solve(chosen).models, np.eye(len(chosen[0]))
    alone = np.array([responded(row, chosen, measured) for row in single])
    mixture = responded(weights, chosen, measured)
    least = np.array([game.min(axis=1) for game in chosen])  # (C, M)
    best = alone[np.argmax(least.mean(axis=0))]
    informed = np.mean(
        [responded(single[np.argmax(row)], *pair) for row, pair in zip(least, pairs, strict=True)]
    )
    mixed = np.mean([responded(solve(pair[0]).models, *pair) for pair in pairs])
    singles = {
        "mixture": mixture,
        "gain": mixture - best,
        "informed": informed,
        "informed_mixture": mixed,
    }
    of_models = {"weight": weights, "alone": alone, "exploitability": mixture - alone}
    return of_models | {name: np.array([value]) for name, value in singles.items()}


def _means(
    games: Sequence[Payoffs], rng: np.random.Generator | None
) -> tuple[list[Floats], list[Floats]]:
    """Return the mean scores of each condition for choosing and for measuring, (M, A), or those of
    a draw of games.
    """

    def mean(scores: Floats) -> Floats:
        count = scores.shape[2]
        drawn = np.arange(count) if rng is None else rng.integers(count, size=count)
        means: Floats = scores @ np.bincount(drawn, minlength=count) / count
        return means

    return [mean(game.chosen) for game in games], [mean(game.measured) for game in games]


def _text(value: Interval) -> str:
    return "{:.3f} ({:.3f}, {:.3f})".format(*(x + 0.0 for x in value))
