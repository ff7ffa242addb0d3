"""The memory of a manager on real middleware, for a minute. Run by `make test-soak`."""

import time
from statistics import median

import pytest
from loopback import team
from process_load import memory_mb

pytestmark = pytest.mark.soak
__all__ = ["team"]


def test_a_manager_does_not_grow(team):
    """The growth is that of the median from the first half minute to the second."""
    taken, before = [], len(team.heard)
    for _ in range(120):
        time.sleep(0.5)
        taken.append(memory_mb(team.manager.pid))
    grown = median(taken[60:]) - median(taken[:60])
    print(f"{len(team.heard) - before} rounds: {taken[-1]:.0f} MB, grown by {grown:.2f} MB")
    assert len(team.heard) - before > 200
    assert grown < 0.1
