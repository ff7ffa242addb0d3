"""Models that play the benchmark rather than the game: what they gain, and what finds them."""

import sys
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import gaming_models
import numpy as np
import pytest
from refusals import refuses
from small_suites import small

from roletrust_env.benchmarking.cells import play_cell, task_arguments
from roletrust_env.benchmarking.schema import CellResult
from roletrust_env.benchmarking.sources import hashes, model_source, source_of
from roletrust_env.benchmarking.submission import CellClaim, make_claim
from roletrust_env.benchmarking.suite import Cell
from roletrust_env.benchmarking.verification import check_bias, check_cell, check_fresh
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.measurement import (
    HELD_OUT,
    attacked_rollout,
    exact_task,
    random_sources,
)
from roletrust_env.evaluation.specs import is_own_model
from roletrust_env.trust import Ratings, register_trust_model
from roletrust_env.trust.model import registry
from roletrust_env.trust.model_checks import needs_watching
from roletrust_env.trust.models.central.means import Mean

PUBLIC = 0
"""Seed of every suite of the package."""

SUITE = small(
    models=["mean"],
    attacks=["rank-lies", "bad-mouthing"],
    tracks={"honest": {}, "raters": {"roles": ["SR"], "shares": [0.25, 0.5]}},
    games=80,
)


SCRIPTS = ["rank-lies", "bad-mouthing", "swap-ends", "ballot-stuffing"]


class Oracle:
    """A model that ignores ratings: it computes the abilities in the games of the public seed."""

    rates_raters = False

    def start(self, like: Any) -> Any:
        trust = 0.5 + np.zeros(like.shape[1:])
        if like.ndim == 4:
            task = exact_task(task_arguments(SUITE, SUITE.cells()[0]))
            sources = random_sources(task, PUBLIC, HELD_OUT)
            first = next(attacked_rollout(task, Scripted({}), (1, like.shape[-1]), *sources))
            trust = trust + first.before.properties.ability - 0.5
        return trust.astype(like.dtype)

    def update(self, state: Any, ratings: Ratings) -> Any:
        return state

    def rater_trust(self, state: Any) -> Any:
        return np.broadcast_to(0.5, (4, *state.shape[1:])).astype(state.dtype)

    def provider_trust(self, state: Any) -> Any:
        return state


@cache
def results(model: str, seed: int) -> list[tuple[Cell, CellResult]]:
    played = [cell._replace(model=model, seed=seed) for cell in SUITE.cells()]
    return [(cell, play_cell(SUITE, cell)) for cell in played]


def fresh(models: list[str], claimed: int, new: int, half: float | None = None) -> list[bool]:
    pairs = [pair for model in models for pair in results(model, claimed)]
    claims = [make_claim(cell, result) for cell, result in pairs]
    if half is not None:
        claims = [_wider(claim, half) for claim in claims]
    return [
        check.ok
        for check in check_fresh(
            claims, [result for model in models for _, result in results(model, new)]
        )
    ]


def _wider(claim: CellClaim, half: float) -> CellClaim:
    data = claim.model_dump()
    for attack in data["attacks"]:
        attack["measured"]["utility"]["half_95"] = half
    return CellClaim.model_validate(data)


def test_a_model_that_knows_the_public_seed_is_found_by_a_new_one() -> None:
    register_trust_model("oracle", Oracle)
    worst = min(
        np.mean(row.measured["utility"])
        for _, result in results("oracle", PUBLIC)
        for row in result.rows
    )
    assert worst > 0.99
    assert fresh(["oracle"], PUBLIC, 17) == [False]
    assert fresh(["oracle"], PUBLIC, 17, half=20.0) == [False]
    assert fresh(["mean", "oracle", "constant"], PUBLIC, 17) == [True, False, True]


def test_a_model_in_a_process_of_its_own_cannot_read_the_game_off_the_stack() -> None:
    suite = small(
        models=["gaming_models:OffTheStack"], attacks=["rank-lies"], tracks=SUITE.tracks, games=40
    )
    cell = next(one for one in suite.cells() if one.share == 0.5)
    inside, apart = (
        play_cell(suite, cell, isolated=isolated).rows[0] for isolated in (False, True)
    )
    (honest,) = play_cell(suite, cell._replace(model="mean")).rows
    assert np.mean(inside.measured["utility"]) > 0.99
    assert apart.measured == honest.measured  # it is no more than the mean, to the last bit
    claims = [make_claim(cell, CellResult((inside,), 0.0))]
    assert [check.ok for check in check_fresh(claims, [CellResult((apart,), 0.0)])] == [False]


@pytest.mark.parametrize("name", ["RowPeek", pytest.param("Remembering", marks=pytest.mark.slow)])
def test_trust_that_depends_on_other_games_is_refused(name: str) -> None:
    suite = small(models=[f"gaming_models:{name}"], attacks=SCRIPTS, tracks=SUITE.tracks, games=20)
    cell = next(one for one in suite.cells() if one.share == 0.5)
    usual = play_cell(suite, cell._replace(model="beta"))
    inside = play_cell(suite, cell)
    assert _worst(inside) > _worst(usual) + 0.1
    with refuses(ValueError, f"gaming_models:{name}"):
        play_cell(suite, cell, isolated=True)


