"""Errors of means over games and seeds, against a slow copy of their formulas."""

import math
from statistics import fmean, variance

import numpy as np
import pytest

from roletrust_env.metrics.confidence import over_games, over_seeds, student_quantile

SHARE = 0.5


def moderated(values, independent):
    """Return the mean, the error and the degrees of freedom of each mean, by loops over lists
    without gaps."""
    rows = []
    for seeds in values.tolist():
        seeds = [[x for x in games if x == x] for games in seeds]
        seeds = [games for games in seeds if games]
        noise = fmean(variance(games) / len(games) for games in seeds)
        by_seed = [fmean(games) for games in seeds]
        rows.append(
            (fmean(by_seed), variance(by_seed) if len(seeds) > 1 else None, noise, len(seeds))
        )
    between = [row[1] - row[2] for row in rows if row[1] is not None]
    priors = [row[2] + max(0.0, fmean(between)) for row in rows]
    ratios = [row[1] / prior for row, prior in zip(rows, priors, strict=True) if row[1] is not None]
    own = values.shape[1] - 1
    spread = own * variance(ratios) / 2
    scatter = (4 * spread + own - 2) / (spread - 1) if spread > 1 else math.inf
    weight = SHARE * min(own * (independent - 1), scatter)
    found = []
    for (mean, among, _, seeds), prior in zip(rows, priors, strict=True):
        freedom = seeds - 1 + weight
        squares = ((seeds - 1) * (among or 0.0) + weight * prior) / freedom
        found.append((mean, math.sqrt(squares / seeds), freedom))
    return np.array(found).T


@pytest.mark.parametrize(("search", "independent"), [(0.0, 6), (1.0, 5), (30.0, 40)])
@pytest.mark.parametrize("gaps", [False, True])
def test_errors_over_seeds_are_moderated_by_a_prior(search, independent, gaps):
    """Seeds differ by nothing but games, or more in one mean than in others, so that the prior is
    worth less."""
    random = np.random.default_rng(2)
    values = random.normal(size=(6, 3, 5)) + random.normal(size=(6, 3, 1)) * [
        [[search]],
        *[[[search > 0]]] * 5,
    ]
    if gaps:
        values[1, 2], values[2, 1:], values[0, 0, 0] = np.nan, np.nan, np.nan
    assert np.allclose(over_seeds(values, independent), moderated(values, independent), rtol=1e-12)


def test_a_single_seed_has_the_noise_of_its_games_and_a_single_game_no_error():
    values = np.array([[3.0, 5.0, np.nan, 10.0], [1.0, np.nan, np.nan, np.nan]])
    mean, half, games = over_games(values)
    assert (mean.tolist(), games.tolist()) == ([6, 1], [3, 1])
    assert half[0] == pytest.approx(
        4.302653 * math.sqrt(13 / 3)
    )  # of 2 degrees of freedom, in tables
    assert np.isnan(half[1])
    seeds = over_seeds(values[:1, None], 1)
    assert (seeds.mean[0], seeds.freedom[0]) == (6, 2)
    assert seeds.error[0] * student_quantile(2) == pytest.approx(half[0])
