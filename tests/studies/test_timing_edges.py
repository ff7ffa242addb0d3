"""Contestants with ratings as edges: all compute the same."""

import numpy as np
import pytest

from roletrust_env.trust import make_trust_model
from studies.speed_edges import Lists, edge_targets
from studies.timing import edges as timing
from studies.timing.contestants import Contestant, Timing

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("ratings", [300, 3000])
def test_the_sums_by_hand_are_those_of_the_model(ratings: int) -> None:
    edges = timing.Edges.of(ratings, 0)
    assert 0.5 * ratings < len(edges.raters) <= ratings
    tor, top, last = timing.plain(edges)()
    state = timing.on_edges(edges, make_trust_model("role-trust"))()
    np.testing.assert_allclose(state.tor, tor, atol=1e-12)
    np.testing.assert_allclose(state.top, top, atol=1e-12)
    assert np.array_equal(state.last, last)


def test_a_stream_goes_on() -> None:
    stream = timing.stream(20, 30, 0)
    for _ in range(100):
        stream.step()
    assert (stream.ratings, stream.agents) == (20, 60)


def test_promises_are_about_the_sizes_they_name() -> None:
    def taken(name: str, ratings: int, seconds: float) -> Timing:
        return Timing(Contestant(name, 1, 1, lambda: None, ratings), (seconds,))

    rounds = {
        1_000_000: [taken(timing.EDGES, 1_000_000, 0.1)],
        10_000_000: [taken(timing.EDGES, 10_000_000, 0.5)],
    }
    lists = Lists(
        rounds, {(10_000_000, timing.EDGES): 2 * 10**9}, [taken("stream", 10_000, 0.01)], taken("copy", 10, 1)
    )
    found = [target.found.median if target.found else None for target in edge_targets(lists)]
    assert found == pytest.approx([10, 2, 1])
    assert [target.ok for target in edge_targets(lists)] == [True, True, False]
    assert [target.found for target in edge_targets(lists._replace(rounds={}, memory={}, streams=[]))] == [None] * 3
