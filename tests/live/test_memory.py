"""The memory of a manager on real middleware, for a minute. Run by `make test-soak`."""

import pytest
from loopback import own_domain

from studies.live_load import measure_load

pytestmark = pytest.mark.soak
__all__ = ["own_domain"]


def test_a_manager_does_not_grow(tmp_path):
    """Ten raters and ten providers; the growth is that of the median from the first half minute to the second."""
    load = measure_load("role-trust", 10, 60.0, 4.0, tmp_path)
    print(load)
    assert load.rounds > 200
    assert load.grown_mb < 0.5
