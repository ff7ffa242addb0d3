"""A round of the game against a loop-by-loop reference, and what holds in every game."""

from itertools import pairwise
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
import torch
from game_cases import (
    ACCESS,
    EVERY_ACCESS,
    OPEN,
    TOLERANCE,
    assert_close,
    busy,
    each,
    luck,
    play,
    scenarios,
)
from hypothesis import given
from refusals import refuses
from slow_game import Slow

from roletrust_env import Actions, Game, Noise, Scenario, make_scenario
from roletrust_env.game.summary import summarise
from roletrust_env.trees import arrays
from roletrust_env.world.presence import LEFT, PRESENT, WAITING


def assert_matches_reference(scenario: Scenario, seed: int) -> None:
    game = Game(scenario)
    start, actions, noises = luck(game, seed)
    slow = Slow(scenario, start)
    assert game.roster.names == tuple(slow.names)
    for t, (state, rewards) in enumerate(play(game, start, actions, noises)):
        if t:
            np.testing.assert_allclose(
                rewards, list(slow.step(actions[t - 1], noises[t - 1]).values()), **TOLERANCE
            )
        for field, value in slow.expected().items():
            np.testing.assert_allclose(
                getattr(state, field), value, err_msg=f"{field}, round {t}", **TOLERANCE
            )
        tor, top = game.published(state)
        np.testing.assert_allclose(tor, list(slow.tor.values()), **TOLERANCE)
        np.testing.assert_allclose(top, list(slow.top.values()), **TOLERANCE)
        np.testing.assert_allclose(
            game.agent_trust(state), [slow.trust(k) for k in slow.names], **TOLERANCE
        )
        if state.population is None:
            assert set(slow.phase.values()) == {PRESENT}
        else:
            assert state.population.phase.tolist() == list(slow.phase.values())
        if slow.place is not None:
            np.testing.assert_allclose(
                state.motion.position, list(slow.place.values()), **TOLERANCE
            )


@EVERY_ACCESS
@pytest.mark.parametrize("seed", range(3))
def test_a_busy_game_matches_the_reference(access: dict, seed: int) -> None:
    assert_matches_reference(busy(access=access), seed)
    assert_matches_reference(busy(access=access, ratings=OPEN), seed)


@given(scenarios(), st.integers(0, 99))
def test_any_game_matches_the_reference(scenario: Scenario, seed: int) -> None:
    assert_matches_reference(scenario, seed)


@given(scenarios(), st.integers(0, 99))
def test_a_batch_is_its_games_one_by_one(scenario: Scenario, seed: int) -> None:
    game = Game(scenario)
    start, *rounds = luck(game, seed, (3,))
    together = list(play(game, start, *rounds))
    for e in range(3):

        def one(array: Any, e: int = e) -> Any:
            return array[..., e]

        alone = play(
            game, each(one, start), *([each(one, tree) for tree in trees] for trees in rounds)
        )
        for whole, single in zip(together, alone, strict=True):
            assert_close(single, each(one, whole))


def test_a_batch_may_have_several_axes() -> None:
    game = Game(busy(access=ACCESS["softmax"]))
    start, *rounds = luck(game, 0, (6,))

    def fold(tree: Any) -> Any:
        return each(lambda a: a.reshape(*a.shape[:-1], 2, 3), tree)

    folded = play(game, fold(start), *(map(fold, trees) for trees in rounds))
    for flat, two in zip(play(game, start, *rounds), folded, strict=True):
        assert_close(two, fold(flat))
        np.testing.assert_allclose(
            summarise(game, two[0]), fold(summarise(game, flat[0])), **TOLERANCE
        )


@given(scenarios(), st.integers(0, 99), st.sampled_from([(), (2,)]))
def test_numpy_and_torch_agree(scenario: Scenario, seed: int, batch: tuple[int, ...]) -> None:
    game, tensor_game = Game(scenario), Game(scenario, like=torch.zeros((), dtype=torch.float64))
    start, *rounds = luck(game, seed, batch)
    tensors = play(
        tensor_game,
        each(torch.asarray, start),
        *([each(torch.asarray, t) for t in r] for r in rounds),
    )
    for (state, rewards), (tensor_state, tensor_rewards) in zip(
        play(game, start, *rounds), tensors, strict=True
    ):
        assert all(isinstance(array, torch.Tensor) for array in arrays(tensor_state))
        assert_close((tensor_state, tensor_rewards), (state, rewards))
        assert_close(summarise(tensor_game, tensor_state), summarise(game, state))
        assert_close(tensor_game.views(tensor_state), game.views(state))
        assert_close(tensor_game.observations(tensor_state), game.observations(state))


