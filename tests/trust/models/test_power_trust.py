"""PowerTrust against loops, against PageRank of another library, and by hand."""

from collections.abc import Iterator, Sequence
from functools import partial

import networkx
import numpy as np
import pytest
from model_cases import Matrix, Vector, assert_matches
from walks import links, numbers, published, walk

from roletrust_env.trust import Ratings, make_trust_model


def advance(heard: Vector, peers: Matrix, power_nodes: int) -> Vector:
    """What each agent gets of the advance."""
    _, providers, n = numbers(peers)
    last = sorted(heard, reverse=True)[:power_nodes][-1]
    powerful = [k for k, count in zip(providers, heard, strict=True) if count >= last]
    return [1 / len(powerful) if k in powerful else 0.0 for k in range(n)]


def reference(
    rounds: Sequence[tuple[Matrix, Matrix]], peers: Matrix, power_nodes: int
) -> Iterator[tuple[Vector, Vector]]:
    latest, heard = [[0.0 for _ in row] for row in peers], [0.0 for _ in peers[0]]
    for ratings, mask in rounds:
        for i, row in enumerate(mask):
            for j, rated in enumerate(row):
                if rated and not peers[i][j]:
                    latest[i][j] = ratings[i][j]
                    heard[j] += 1
        yield published(
            walk(links(latest, peers), advance(heard, peers, power_nodes), a=0.15), peers
        )


@pytest.mark.parametrize("power_nodes", [1, 3])
def test_the_model_matches_its_reference(power_nodes: int) -> None:
    model = make_trust_model("power-trust", power_nodes=power_nodes)
    assert_matches(model, partial(reference, power_nodes=power_nodes), count=8)


def test_it_is_a_pagerank() -> None:
    """Power nodes are where the walk begins anew."""
    rng, peers = np.random.default_rng(0), np.eye(12, 9, dtype=bool)
    ratings, mask = rng.random((12, 9)), ~peers & (rng.random((12, 9)) < 0.6)
    start = advance(mask.sum(axis=0).tolist(), peers.tolist(), 2)
    weights = np.array(links(np.where(mask, ratings, 0).tolist(), peers.tolist()))
    graph = networkx.from_numpy_array(weights, create_using=networkx.DiGraph)
    anybody = dict.fromkeys(graph, 1.0)
    ranks = networkx.pagerank(
        graph, 0.85, dict(enumerate(start)), dangling=anybody, tol=1e-14, max_iter=1000
    )
    expected = published([ranks[k] for k in graph], peers.tolist())
    model = make_trust_model("power-trust", power_nodes=2)
    state = model.update(model.start(ratings, peers), Ratings(ratings, mask))
    np.testing.assert_allclose(model.rater_trust(state), expected[0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(model.provider_trust(state), expected[1], rtol=0, atol=1e-9)


def test_who_is_rated_most_has_an_advance_by_hand() -> None:
    """Two raters, two providers: v of the raters is x each, and what they follow, 2 x, goes 3 : 1
    to the first.

    Of four agents, those that rate nobody send on 1 - 2 x, a quarter to each, so x = .85 (1 - 2 x)
    / 4 = .85 / 5.7.
    """
    ratings, mask = np.array([[1.0, 1.0], [1.0, 0.0]]), np.array([[True, True], [True, False]])
    model = make_trust_model("power-trust")
    state = model.update(model.start(ratings, ratings < 0), Ratings(ratings, mask))
    x = 0.85 / 5.7
    first, second = x + 0.85 * 1.5 * x + 0.15, x + 0.85 * 0.5 * x
    assert 2 * x + first + second == pytest.approx(1)
    assert model.rater_trust(state) == pytest.approx([x / first] * 2)
    assert model.provider_trust(state) == pytest.approx([1, second / first])


def test_if_every_rating_is_0_providers_have_trust_1_and_so_has_every_peer() -> None:
    """Trust is relative to the most trusted agent, and none is better than another."""
    for peers, raters in (
        (np.eye(3, dtype=bool), [1] * 3),
        (np.zeros((4, 3), bool), [0.85 / 1.2] * 4),
    ):
        model, nothing = make_trust_model("power-trust"), np.zeros(peers.shape)
        state = model.start(nothing, peers)
        for _ in range(3):
            state = model.update(state, Ratings(nothing, ~peers))
        assert model.rater_trust(state) == pytest.approx(raters)
        assert model.provider_trust(state) == pytest.approx([1] * 3)
