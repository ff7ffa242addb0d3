"""Tolerance of a verification, and sources that may differ."""

import numpy as np

from roletrust_env.benchmarking.schema import AttackResult, CellResult
from roletrust_env.benchmarking.sources import Source
from roletrust_env.benchmarking.submission import CellClaim, ClaimedScore, make_claim
from roletrust_env.benchmarking.suite import Cell
from roletrust_env.benchmarking.verification import _check_sources, check_bias, within


def test_two_means_may_differ_by_the_noise_of_two_samples() -> None:
    own = ClaimedScore(mean=0.5, half_95=0.01)
    for difference, agrees in ((0.0141, True), (0.0143, False), (0.04, False), (-0.0143, False)):
        assert within(ClaimedScore(mean=0.5 + difference, half_95=None), own) is agrees


def test_a_source_may_differ_only_in_another_version_of_the_same_package() -> None:
    for package, version, ok in (("mine", "2", True), ("mine", "1", False), ("", "2", False), ("other", "2", False)):
        own = Source(made_by="mine.Model", package="mine" if package else "", version="1", sha256="0" * 64)
        claimed = Source(made_by="mine.Model", package=package, version=version, sha256="1" * 64)
        checks = _check_sources("model", {"m": claimed}, {"m": own})
        assert all(check.ok for check in checks) is ok


def run(seed: int, cells: int = 10, attacks: int = 3, raised: float = 0.0) -> list[CellResult]:
    """Cells with the same means in every run, and noise of its own."""
    rng = np.random.default_rng(seed)
    results = []
    for cell in range(cells):
        rows = []
        for attack in range(attacks):
            chosen, measured = 0.8 + 0.01 * attack + 0.01 * cell + 0.05 * rng.standard_normal((2, 40)) + raised
            other = {name: [0.5] * 40 for name in ("published", "blind", "damage", "false_alarms", "auc")}
            halves = ({"utility": half.tolist(), **other} for half in (chosen, measured))
            rows.append(AttackResult(str(attack), "", 0, *halves))
        results.append(CellResult(tuple(rows), 0.0))
    return results


def claimed(results: list[CellResult]) -> list[CellClaim]:
    """What a submission says of them."""
    return [make_claim(Cell("m", "s", "t", 0.3, "scripted", k), result) for k, result in enumerate(results)]


def test_honest_runs_with_noise_of_their_own_are_accepted() -> None:
    accepted = [all(check.ok for check in check_bias(claimed(run(2 * k)), run(2 * k + 1))) for k in range(10)]
    assert all(accepted)


def test_claims_that_are_a_little_too_high_everywhere_are_not() -> None:
    half = 1.96 * 0.05 / 40**0.5
    found = [check_bias(claimed(run(2 * k, raised=1.3 * half)), run(2 * k + 1)) for k in range(10)]
    assert not any(check.ok for checks in found for check in checks)


def test_a_model_that_is_raised_is_not_lost_among_many_honest_ones() -> None:
    def claims(raised: float, model: str, seed: int) -> list[CellClaim]:
        return [claim.model_copy(update={"model": model}) for claim in claimed(run(seed, raised=raised))]

    honest = [(claims(0.0, f"m{k}", 2 * k), run(2 * k + 1)) for k in range(12)]
    raised = (claims(0.02, "raised", 100), run(101))
    for pairs, ok in ((honest, True), ([*honest, raised], False)):
        checks = check_bias([one for mine, _ in pairs for one in mine], [one for _, here in pairs for one in here])
        assert all(check.ok for check in checks) is ok
    assert "claims for raised exceed" in checks[0].message


def test_claims_that_are_too_low_harm_nobody() -> None:
    assert all(check.ok for check in check_bias(claimed(run(0, raised=-0.1)), run(1)))