def _worst(result: CellResult) -> float:
    return min(float(np.mean(row.measured["utility"])) for row in result.rows)


def test_a_borrowed_name_makes_no_model_of_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    module = sys.modules[gaming_models.FirstHand.__module__]
    register_trust_model("borrowed", gaming_models.FirstHand)
    register_trust_model("object", partial(gaming_models.FirstHand))
    for _ in range(2):
        assert not is_own_model("borrowed")
        assert needs_watching(gaming_models.FirstHand())
        for name in ("borrowed", "object"):
            with refuses(ValueError, "roletrust_env"):
                source_of(registry.factory(name))
        digests = hashes(
            {name: registry.factory(name) for name in ("first-hand", "borrowed", "object")}
        )
        assert len(set(digests.values())) == 3
        monkeypatch.setattr(
            module, "FirstHand", gaming_models.FirstHand
        )  # it may even take the place
    assert is_own_model("first-hand")


def test_the_hash_of_a_model_of_others_is_of_its_package_which_is_not_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "package_of_mine").mkdir()
    (tmp_path / "package_of_mine/model.py").write_text("raise SystemExit\nclass Mine: ...")
    (tmp_path / "package_of_mine/__init__.py").write_text("raise SystemExit")
    (tmp_path / "module_of_mine.py").write_text("raise SystemExit")
    found = [
        model_source("package_of_mine.model:Mine:lam=0.5"),
        model_source("module_of_mine:Mine"),
    ]
    assert [one.made_by for one in found] == ["package_of_mine.model.Mine", "module_of_mine.Mine"]
    (tmp_path / "package_of_mine/helper.py").write_text("")
    assert model_source("package_of_mine.model:Mine") != found[0]
    assert model_source("module_of_mine:Mine") == found[1]
    assert model_source("mean:lam=0.5") == source_of(registry.factory("mean"))
    for name in ("none_of_mine:Mine", "sys:Mine", "none"):
        with refuses(ValueError, name):
            model_source(name)


@pytest.mark.slow
def test_twenty_honest_entries_are_accepted() -> None:
    """Each entry is a run with a seed of its own; the next one is what a verifier plays with a new
    seed."""
    models = ["mean", "median", "travos"]
    runs = [[pair for model in models for pair in results(model, seed)] for seed in range(21)]
    claims = [[make_claim(cell, result) for cell, result in one] for one in runs]
    for mine, after in pairwise(range(21)):
        checks = check_fresh(claims[mine], [result for _, result in runs[after]])
        assert [check.message for check in checks if not check.ok] == []


class Elsewhere(Mean):
    """The mean as another machine may compute it: the last digit of a number is another, for equal
    numbers alike."""

    machine = 0

    def provider_trust(self, state: Any) -> Any:
        trust = super().provider_trust(state)
        bits = np.ascontiguousarray(trust).view(np.uint64) * np.uint64(
            0x9E3779B97F4A7C15 + 2 * self.machine
        )
        last = (bits >> np.uint64(40)) % np.uint64(3) - 1.0
        return np.clip(np.where(trust * 64 % 1 == 0, trust, trust * (1 + 2.0**-52 * last)), 0, 1)


@pytest.mark.slow
def test_twenty_entries_from_other_machines_are_accepted_and_raised_ones_are_not() -> None:
    suite = small(models=["mean"], games=20, seeds=[0, 1, 2, 3])
    register_trust_model("elsewhere", Elsewhere)
    here = [play_cell(suite, cell) for cell in suite.cells()]
    own = [make_claim(cell, result) for cell, result in zip(suite.cells(), here, strict=True)]
    different = 0
    for machine in range(20):
        Elsewhere.machine = machine
        played = [
            (cell, play_cell(suite, cell._replace(model="elsewhere"))) for cell in suite.cells()
        ]
        claims = [make_claim(cell, result) for cell, result in played]
        different += claims != own
        checks = [
            check_cell(claim, result, same=False)
            for claim, result in zip(claims, here, strict=True)
        ]
        assert all(check.ok for check in [*checks, *check_bias(claims, here)])
        assert not all(
            check.ok for check in check_bias([_raised(claim, 0.4) for claim in claims], here)
        )
    assert different > 10


def _raised(claim: CellClaim, halves: float) -> CellClaim:
    data = claim.model_dump()
    for attack in data["attacks"]:
        for name in ("utility", "published"):
            attack["measured"][name]["mean"] += halves * attack["measured"][name]["half_95"]
    return CellClaim.model_validate(data)


def test_an_honest_model_is_as_good_in_games_with_a_new_seed() -> None:
    for new in range(1, 4):
        assert fresh(["mean"], PUBLIC, new) == fresh(["mean"], new, PUBLIC) == [True]