@given(scenarios(), st.integers(0, 99), st.sampled_from([np.float32, np.float64]), st.booleans())
def test_everything_stays_in_range_and_precision(
    scenario: Scenario, seed: int, dtype: type, tensors: bool
) -> None:
    def cast(array: Any) -> Any:
        array = np.asarray(array)
        array = array if array.dtype == bool else array.astype(dtype)
        return torch.asarray(array) if tensors else array

    game = Game(scenario, like=cast(0.0))
    start, *rounds = luck(Game(scenario), seed)
    kinds = None
    for state, rewards in play(
        game, each(cast, start), *([each(cast, tree) for tree in trees] for trees in rounds)
    ):
        seen = [*game.published(state), game.agent_trust(state), summarise(game, state)]
        seen += [array for array in game.observations(state) if array is not None]
        assert {array.dtype for array in seen} == {cast(0.0).dtype}
        assert all(np.all((np.asarray(a) >= 0) & (np.asarray(a) <= 1)) for a in seen)
        assert rewards is None or (
            rewards.dtype == cast(0.0).dtype and np.all(np.isfinite(np.asarray(rewards)))
        )
        assert kinds in (None, [a.dtype for a in arrays(state)])
        kinds = [a.dtype for a in arrays(state)]


@given(scenarios(), st.integers(0, 99))
def test_a_step_leaves_its_inputs_alone(scenario: Scenario, seed: int) -> None:
    game = Game(scenario)
    start, actions, noises = luck(game, seed)
    state = game.start(start)
    for inputs in zip(actions, noises, strict=True):
        before = each(np.copy, (state, *inputs))
        after, _ = game.step(state, *inputs)
        each(np.testing.assert_array_equal, (state, *inputs), before)
        state = after


@given(scenarios(), st.integers(0, 99))
def test_who_serves_whom(scenario: Scenario, seed: int) -> None:
    """Never oneself; the absent neither serve nor are served; who left or was cut off never comes
    back."""
    game, roster = Game(scenario), Game(scenario).roster
    states = [state for state, _ in play(game, *luck(game, seed))]
    own = np.array([[i == j for j in roster.provider_names] for i in roster.rater_names])
    for before, after in pairwise(states):
        assert not (after.awaiting & own).any()
        assert not (after.rated & own).any()
        assert np.all(after.service[~after.awaiting] == 0)
        assert np.all(after.ratings[~after.rated] == 0)
        assert np.all(after.quality[~after.awaiting.any(axis=0)] == 0)
        if after.population is not None:
            here = (before.population.phase == PRESENT) & (after.population.phase == PRESENT)
            assert not after.awaiting[~roster.raters(here)].any()
            assert not after.awaiting[:, ~roster.providers(here)].any()
            gone = before.population.phase >= LEFT
            assert np.array_equal(after.population.phase[gone], before.population.phase[gone])
            assert not np.any(
                (before.population.phase == PRESENT) & (after.population.phase == WAITING)
            )
            fresh = (after.population.phase == WAITING) | (before.population.phase == WAITING)
            assert np.all(game.agent_trust(after)[fresh] == scenario.initial_trust)
            assert np.array_equal(game.present(after), after.population.phase == PRESENT)


@given(scenarios(), st.integers(0, 99), st.randoms())
def test_permuting_agents_of_a_group_permutes_results(
    scenario: Scenario, seed: int, random: Any
) -> None:
    game = Game(scenario)
    roster, (start, actions, noises) = game.roster, luck(game, seed)
    order, chance = list(range(roster.n_agents)), scenario.access.kind == "encounters"
    for group in dict.fromkeys(map(id, roster.groups)):
        places = [n for n in order if id(roster.groups[n]) == group]
        if chance and roster.groups[places[0]].role != "SR":
            continue  # whom a rater meets goes by the places of the providers
        for n, m in zip(places, random.sample(places, len(places)), strict=True):
            order[n] = m
    by_name = [roster.names[n] for n in order]
    i = [roster.rater_names.index(name) for name in by_name if name in roster.rater_names]
    j = [roster.provider_names.index(name) for name in by_name if name in roster.provider_names]
    cells = np.ix_(i, j)

    def shuffle(noise: Noise) -> Noise:
        cell_axes = cells, cells, cells, i if chance else cells
        axes = Noise(*cell_axes, order, j, order, order, j, i, i, i, cells, j, j)
        return Noise(*(None if a is None else a[axis] for a, axis in zip(noise, axes, strict=True)))

    permuted = play(
        game,
        shuffle(start),
        [
            Actions(
                a.quality[j],
                a.ratings[cells],
                withheld=None if a.withheld is None else a.withheld[cells],
                treatment=None if a.treatment is None else a.treatment[cells],
                claims=None if a.claims is None else a.claims[cells],
            )
            for a in actions
        ],
        list(map(shuffle, noises)),
    )
    for (state, rewards), (other, other_rewards) in zip(
        play(game, start, actions, noises), permuted, strict=True
    ):
        assert_close(other.awaiting, state.awaiting[cells])
        assert_close(other.service, state.service[cells])
        assert_close(other.quality, state.quality[j])
        assert_close(game.agent_trust(other), game.agent_trust(state)[order])
        if rewards is not None:
            assert_close(other_rewards, rewards[order])


def test_actions_that_are_nan_or_outside_are_refused() -> None:
    game = Game(make_scenario("paper-3x3"))
    random = game.random(0)
    state = game.start(game.draw(random, (4,), start=True))
    for wrong in (np.nan, -0.5, 1.5, np.inf):
        for name, place in (("quality", 0), ("ratings", 1)):
            parts = [np.ones((3, 4)), np.ones((3, 3, 4))]
            parts[place][-1] = wrong
            with refuses(ValueError, name, wrong):
                game.step(state, Actions(*parts), game.draw(random, (4,)))
