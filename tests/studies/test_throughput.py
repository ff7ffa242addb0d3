"""Scripted cells play nearly as fast as the bare game does."""

import pytest

from roletrust_env.benchmarking.suite_files import load_suite
from studies.timing.throughput import throughput

pytestmark = pytest.mark.slow


@pytest.mark.slow
def test_scripted_cells_play_at_half_the_speed_of_the_bare_game():
    """Both in the same run, in seconds of the processor; the least that was measured on a busy machine is 0.57."""
    quick = load_suite("quick")
    suite = quick.model_copy(update={"tracks": {name: quick.tracks[name] for name in ("raters", "identities")}})
    found = list(throughput(suite, turns=5))
    shares = [one.cell / one.game for one in found]
    assert len(shares) == 4
    assert sum(shares) / len(shares) >= 0.5, shares
