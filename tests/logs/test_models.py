"""Models of neighbouring fields: against their formulas written loop by loop, on grids and on
edges, and their laws."""

import math
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from model_cases import Matrix, Vector, assert_close, assert_matches
from test_edges import Edges, grid_trust, logs, run_trust

from roletrust_env.logs.models import LOG_MODELS
from roletrust_env.testing.trust_models import (
    check_batch,
    check_kinds,
    check_permutation,
    check_purity,
    check_silence,
    check_torch,
)
from roletrust_env.trust import Ratings, trust_models

EVERY = pytest.mark.parametrize("name", LOG_MODELS)
Pairs = list[tuple[int, int, float]]


def pair_means(rounds: Any) -> Pairs:
    ratings: dict[tuple[int, int], list[float]] = {}
    for f, m in rounds:
        for i, row in enumerate(m):
            for j, met in enumerate(row):
                if met:
                    ratings.setdefault((i, j), []).append(f[i][j])
    return [(i, j, sum(values) / len(values)) for (i, j), values in ratings.items()]


def mean(values: list[float]) -> float:
    return sum(values) / len(values) if values else 0.0


def fairness(pairs: Pairs, s: int, p: int) -> tuple[Vector, Vector]:
    f, g = [1.0] * s, [0.0] * p
    for _ in range(200):
        g = [mean([f[i] * (2 * x - 1) for i, k, x in pairs if k == j]) for j in range(p)]
        f = [1 - mean([abs(2 * x - 1 - g[j]) / 2 for k, j, x in pairs if k == i]) for i in range(s)]
    return f, [(value + 1) / 2 for value in g]


def deserve(pairs: Pairs, s: int, p: int) -> tuple[Vector, Vector]:
    bias, des = [0.0] * s, [0.0] * p
    for _ in range(200):
        parts = [(i, j, 2 * x - 1) for i, j, x in pairs]
        des = [
            mean(
                [w * (1 - (abs(bias[i]) if bias[i] * w > 0 else 0)) for i, k, w in parts if k == j]
            )
            for j in range(p)
        ]
        bias = [mean([(w - des[j]) / 2 for k, j, w in parts if k == i]) for i in range(s)]
    return [1 - abs(b) for b in bias], [(value + 1) / 2 for value in des]


def two_way(pairs: Pairs, s: int, p: int) -> tuple[Vector, Vector]:
    generous, level = [0.0] * s, [0.0] * p
    for _ in range(60):
        level = [mean([x - generous[i] for i, k, x in pairs if k == j]) for j in range(p)]
        rest = [[x - level[j] for k, j, x in pairs if k == i] for i in range(s)]
        generous = [sum(values) / (len(values) + 1) for values in rest]
    return [1 - abs(value) for value in generous], [min(max(value, 0), 1) for value in level]


def rev2(pairs: Pairs, s: int, p: int) -> tuple[Vector, Vector]:
    f, g, parts = [1.0] * s, [1.0] * p, [(i, j, 2 * x - 1) for i, j, x in pairs]
    raters, providers = {i for i, _, _ in pairs}, {j for _, j, _ in pairs}
    for _ in range(60):
        mean_f, mean_g = mean([f[i] for i in raters]), mean([g[j] for j in providers])
        votes = [
            [(f[i] + 1 - abs(w - g[j]) / 2) / 2 * w for i, k, w in parts if k == j]
            for j in range(p)
        ]
        g = [(2 * mean_g + sum(some)) / (2 + len(some)) for some in votes]
        sure = [
            [(f[i] + 1 - abs(w - g[j]) / 2) / 2 for k, j, w in parts if k == i] for i in range(s)
        ]
        f = [(0.5 * mean_f + sum(some)) / (0.5 + len(some)) for some in sure]
    return f, [(value + 1) / 2 for value in g]


def vectors(pairs: Pairs, s: int, p: int, radius: float | None) -> tuple[Vector, Vector]:
    """The geometric median, or with a radius centred clipping."""
    c = [0.5] * p

    def distance(i: int) -> float:
        return math.sqrt(sum((x - c[j]) ** 2 for k, j, x in pairs if k == i))

    for _ in range(60):
        weight = [
            min(1, radius / max(distance(i), 1e-9)) if radius else 1 / max(distance(i), 1e-4)
            for i in range(s)
        ]
        pulls = [[(weight[i], x - c[j]) for i, k, x in pairs if k == j] for j in range(p)]
        sizes = [len(some) if radius else sum(w for w, _ in some) for some in pulls]
        c = [
            c[j] + sum(w * gap for w, gap in some) / max(sizes[j], 1e-9)
            for j, some in enumerate(pulls)
        ]
    given = [sum(k == i for k, _, _ in pairs) for i in range(s)]
    return [1 - distance(i) / math.sqrt(max(given[i], 1)) for i in range(s)], c


