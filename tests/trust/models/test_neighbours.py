"""Models of neighbouring fields: against their formulas written loop by loop, on grids and on edges, and their laws."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from model_cases import Matrix, Vector, assert_close, assert_matches
from test_edges import Edges, grid_trust, ledger_trust, logs

from roletrust_env.testing.trust_models import (
    check_batch,
    check_kinds,
    check_masks,
    check_permutation,
    check_purity,
    check_torch,
)
from roletrust_env.trust import trust_models
from roletrust_env.trust.neighbours import NEIGHBOURS

EVERY = pytest.mark.parametrize("name", NEIGHBOURS)
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
            mean([w * (1 - (abs(bias[i]) if bias[i] * w > 0 else 0)) for i, k, w in parts if k == j]) for j in range(p)
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


SLOW = {"fairness-goodness": fairness, "bias-deserve": deserve, "two-way-mean": two_way}


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

    assert_matches(NEIGHBOURS[name](initial=0.3), reference, count=6)


def test_the_all_time_mean_forgets_nothing() -> None:
    def reference(rounds: Any, peers: Matrix) -> Any:
        for t in range(1, len(rounds) + 1):
            notes = [[f[i][j] for f, m in rounds[:t] for i in range(len(f)) if m[i][j]] for j in range(len(peers[0]))]
            yield [1.0] * len(peers), [mean(values) if values else 0.3 for values in notes]

    assert_matches(NEIGHBOURS["all-time-mean"](initial=0.3), reference)


@EVERY
def test_the_laws_of_all_models(name: str) -> None:
    model = NEIGHBOURS[name]()
    check_kinds(model, (2, 5, 6), np.float32)
    for check in (check_batch, check_masks, check_purity, check_torch):
        check(model, (3, 2, 4))
    check_permutation(model, 0)


@EVERY
@settings(max_examples=40)
@given(log=logs())
def test_edges_are_a_grid(name: str, log: tuple[tuple[int, int], list[Edges]]) -> None:
    shape, rounds = log
    for found, wanted in zip(
        ledger_trust(NEIGHBOURS[name](), shape, rounds), grid_trust(NEIGHBOURS[name](), shape, rounds), strict=True
    ):
        assert_close(found, wanted, 1e-11)


def test_suites_that_play_all_models_do_not_play_them() -> None:
    assert not set(NEIGHBOURS) & set(trust_models())
