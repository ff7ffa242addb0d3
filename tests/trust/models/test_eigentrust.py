"""EigenTrust against loops, against PageRank of another library, and by hand."""

from collections.abc import Iterator, Sequence

import networkx
import numpy as np
import pytest
from model_cases import Matrix, Vector, assert_matches, play, random_rounds, read, who_is_who
from walks import links, numbers, published, walk

from roletrust_env.trust import Ratings, make_trust_model
from roletrust_env.trust.model import start_model


def reference(
    rounds: Sequence[tuple[Matrix, Matrix]], peers: Matrix
) -> Iterator[tuple[Vector, Vector]]:
    n = numbers(peers)[2]
    scores = [[0.0 for _ in row] for row in peers]
    for ratings, mask in rounds:
        for i, row in enumerate(mask):
            for j, rated in enumerate(row):
                if rated:
                    scores[i][j] += ratings[i][j] - (1 - ratings[i][j])
        content = [[max(score, 0.0) for score in row] for row in scores]
        yield published(walk(links(content, peers), [1 / n] * n, a=0.5), peers)


def test_the_model_matches_its_reference() -> None:
    assert_matches(make_trust_model("eigentrust"), reference)


@pytest.mark.parametrize("shape", [(4, 3), (12, 9)], ids=str)
def test_it_is_the_pagerank_of_the_graph_of_contentment(shape: tuple[int, int]) -> None:
    rounds, peers = random_rounds(shape, 5), who_is_who(shape)
    scores = sum(np.where(mask, 2 * ratings - 1, 0) for ratings, mask in rounds)
    weights = np.array(links(np.maximum(scores, 0).tolist(), peers.tolist()))
    graph = networkx.from_numpy_array(weights, create_using=networkx.DiGraph)
    ranks = networkx.pagerank(graph, alpha=0.5, tol=1e-14, max_iter=1000)
    expected = published([ranks[k] for k in range(len(weights))], peers.tolist())
    model = make_trust_model("eigentrust")
    found = read(model, play(model, rounds, np.zeros(shape), peers))
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9)
    assert len(set(found[0].round(9))) > 1


def test_three_raters_of_three_good_providers_by_hand() -> None:
    """Three of six agents, the raters get R = 1/4 Q of the providers' Q by empty rows, and 1/4 by
    p: R = .4, Q = .6."""
    ratings = np.ones((3, 3))
    model = make_trust_model("eigentrust")
    state = model.update(model.start(ratings, ratings < 0), Ratings(ratings, ratings > 0))
    assert model.rater_trust(state) == pytest.approx([2 / 3] * 3)
    assert model.provider_trust(state) == pytest.approx([1] * 3)


def test_before_any_rating_all_are_alike_and_own_praise_counts_nothing() -> None:
    model, peers = make_trust_model("eigentrust"), np.eye(3, dtype=bool)
    state = model.start(np.zeros((3, 3)), peers)
    for _ in range(2):
        assert model.rater_trust(state) == pytest.approx([1] * 3)
        assert model.provider_trust(state) == pytest.approx([1] * 3)
        state = model.update(state, Ratings(np.ones((3, 3)), peers))


def test_what_rounding_leaves_is_no_trust() -> None:
    """Contentment of 0.6 - 0.4 - 0.2 is nothing, though in floating point a little above it."""
    model, mask = make_trust_model("eigentrust"), np.array([[True, False]])
    start = state = start_model(model, np.zeros((1, 2)), np.zeros((1, 2), bool))
    for rating in (0.8, 0.3, 0.4):
        state = model.update(state, Ratings(np.full((1, 2), rating), mask))
    assert 0 < state.scores[0, 0] < 1e-15
    assert model.provider_trust(state) == pytest.approx(model.provider_trust(start))


def test_if_every_rating_is_0_everybody_has_trust_1() -> None:
    """Trust is relative to the most trusted agent, and none is better than another."""
    for peers in (np.eye(3, dtype=bool), np.zeros((4, 3), bool)):
        model, nothing = make_trust_model("eigentrust"), np.zeros(peers.shape)
        state = start_model(model, nothing, peers)
        for _ in range(3):
            state = model.update(state, Ratings(nothing, ~peers))
        assert model.rater_trust(state) == pytest.approx([1] * len(peers))
        assert model.provider_trust(state) == pytest.approx([1] * 3)
