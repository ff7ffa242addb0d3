"""Whether searches converged, by hand."""

import numpy as np
import pytest
from small_suites import small
from test_leaderboard import TRACKS, row

from roletrust_env.benchmarking.caveats import caveats
from roletrust_env.benchmarking.conditions import Convergence
from roletrust_env.benchmarking.schema import AttackResult, CellResult
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import Cell
from roletrust_env.benchmarking.worst_case import attack_scores

SUITE = small(
    models=["mean"], methods=["scripted", "CMA-ES"], tracks=TRACKS, seeds=[0, 1], score="skill"
)


def searched(seed: int, utility: float, late: float) -> StoredCell:
    found: AttackResult = row("CMA-ES", [0.5] * 2, [0.5] * 2)
    found.chosen["blind"] = [0.1] * 2
    found = found._replace(
        progress=((100, 0.2), (200, 0.2 + late)), common=([utility] * 4, [0.5] * 4)
    )
    return StoredCell(
        Cell("mean", "market", "raters", 0.5, "CMA-ES", seed), CellResult((found,), 1.0)
    )


def scripted(seed: int) -> StoredCell:
    found = row("lies", [0.6] * 2, [0.6] * 2)
    found.chosen["blind"] = [0.1] * 2
    return StoredCell(
        Cell("mean", "market", "raters", 0.5, "scripted", seed), CellResult((found,), 1.0)
    )


@pytest.mark.parametrize(
    ("utilities", "gains", "shares"),
    [
        ((0.7, 0.704), (0.009, 0.0), (1, 1, 1)),  # in skill they differ by .008
        ((0.7, 0.706), (0.0, 0.0), (1, 0, 0)),
        ((0.7, 0.7), (0.0, 0.02), (0, 1, 0)),
        ((0.7,), (0.0,), (1, np.nan, np.nan)),
    ],
)
def test_a_search_converged_if_more_rounds_and_another_start_change_little(
    utilities: tuple[float, ...], gains: tuple[float, ...], shares: tuple[float, ...]
) -> None:
    pairs = list(zip(utilities, gains, strict=True))
    stored = [scripted(0), *(searched(seed, *pair) for seed, pair in enumerate(pairs))]
    attacks = attack_scores(SUITE, stored)
    assert Convergence.of(attacks) == pytest.approx(shares, nan_ok=True)
    said = [
        line
        for line in caveats(SUITE, stored, attacks, ["mean"])
        if "starts with other seeds" in line
    ]
    assert bool(said) == (shares[1] == 0)
    assert all(
        "in 1 of 1 searches, at most by 0.012 on mean in market, raters 50%" in line
        for line in said
    )
