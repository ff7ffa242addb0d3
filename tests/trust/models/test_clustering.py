"""Clustering against its rule, loop by loop, and cases worked by hand."""

from math import sqrt

import numpy as np
import pytest
from judged import (
    History,
    Trusts,
    assert_matches_with_experience,
    by_history,
    mean,
    play,
)
from model_cases import assert_matches, read

from roletrust_env.trust import make_trust_model
from roletrust_env.trust.models.personal.similarity import _connected


def slow(
    history: History,
    lam: float,
    initial: float,
    threshold: float,
    received: History | None = None,
) -> Trusts:
    """Judges know the services that they received, which are their ratings unless given."""
    received = history if received is None else received
    raters, providers = range(len(history[0])), range(len(history[0][0]))
    trust = [[initial for _ in providers] for _ in raters]
    found = []
    for now, current in enumerate(history, 1):
        past, seen = (
            [
                [[at[i][j] for at in rounds[:now] if at[i][j] is not None] for j in providers]
                for i in raters
            ]
            for rounds in (history, received)
        )

        def both(i: int, k: int, mine: list, past: list = past) -> list[int]:
            return [j for j in providers if mine[i][j] and past[k][j]]

        def linked(i: int, k: int, mine: list, past: list = past, both=both) -> bool:
            squares = [(mean(mine[i][j], -1) - mean(past[k][j], -1)) ** 2 for j in both(i, k, mine)]
            return sqrt(mean(squares, 99)) <= threshold

        clusters = []
        for i in raters:
            fresh = [k for k in raters if linked(i, k, seen)]
            cluster = {i, *fresh}
            while fresh:
                here = fresh.pop()
                new = [k for k in raters if k not in cluster and linked(here, k, past)]
                cluster.update(new)
                fresh += new
            clusters.append(cluster)
        for i in raters:
            known = [*current[:i], received[now - 1][i], *current[i + 1 :]]
            for j in providers:
                heard = [known[k][j] for k in clusters[i] if known[k][j] is not None]
                trust[i][j] = lam * mean(heard, trust[i][j]) + (1 - lam) * trust[i][j]
        credence = [
            [1.0 if k in clusters[i] else 0.0 if both(i, k, seen) else initial for k in raters]
            for i in raters
        ]
        tor = [mean([credence[i][k] for i in raters if i != k], 1.0) for k in raters]
        found.append((tor, [mean([trust[i][j] for i in raters], 0) for j in providers]))
    return found


@pytest.mark.parametrize(
    "parameters",
    [
        {"lam": 0.5, "initial": 0.5, "threshold": 0.3},
        {"lam": 0.7, "initial": 0.2, "threshold": 0.12},
    ],
)
def test_it_is_the_rule(parameters: dict[str, float]) -> None:
    model = make_trust_model("clustering", **parameters)
    assert_matches(model, by_history(slow, **parameters))
    assert_matches_with_experience(model, slow, **parameters)


def test_raters_at_the_threshold_are_linked() -> None:
    model = make_trust_model("clustering", threshold=0.5)
    assert read(model, play(model, [[0.25], [0.75]]))[0] == pytest.approx([1, 1])


def test_liars_are_a_cluster_of_their_own_by_hand() -> None:
    """Three rate 1 and two 0: an honest judge hears 1, a liar 0, and the liars are two of five
    judges."""
    model = make_trust_model("clustering", lam=0.5)
    tor, top = read(model, play(model, [[1], [1], [1], [0], [0]]))
    assert tor == pytest.approx([2 / 4, 2 / 4, 2 / 4, 1 / 4, 1 / 4])
    assert top == pytest.approx([0.5 * 3 / 5 + 0.5 * 0.5])


@pytest.mark.parametrize("length", [1, 2, 3, 4, 5, 9, 10, 17, 18])
def test_a_chain_is_one_cluster_however_long(length: int) -> None:
    links = np.eye(length + 1, k=1)
    links[-2:] = links[:, -1:] = 0  # the last is alone
    order = np.random.default_rng(length).permutation(length + 1)
    wanted = np.zeros((length + 1, length + 1))
    wanted[:length, :length] = wanted[length, length] = 1
    assert np.array_equal(_connected((links + links.T)[order][:, order]), wanted[order][:, order])
