"""Tiers and intervals over seeds: by hand, and against many reruns of drawn leaderboards."""

import numpy as np
import numpy.typing as npt
import pytest

from roletrust_env.benchmarking.tiers import tiers
from roletrust_env.metrics.confidence import over_seeds, student_quantile

Floats = npt.NDArray[np.float64]
GAMES = 16


def run(true: Floats, seeds: int, random: np.random.Generator, search: Floats) -> Floats:
    """Draw the scores of a run, (M, S, G). A mean over the games of one seed has a noise of 1, half
    of it common.

    Args:
        true: True scores, (M,).
        seeds: Number of seeds.
        random: Source of random numbers.
        search: Standard deviation between searches of different seeds for each model, (M,). A fifth
            of the variance is common to the models.
    """
    games = random.normal(size=(1, seeds, GAMES)) + random.normal(size=(len(true), seeds, GAMES))
    own = 0.8**0.5 * random.normal(size=(len(true), seeds)) + 0.2**0.5 * random.normal(size=seeds)
    return true[:, None, None] + (search[:, None] * own)[:, :, None] + (GAMES / 2) ** 0.5 * games


def searches(models: int, seeds: int, random: np.random.Generator) -> Floats:
    """Draw the noise of searches, which differs between models; a single seed shows none."""
    return np.exp(0.5 * random.normal(size=models)) * (seeds > 1)


def best_first(scores: Floats) -> npt.NDArray[np.int64]:
    return np.argsort(-scores.mean((1, 2)))


@pytest.mark.parametrize("seeds", [1, 3])
def test_intervals_and_tiers_are_right_in_reruns(seeds: int) -> None:
    random = np.random.default_rng(10 + seeds)
    covered, wrong = [], []
    for k in range(240):
        true, search = random.normal(0, (1, 2, 6)[k % 3], 10), searches(10, seeds, random)
        first = run(true, seeds, random, search)
        order = best_first(first)
        tier_of = tiers(first[order])
        estimates = over_seeds(first, 10).estimates
        covered += [
            abs(one.mean - real) <= one.half for one, real in zip(estimates, true, strict=True)
        ]
        leaders = [tier_of.index(tier) for tier in set(tier_of)]
        sorted_true = true[order]
        wrong.append(
            any(
                sorted_true[at] < sorted_true[np.array(tier_of) > tier_of[at]].max(initial=-99)
                for at in leaders
            )
        )
    assert 0.92 < np.mean(covered) < 0.98
    assert np.mean(wrong) < 0.05  # a model of a lower tier is better than the first one of a tier


@pytest.mark.parametrize(("groups", "seeds"), [([0.0], 1), ([0.0], 3), ([0.0, 100.0], 2)])
def test_models_with_equal_scores_are_seldom_in_different_tiers(
    groups: list[float], seeds: int
) -> None:
    random, separated = np.random.default_rng(seeds), []
    for _ in range(200):
        true = np.repeat(groups, 12 // len(groups))
        scores = run(true, seeds, random, searches(12, seeds, random))
        order = best_first(scores)
        tier_of = tiers(scores[order])
        pairs = {(tier, float(real)) for tier, real in zip(tier_of, true[order], strict=True)}
        separated.append(len(pairs) > len(groups))
        assert len({tier for tier, _ in pairs}) >= len(groups)
    assert np.mean(separated) < 0.08  # 5%, with the noise of this test


def test_a_tier_reaches_to_the_last_model_that_is_not_told_apart() -> None:
    games = np.array([-1.0, 1.0] * 8)
    precise = [3.0 + 0.01 * games, 2.0 + 0.01 * np.roll(games, 4), 0.0 + 0.0 * games]
    assert tiers(np.stack(precise)[:, None]) == [1, 2, 3]
    noisy = [precise[0], precise[1], 1.0 + 40.0 * np.repeat([-1.0, 1.0], 8), precise[2]]
    assert tiers(np.stack(noisy)[:, None]) == [1, 1, 1, 2]


def test_equal_models_and_unknown_noise_make_one_tier() -> None:
    scores = np.random.default_rng(0).random((1, 1, 8)) + np.zeros((3, 1, 1))
    assert tiers(scores) == [1, 1, 1]
    assert tiers(np.array([[[0.9]], [[0.1]]])) == [1, 1]  # of a single game
    assert tiers(np.empty((0, 1, 4))) == []
    assert tiers(scores[:1]) == [1]


def test_seeds_that_differ_widen_the_interval() -> None:
    """A single mean has the interval of its seeds; several share what they know of the variance."""
    values = np.array([[[0.0, 1.0], [4.0, 5.0], [2.0, 3.0]]])
    (one,) = over_seeds(values, 1).estimates
    assert one.mean == 2.5
    assert one.half == pytest.approx(4.303 * 2 / 3**0.5, abs=1e-3)
    alike = np.concatenate([values, values + 1])
    assert over_seeds(alike, 2).estimates[0].half < one.half
    noise = np.random.default_rng(0).normal(size=(1, 1, 9))
    (single,) = over_seeds(noise, 1).estimates
    assert single.half == pytest.approx(student_quantile(8) * noise.std(ddof=1) / 3)
