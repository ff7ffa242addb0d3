"""Tolerance of a verification, and sources that may differ."""

import numpy as np

from roletrust_env.benchmarking.schema import AttackResult, CellResult
from roletrust_env.benchmarking.sources import Source
from roletrust_env.benchmarking.submission import CellClaim, ClaimedScore, make_claim
from roletrust_env.benchmarking.suite import Cell
from roletrust_env.benchmarking.verification import (
    _check_lead,
    _check_sources,
    check_bias,
    check_cell,
    check_fresh,
    within_noise,
)


def test_two_means_may_differ_by_the_noise_of_two_samples() -> None:
    own = ClaimedScore(mean=0.5, half_95=0.01)
    for difference, agrees in ((0.0141, True), (0.0143, False), (0.04, False), (-0.0143, False)):
        assert within_noise(ClaimedScore(mean=0.5 + difference, half_95=None), own) is agrees
    exact = ClaimedScore(mean=0.5, half_95=0.0)  # another processor rounds otherwise
    assert within_noise(ClaimedScore(mean=0.5 + 1e-12, half_95=0.0), exact)


def test_games_that_are_all_alike_may_be_rounded_otherwise() -> None:
    other = {name: [0.5] * 40 for name in ("published", "blind", "damage", "false_alarms", "auc")}
    alike, rounded = (
        [CellResult((AttackResult("a", "", 0, *[{"utility": [mean] * 40, **other}] * 2),), 0.0)]
        * 10
        for mean in (0.75, 0.75 + 1e-9)
    )
    for claims, here in ((alike, alike), (rounded, alike)):
        assert all(check.ok for check in check_bias(claimed(claims), here))


def test_a_wide_interval_of_a_claim_allows_no_more_than_the_own_one() -> None:
    claims = claimed(run(0, cells=2, raised=0.2))
    assert not all(check.ok for check in check_fresh(claims, run(1, cells=2)))
    for claim in claims:
        for one in claim.attacks:
            object.__setattr__(one.measured.utility, "half_95", 9.0)
    assert not all(check.ok for check in check_fresh(claims, run(1, cells=2)))


def test_a_source_may_differ_only_in_another_version_of_the_same_package() -> None:
    for package, version, ok in (
        ("mine", "2", True),
        ("mine", "1", False),
        ("", "2", False),
        ("other", "2", False),
    ):
        own = Source(
            made_by="mine.Model", package="mine" if package else "", version="1", sha256="0" * 64
        )
        claimed = Source(made_by="mine.Model", package=package, version=version, sha256="1" * 64)
        checks = _check_sources("model", {"m": claimed}, {"m": own})
        assert all(check.ok for check in checks) is ok


def run(
    seed: int, cells: int = 10, attacks: int = 3, raised: float = 0.0, noise: float = 0.0
) -> list[CellResult]:
    """Cells with the same means in every run, games of its seed, and noise that is never the
    same."""
    rng, other_rng = np.random.default_rng(seed), np.random.default_rng([seed, 1])
    results = []
    for cell in range(cells):
        rows = []
        for attack in range(attacks):
            chosen, measured = (
                0.8 + 0.01 * attack + 0.01 * cell + 0.05 * rng.standard_normal((2, 40)) + raised
            )
            chosen, measured = (
                part + noise * other_rng.standard_normal(40) for part in (chosen, measured)
            )
            other = {
                name: [0.5] * 40 for name in ("published", "blind", "damage", "false_alarms", "auc")
            }
            halves = ({"utility": half.tolist(), **other} for half in (chosen, measured))
            rows.append(AttackResult(str(attack), "", 0, *halves))
        results.append(CellResult(tuple(rows), 0.0))
    return results


def claimed(results: list[CellResult]) -> list[CellClaim]:
    """What a submission says of them."""
    return [
        make_claim(Cell("m", "s", "t", 0.3, "scripted", k), result)
        for k, result in enumerate(results)
    ]


def test_honest_runs_are_accepted_however_far_rounding_leads_them() -> None:
    for apart in (True, False):
        pairs = [
            (run(2 * k), run(2 * k + 1) if apart else run(2 * k, noise=1e-9)) for k in range(5)
        ]
        assert all(check.ok for mine, here in pairs for check in check_bias(claimed(mine), here))


def test_an_attack_treats_raters_as_the_claim_says_also_on_another_processor() -> None:
    (mine,) = run(0, cells=1)
    rows = tuple(row._replace(treats=True) for row in mine.rows)
    (claim,) = claimed([mine._replace(rows=rows)])
    assert check_cell(claim, mine._replace(rows=rows), same=False).ok
    found = check_cell(claim, mine, same=False)
    assert (found.ok, found.message) == (False, "0: treats raters alike only here")


def test_claims_that_are_a_little_too_high_everywhere_are_not() -> None:
    half = 1.96 * 0.05 / 40**0.5
    for k in range(3):
        far, *_ = check_bias(claimed(run(2 * k, raised=1.3 * half)), run(2 * k + 1))
        near = check_bias(claimed(run(2 * k, 15, raised=0.4 * half)), run(2 * k, 15, noise=0.001))
        assert [far.ok, *(check.ok for check in near)] == [False, True, True, False, False, True]


def test_a_choice_of_the_worst_case_that_is_bent_is_found() -> None:
    """The attack that does least harm in the games that measure is called the worst in those that
    choose."""
    bent = claimed(run(0, cells=20))
    for claim in bent:
        luckiest = max(claim.attacks, key=lambda one: one.measured.utility.mean)
        object.__setattr__(luckiest, "chosen", 0.5)
    assert not all(check.ok for check in check_bias(bent, run(0, cells=20, noise=0.01)))


def test_a_lead_alike_in_eleven_cells_may_be_chance_and_in_twelve_not() -> None:
    """The limit is 3.42, that of a normal variable at the level 0.001 / 3.22; the level 0.001 has
    3.09."""
    assert [_check_lead("it", {"m": [0.5] * cells}).ok for cells in (11, 12)] == [True, False]


def test_a_blind_choice_that_is_made_worse_is_found() -> None:
    worse = claimed(run(0, cells=20))
    for claim in worse:
        for one in claim.attacks:
            object.__setattr__(one.measured.blind, "mean", one.measured.blind.mean - 0.02)
    failed = [
        check.subject for check in check_bias(worse, run(0, cells=20, noise=0.01)) if not check.ok
    ]
    assert failed == ["bias of the worst skill"]


def test_a_model_that_is_raised_is_not_lost_among_many_honest_ones() -> None:
    def claims(raised: float, model: str, seed: int) -> list[CellClaim]:
        return [
            claim.model_copy(update={"model": model}) for claim in claimed(run(seed, raised=raised))
        ]

    honest = [(claims(0.0, f"m{k}", 2 * k), run(2 * k + 1)) for k in range(12)]
    raised = (claims(0.02, "raised", 100), run(101))
    for pairs, ok in ((honest, True), ([*honest, raised], False)):
        checks = check_bias(
            [one for mine, _ in pairs for one in mine], [one for _, here in pairs for one in here]
        )
        assert all(check.ok for check in checks) is ok
    assert "claims for raised exceed" in checks[0].message


def test_claims_that_are_too_low_harm_nobody() -> None:
    assert all(check.ok for check in check_bias(claimed(run(0, raised=-0.1)), run(1)))