SLOW = {
    "fairness-goodness": fairness,
    "bias-deserve": deserve,
    "two-way-mean": two_way,
    "rev2": rev2,
}
SLOW |= {
    name: partial(vectors, radius=one)
    for name, one in (("geometric-median", None), ("centred-clipping", 0.4))
}
OTHERS: dict[str, Any] = {"rev2": {"alpha": 0.5, "beta": 2.0}, "centred-clipping": {"radius": 0.4}}


@pytest.mark.parametrize("name", SLOW)
def test_it_computes_its_formula(name: str) -> None:
    def reference(rounds: Any, peers: Matrix) -> Any:
        for t in range(1, len(rounds) + 1):
            s, p = len(peers), len(peers[0])
            pairs = pair_means(rounds[:t])
            tor, top = SLOW[name](pairs, s, p)
            raters, providers = {i for i, _, _ in pairs}, {j for _, j, _ in pairs}
            yield (
                [trust if i in raters else 0.3 for i, trust in enumerate(tor)],
                [trust if j in providers else 0.3 for j, trust in enumerate(top)],
            )

    assert_matches(LOG_MODELS[name](initial=0.3, **OTHERS.get(name, {})), reference, count=6)


def test_the_all_time_mean_forgets_nothing() -> None:
    def reference(rounds: Any, peers: Matrix) -> Any:
        for t in range(1, len(rounds) + 1):
            notes = [
                [f[i][j] for f, m in rounds[:t] for i in range(len(f)) if m[i][j]]
                for j in range(len(peers[0]))
            ]
            yield [1.0] * len(peers), [mean(values) if values else 0.3 for values in notes]

    assert_matches(LOG_MODELS["all-time-mean"](initial=0.3), reference)


def settled(name: str, ratings: Any, mask: Any, **parameters: Any) -> tuple[Any, Any]:
    model = LOG_MODELS[name](**parameters)
    state = model.update(model.start(ratings), Ratings(ratings, mask))
    return model.rater_trust(state), model.provider_trust(state)


@pytest.mark.parametrize("seed", range(4))
def test_no_other_point_is_nearer_to_the_vectors_than_their_geometric_median(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ratings, mask = rng.random((7, 4)), rng.random((7, 4)) < 0.7
    mask[0] = True

    def away(centre: Any) -> float:
        return float(np.sqrt((mask * (ratings - centre) ** 2).sum(1)).sum())

    centre = settled("geometric-median", ratings, mask)[1]
    assert all(away(centre) < away(centre + rng.normal(0, 0.02, 4)) for _ in range(200))
    alone = settled("geometric-median", ratings[:, :1], np.ones((7, 1), bool))[1]
    assert alone == pytest.approx(np.median(ratings[:, 0]), abs=1e-3)


def test_liars_move_a_robust_centre_less_than_a_mean_and_are_found() -> None:
    rng = np.random.default_rng(0)
    quality = rng.random(6)
    ratings = np.clip(quality + rng.normal(0, 0.05, (10, 6)), 0, 1)
    ratings[:3] = quality < 0.5
    mask = np.ones((10, 6), bool)
    apart = {name: abs(settled(name, ratings, mask)[1] - quality).max() for name in LOG_MODELS}
    assert apart["geometric-median"] < apart["centred-clipping"] < apart["all-time-mean"]
    for name in ("rev2", "geometric-median", "centred-clipping"):
        tor = settled(name, ratings, mask)[0]
        assert tor[:3].max() < tor[3:].min()


def test_a_wide_radius_is_the_mean_and_rev2_without_pull_is_between() -> None:
    rng = np.random.default_rng(1)
    ratings, mask = rng.random((5, 4)), np.ones((5, 4), bool)
    assert settled("centred-clipping", ratings, mask, radius=3.0)[1] == pytest.approx(
        ratings.mean(0)
    )
    pulled = settled("rev2", ratings, mask, alpha=1e6, beta=1e6)
    assert np.ptp(pulled[0]) < 1e-5 > np.ptp(pulled[1])
    agreed = settled("rev2", 0 * ratings + 1, mask)
    assert agreed[0] == pytest.approx(1)
    assert agreed[1] == pytest.approx(1)


@EVERY
def test_the_laws_of_all_models(name: str) -> None:
    model = LOG_MODELS[name]()
    check_kinds(model, (2, 5, 6), np.float32)
    for check in (check_batch, check_silence, check_purity, check_torch):
        check(model, (3, 2, 4))
    check_permutation(model, 0)


@given(log=logs())
def test_edges_are_a_grid(log: tuple[tuple[int, int], list[Edges]]) -> None:
    shape, rounds = log
    for name, model in LOG_MODELS.items():
        found, wanted = run_trust(model(), shape, rounds), grid_trust(model(), shape, rounds)
        for one, other in zip(found, wanted, strict=True):
            assert_close(one, other, 1e-11, name)


def test_suites_that_play_all_models_do_not_play_them() -> None:
    assert not set(LOG_MODELS) & set(trust_models())
