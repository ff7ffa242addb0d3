"""Models that play the benchmark rather than the game: what they gain, and what finds them."""

from typing import Any

import numpy as np
import pytest
from small_suites import small

from roletrust_env.benchmark.agreement import check_fresh
from roletrust_env.benchmark.cells import Cell, cells, task_arguments
from roletrust_env.benchmark.run_cell import play_cell
from roletrust_env.benchmark.schema import CellResult
from roletrust_env.benchmark.submission import make_claim
from roletrust_env.evaluation.attacked_games import HELD_OUT, attacked_rollout, exact_task, random_sources
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.trust import register_trust_model

PUBLIC = 0
"""Seed of every suite of the package."""

SUITE = small(
    models=["mean"],
    attacks=["rank-lies", "bad-mouthing"],
    tracks={"honest": {}, "raters": {"roles": ["SR"], "shares": [0.25, 0.5]}},
    games=16,
)


class Oracle:
    """A model that ignores ratings: it computes the abilities in the games of the public seed."""

    rates_raters = False

    def start(self, like: Any) -> Any:
        trust = 0.5 + np.zeros(like.shape[1:])
        if like.ndim == 4:
            task = exact_task(task_arguments(SUITE, cells(SUITE)[0]))
            sources = random_sources(task, PUBLIC, HELD_OUT)
            first = next(attacked_rollout(task, Scripted({}), (1, like.shape[-1]), *sources))
            trust = trust + first.before.properties.ability - 0.5
        return trust.astype(like.dtype)

    def update(self, state: Any, ratings: Any, mask: Any) -> Any:
        return state

    def rater_trust(self, state: Any) -> Any:
        return np.broadcast_to(0.5, (4, *state.shape[1:])).astype(state.dtype)

    def provider_trust(self, state: Any) -> Any:
        return state


def results(model: str, seed: int) -> list[tuple[Cell, CellResult]]:
    played = [cell._replace(model=model, seed=seed) for cell in cells(SUITE)]
    return [(cell, play_cell(SUITE, cell)) for cell in played]


def fresh(model: str, claimed: int, new: int) -> bool:
    claims = [make_claim(cell, result) for cell, result in results(model, claimed)]
    return check_fresh(claims, [result for _, result in results(model, new)]).ok


def test_a_model_that_knows_the_public_seed_is_found_by_a_new_one() -> None:
    register_trust_model("oracle", Oracle)
    worst = min(np.mean(row.measured["utility"]) for _, result in results("oracle", PUBLIC) for row in result.rows)
    assert worst > 0.99
    assert not fresh("oracle", PUBLIC, 17)


@pytest.mark.parametrize("new", range(1, 9))
def test_an_honest_model_is_as_good_in_games_with_a_new_seed(new: int) -> None:
    assert fresh("mean", PUBLIC, new)
    assert fresh("mean", new, PUBLIC)
