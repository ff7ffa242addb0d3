"""How later ratings are forecast and covered, on the synthetic log."""

from pathlib import Path

import numpy as np
import pytest

from roletrust_env.logs import read, write_log
from studies.evidence import later_ratings, lower_end


def test_the_lower_end_is_where_wilson_has_it() -> None:
    """The root p of (t - p)^2 n = z^2 p (1 - p) below t, with z = 1.96."""
    trust, raters = np.array([0.0, 0.5, 0.9, 1.0]), np.array([3.0, 1.0, 40.0, 7.0])
    for p, t, n in zip(lower_end(trust, raters).tolist(), trust, raters, strict=True):
        assert (t - p) ** 2 * n == pytest.approx(1.959964**2 * p * (1 - p), abs=1e-6)
        assert p <= t


def test_the_second_half_of_a_log_is_compared_with_the_first(tmp_path: Path) -> None:
    write_log(tmp_path / "log.csv.gz")
    found = later_ratings(
        read(tmp_path / "log.csv.gz", scale=(-10, 10), same_agents=True), "leave-one-out", 0
    )
    orders = found["orders"]
    assert 0.5 < orders["trust"].value < 1
    difference = orders["trust"].value - orders["low"].value
    assert orders["trust - low"].value == pytest.approx(difference)
    many, share = found["covered"]["all"]
    parts = [part for name, part in found["covered"].items() if name != "all"]
    assert many == sum(part[0] for part in parts)
    assert share == pytest.approx(sum(n * one for n, one in parts) / many)
