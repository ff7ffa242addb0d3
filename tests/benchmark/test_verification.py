"""Tolerance of a verification, and sources that may differ."""

import pytest

from roletrust_env.benchmark.sources import Source
from roletrust_env.benchmark.submission import Score
from roletrust_env.benchmark.verification import _check_sources, _within


@pytest.mark.parametrize(("difference", "within"), [(0.0141, True), (0.0143, False), (0.04, False), (-0.0143, False)])
def test_two_means_may_differ_by_the_noise_of_two_samples(difference: float, within: bool) -> None:
    own = Score(mean=0.5, half_95=0.01)
    assert _within(Score(mean=0.5 + difference, half_95=None), own) is within


@pytest.mark.parametrize(
    ("package", "version", "ok"),
    [("mine", "2", True), ("mine", "1", False), ("", "2", False), ("other", "2", False)],
)
def test_a_source_may_differ_only_in_another_version_of_the_same_package(package: str, version: str, ok: bool) -> None:
    own = Source(made_by="mine.Model", package="mine" if package else "", version="1", sha256="0" * 64)
    claimed = Source(made_by="mine.Model", package=package, version=version, sha256="1" * 64)
    checks = _check_sources("model", {"m": claimed}, {"m": own})
    assert all(check.ok for check in checks) is ok
