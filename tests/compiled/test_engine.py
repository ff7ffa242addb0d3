"""Compiled rounds play as the rules do."""

import copy

import numpy as np
import pytest
from recorded_rounds import Round, batch_gap, episode_gap, largest_gap, record, start

from roletrust_env import Game, make_scenario, scenarios, trust_models
from roletrust_env.compiled.engine import CompiledBatch, Program
from roletrust_env.compiled.record import UnrecordableError
from roletrust_env.trees import arrays

REFUSED_PRESETS = {"paper-3x3-hog", "city"}
PLAYED = [name for name in scenarios() if name not in REFUSED_PRESETS]
SMALL = [name for name in PLAYED if name not in ("crowd-100x100", "marketplace-40")]
EXACT = 1e-12


@pytest.mark.parametrize("model", ["role-trust", "leave-one-out", "eigentrust", "travos"])
def test_episode_is_that_of_the_rules(model):
    program = record("paper-3x3", model)
    assert episode_gap("paper-3x3", model, program, 40) < EXACT


@pytest.mark.slow
@pytest.mark.parametrize("model", list(trust_models()))
@pytest.mark.parametrize("preset", SMALL)
def test_whole_episodes_are_those_of_the_rules(preset, model):
    assert episode_gap(preset, model, record(preset, model)) < EXACT


@pytest.mark.slow
def test_large_game_is_that_of_the_rules():
    program = record("crowd-100x100", "role-trust")
    assert episode_gap("crowd-100x100", "role-trust", program, 20) < EXACT


@pytest.mark.parametrize("games", [3, 8, 21])
def test_batch_is_that_of_the_rules(games):
    program = record("paper-3x3", "role-trust", batch=True)
    assert batch_gap("paper-3x3", "role-trust", program, games, 12) < EXACT


@pytest.mark.slow
@pytest.mark.parametrize("model", list(trust_models()))
@pytest.mark.parametrize("preset", ["paper-3x3", "robots-that-move", "market"])
def test_batches_are_those_of_the_rules(preset, model):
    program = record(preset, model, batch=True)
    assert batch_gap(preset, model, program, 21, 12) < EXACT


def test_batch_in_float32_is_near_float64():
    program = record("paper-3x3", "role-trust", np.float32, batch=True)
    assert batch_gap("paper-3x3", "role-trust", program, 32, 12, np.float32) < 1e-4
    assert all(dtype != np.float64 for _, dtype in program.outputs.arrays)


def test_games_of_a_batch_are_independent_of_its_size():
    game = Game(make_scenario("paper-3x3"))
    batch = CompiledBatch(record("paper-3x3", "role-trust", batch=True))
    few, many = [], []
    for games, found in ((8, few), (1000, many)):
        state, random = start(game, (games,))
        for _ in range(5):
            state, _ = batch.play(state, state.quality, state.ratings, random.round_key())
        found.extend(leaf[..., :8] for leaf in arrays(state))
    assert all(np.array_equal(one, other) for one, other in zip(few, many, strict=True))


def test_state_before_is_not_changed():
    game = Game(make_scenario("paper-3x3"))
    state, random = start(game, (16,))
    batch = CompiledBatch(record("paper-3x3", "role-trust", batch=True))
    first, _ = batch.play(state, state.quality, state.ratings, random.round_key())
    was = copy.deepcopy(first)
    batch.play(first, first.quality, first.ratings, random.round_key())
    assert largest_gap(first, was) == 0


def test_results_that_somebody_keeps_are_not_written_to():
    game = Game(make_scenario("paper-3x3"))
    state, random = start(game, (16,))
    batch = CompiledBatch(record("paper-3x3", "role-trust", batch=True))
    kept, copies = [], []
    for _ in range(12):
        state, outputs = batch.play(state, state.quality, state.ratings, random.round_key())
        kept.append((state.trust.top[0, :3], outputs[0][1]))
        copies.append(copy.deepcopy(kept[-1]))
        if len(kept) > 4:
            del kept[0], copies[0]
    assert largest_gap(tuple(kept), tuple(copies)) == 0


def test_city_is_refused():
    scenario = make_scenario("city")
    state, random = start(Game(make_scenario("paper-3x3")))
    with pytest.raises(UnrecordableError):
        Program.record(
            lambda like: Round(scenario, "mean", like), state, (state.quality, random.round_key())
        )


def test_rule_that_branches_on_a_value_is_refused():
    scenario = make_scenario("paper-3x3")
    state, random = start(Game(scenario))

    class Branching(Round):
        def __call__(self, state, quality, ratings, key, random):
            return super().__call__(
                state, quality if quality.sum() > 1 else 0 * quality, ratings, key, random
            )

    with pytest.raises(UnrecordableError, match="branch"):
        Program.record(
            lambda like: Branching(scenario, "mean", like),
            state,
            (state.quality, state.ratings, random.round_key()),
        )
