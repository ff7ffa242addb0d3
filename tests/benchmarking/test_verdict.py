"""Tiers, the probability of a rank and intervals over seeds: by hand, and against many reruns of
drawn leaderboards."""

import numpy as np
import numpy.typing as npt
import pytest

from roletrust_env.benchmarking import verdict as verdict_file
from roletrust_env.benchmarking.verdict import told_apart, verdict
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


@pytest.fixture(autouse=True)
def _fewer_resamples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verdict_file, "_RESAMPLES", 1500)


@pytest.mark.parametrize("seeds", [1, 3])
def test_what_is_said_of_ranks_and_scores_is_seen_in_reruns(seeds: int) -> None:
    random = np.random.default_rng(10 + seeds)
    said, seen, covered, wrong = [], [], [], []
    for k in range(240):
        true, search = random.normal(0, (1, 2, 6)[k % 3], 10), searches(10, seeds, random)
        first, second = (run(true, seeds, random, search) for _ in range(2))
        order = best_first(first)
        tiers, holds = verdict(first[order])
        said += holds
        seen += (best_first(second) == order).tolist()
        estimates = over_seeds(first, 10).estimates
        covered += [
            abs(one.mean - real) <= one.half for one, real in zip(estimates, true, strict=True)
        ]
        leaders = [tiers.index(tier) for tier in set(tiers)]
        sorted_true = true[order]
        wrong.append(
            any(
                sorted_true[at] < sorted_true[np.array(tiers) > tiers[at]].max(initial=-99)
                for at in leaders
            )
        )
    shares, rights = np.array(said), np.array(seen)
    for low in (0.0, 0.2, 0.4, 0.6, 0.8):
        part = (shares >= low) & (shares < low + 0.2 + (low == 0.8))
        if part.mean() > 0.05:
            assert shares[part].mean() == pytest.approx(rights[part].mean(), abs=0.06)
    assert 0.92 < np.mean(covered) < 0.98
    assert np.mean(wrong) < 0.05  # a model of a lower tier is better than the first one of a tier


@pytest.mark.parametrize(("groups", "seeds"), [([0.0], 1), ([0.0], 3), ([0.0, 100.0], 2)])
def test_models_with_equal_scores_are_seldom_in_different_tiers(
    groups: list[float], seeds: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(verdict_file, "_RESAMPLES", 4)  # tiers need none
    random, separated = np.random.default_rng(seeds), []
    for _ in range(200):
        true = np.repeat(groups, 12 // len(groups))
        scores = run(true, seeds, random, searches(12, seeds, random))
        order = best_first(scores)
        tiers = verdict(scores[order]).tiers
        pairs = {(tier, float(real)) for tier, real in zip(tiers, true[order], strict=True)}
        separated.append(len(pairs) > len(groups))
        assert len({tier for tier, _ in pairs}) >= len(groups)
    assert np.mean(separated) < 0.08  # 5%, with the noise of this test


def test_the_share_of_pairs_that_are_told_apart() -> None:
    random = np.random.default_rng(5)
    equal = [told_apart(random.normal(size=(6, 1, GAMES))) for _ in range(100)]
    assert 0.03 < np.mean(equal) < 0.07  # the error of the test
    scores = np.array([0.0, 0.0, 9.0])[:, None, None] + random.normal(size=(1, 1, GAMES))
    scores[1] += 1e-3 * random.normal(size=(1, GAMES))
    assert told_apart(scores) == pytest.approx(2 / 3)
    assert np.isnan(told_apart(scores[:1]))


def test_a_tier_reaches_to_the_last_model_that_is_not_told_apart() -> None:
    games = np.array([-1.0, 1.0] * 8)
    precise = [3.0 + 0.01 * games, 2.0 + 0.01 * np.roll(games, 4), 0.0 + 0.0 * games]
    assert verdict(np.stack(precise)[:, None]).tiers == [1, 2, 3]
    noisy = [precise[0], precise[1], 1.0 + 40.0 * np.repeat([-1.0, 1.0], 8), precise[2]]
    assert verdict(np.stack(noisy)[:, None]).tiers == [1, 1, 1, 2]


def test_equal_models_and_unknown_noise_make_one_tier() -> None:
    scores = np.random.default_rng(0).random((1, 1, 8)) + np.zeros((3, 1, 1))
    assert verdict(scores).tiers == [1, 1, 1]
    assert verdict(scores).holds == [1, 1, 1]
    found = verdict(np.array([[[0.9]], [[0.1]]]))  # of a single game
    assert found.tiers == [1, 1]
    assert np.isnan(found.holds).all()
    assert verdict(np.empty((0, 1, 4))) == ([], [])
    assert verdict(scores[:1]) == ([1], [1.0])


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


@pytest.mark.parametrize("seeds", [1, 3])
def test_a_model_far_below_does_not_make_the_ranks_of_the_others_sure(seeds: int) -> None:
    random, said, seen = np.random.default_rng(seeds), [], []
    for _ in range(150):
        true, search = np.array([*random.normal(0, 1, 5), -100.0]), searches(6, seeds, random)
        first, second = (run(true, seeds, random, search) for _ in range(2))
        order = best_first(first)
        said += verdict(first[order]).holds[:-1]
        seen += (best_first(second) == order)[:-1].tolist()
    assert np.mean(said) == pytest.approx(np.mean(seen), abs=0.04)
