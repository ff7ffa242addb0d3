"""A sparse game is the game on a grid, on the pairs that meet only."""

import tracemalloc
from collections.abc import Iterator, Mapping
from itertools import combinations, pairwise
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from game_cases import ACCESS, TOLERANCE, busy, luck, scenarios
from hypothesis import given
from refusals import refuses

from roletrust_baselines import (
    BadMouthing,
    BallotStuffing,
    Collusion,
    Conflicting,
    OnOff,
    RankLies,
    Silent,
)
from roletrust_env import (
    Actions,
    Game,
    JointPolicy,
    Noise,
    Policy,
    Random,
    Scenario,
    SparseGame,
    State,
    make_scenario,
    parallel_env,
)
from roletrust_env.game.consumer import buy
from roletrust_env.game.rollout import record, rollout
from roletrust_env.world.access import meet
from roletrust_env.world.scenario import Encounters

CENTRAL = [
    "role-trust",
    "beta-filtered",
    "mean",
    "median",
    "eigentrust",
    "wary-role-trust",
    "leave-one-out",
]
MARKET: dict[str, Any] = {
    "agents": [
        {"role": "SR", "count": 7, "noise": 0.1},
        {"role": "SP", "count": 5, "ability": [0.3, 1.0], "drift": 0.1, "switch": 0.1},
    ],
    "access": {"kind": "encounters", "providers": 3},
    "values": [1.0, 2.0],
    "ratings": {"lost": 0.2},
    "max_cycles": 12,
}


def meeting(scenario: Scenario, providers: int | None = None) -> Scenario:
    """The scenario with encounters, with all providers if it is not said with how and no late
    ratings."""
    fields = scenario.model_dump()
    count = sum(g["count"] * (1 + g["reserve"]) for g in fields["agents"] if g["role"] != "SR")
    others = count - any(g["role"] == "SR+SP" for g in fields["agents"])
    access = {
        "kind": "encounters",
        "providers": others if providers is None else min(providers, others),
    }
    return Scenario.model_validate(
        fields | {"access": access, "ratings": {"lost": fields["ratings"]["lost"]}}
    )


def at(cells: Any, met: np.ndarray) -> Any:
    """The cells of the pairs that meet, from those of all pairs."""
    return None if cells is None else np.take_along_axis(cells, met, axis=1)


def side_by_side(
    scenario: Scenario, model: Any, seed: int, full: bool = False
) -> Iterator[tuple[tuple[State, Any], tuple[State, Any], np.ndarray]]:
    """Play both games with the same luck for each pair; yield states and rewards, and the providers
    met before."""
    grid, sparse = Game(scenario, model), SparseGame(scenario, model)
    everyone = Game(scenario.change(access={"kind": "everyone"}), model) if full else grid
    start, actions, noises = luck(grid, seed)
    actions = [action._replace(treatment=None, claims=None) for action in actions]
    dense, state = (
        everyone.start(start),
        sparse.start(start._replace(perception=np.zeros(sparse_shape(sparse)))),
    )
    met = state.met
    for action, noise in zip(actions, noises, strict=True):
        own = sparse.roster.own_provider
        next_met = meet(scenario.access, own, sparse.roster.n_providers, noise.choice)
        its = action._replace(ratings=at(action.ratings, met), withheld=at(action.withheld, met))
        lucky = noise._replace(perception=at(noise.perception, next_met), lost=at(noise.lost, met))
        dense, rewards = everyone.step(dense, action, noise)
        state, its_rewards = sparse.step(state, its, lucky)
        np.testing.assert_array_equal(state.met, next_met)
        yield (dense, rewards), (state, its_rewards), met
        met = next_met


def sparse_shape(game: SparseGame) -> tuple[int, int]:
    return game.roster.n_raters, game.scenario.access.providers


def assert_same(scenario: Scenario, model: Any, seed: int, full: bool = False) -> None:
    grid, sparse = Game(scenario, model), SparseGame(scenario, model)
    for (dense, rewards), (state, its_rewards), before in side_by_side(scenario, model, seed, full):
        np.testing.assert_allclose(its_rewards, rewards, **TOLERANCE)
        for one, other in zip(sparse.published(state), grid.published(dense), strict=True):
            np.testing.assert_allclose(one, other, **TOLERANCE)
        np.testing.assert_allclose(sparse.agent_trust(state), grid.agent_trust(dense), **TOLERANCE)
        for field in ("quality", "value"):
            np.testing.assert_allclose(getattr(state, field), getattr(dense, field), **TOLERANCE)
        assert state.awaiting.sum() == dense.awaiting.sum()
        for field in ("service", "awaiting"):
            np.testing.assert_allclose(
                getattr(state, field), at(getattr(dense, field), state.met), **TOLERANCE
            )
        for field in ("ratings", "rated"):
            np.testing.assert_allclose(
                getattr(state, field), at(getattr(dense, field), before), **TOLERANCE
            )
        if state.population is not None:
            np.testing.assert_array_equal(state.population.phase, dense.population.phase)


@given(scenarios(), st.integers(1, 4), st.integers(0, 99))
def test_a_sparse_game_is_the_game_on_the_pairs_that_meet(
    scenario: Scenario, providers: int, seed: int
) -> None:
    assert_same(meeting(scenario, providers), "role-trust", seed)


@given(scenarios(), st.integers(0, 99))
def test_with_all_pairs_served_it_is_the_game_in_which_all_meet(
    scenario: Scenario, seed: int
) -> None:
    if not {"SR", "SR+SP"} <= {
        group.role for group in scenario.agents
    }:  # there an SR does not meet all providers
        assert_same(meeting(scenario), "mean", seed, full=True)


@pytest.mark.parametrize("model", CENTRAL)
def test_with_every_central_model(model: str) -> None:
    assert_same(Scenario.model_validate(MARKET), model, 1)


def test_with_everything_that_a_scenario_can_have() -> None:
    assert_same(meeting(busy(), 3), "role-trust", 0)


ATTACKS: Mapping[str, Policy] = {
    "sr_0": BadMouthing(level=0.1, targets=(1, 3)),
    "sr_1": BallotStuffing(accomplices=(0,)),
    "sr_2": Collusion(accomplices=(4,)),
    "sp_4": Collusion(accomplices=(4,)),
    "sr_3": Silent(targets=(2,), start=2),
    "sp_2": OnOff(period=3, switching="random"),
}


def test_the_same_policies_play_both_games() -> None:
    scenario = Scenario.model_validate(MARKET | {"ratings": {}})
    grid, sparse = Game(scenario), SparseGame(scenario)
    noises, chance = (
        Random(np.random.default_rng(0)),
        [Random(np.random.default_rng(1)) for _ in range(2)],
    )
    start = grid.draw(noises, start=True)
    dense, state = grid.start(start), sparse.start(start._replace(perception=np.zeros((7, 3))))
    seats = JointPolicy(grid, ATTACKS), JointPolicy(sparse, ATTACKS)
    memories = [seat.begin(random) for seat, random in zip(seats, chance, strict=True)]
    for _ in range(scenario.max_cycles):
        noise = grid.draw(noises)
        all_act, memories[0] = seats[0].checked_act(dense, memories[0], chance[0])
        act, memories[1] = seats[1].checked_act(state, memories[1], chance[1])
        np.testing.assert_array_equal(act.quality, all_act.quality)
        np.testing.assert_array_equal(
            act.ratings[state.awaiting], at(all_act.ratings, state.met)[state.awaiting]
        )
        met = meet(scenario.access, sparse.roster.own_provider, 5, noise.choice)
        before = state
        dense, _ = grid.step(dense, all_act, noise)
        state, _ = sparse.step(state, act, noise._replace(perception=at(noise.perception, met)))
        np.testing.assert_allclose(
            sparse.published(state)[1], grid.published(dense)[1], **TOLERANCE
        )
        top, offered = sparse.published(before)[1], sparse.offered(before, act, state)
        each = [buy(top[row], offered[row]) for row in met]
        np.testing.assert_allclose(
            sparse.bought(before, act, state), np.mean(each, axis=0), **TOLERANCE
        )
    assert 0 < top.min() < top.max() < 1


def test_a_rater_that_is_not_there_buys_nothing() -> None:
    agents = [{"role": "SR", "count": 3}, {"role": "SR", "joins": 2}, {"role": "SP", "count": 4}]
    game = SparseGame(Scenario.model_validate(MARKET | {"agents": agents, "max_cycles": 5}))
    random, best = game.random(0), []
    for played in rollout(JointPolicy(game, {}), random, random):
        best.append(game.bought(*played[:3]).best)
    assert best[:2] == [0.75, 0.75]
    assert best[-1] == 1.0


# --- who meets whom
# -----------------------------------------------------------------------------------


@given(st.integers(1, 9), st.data())
def test_nobody_meets_itself_or_anybody_twice(n_providers: int, data: st.DataObject) -> None:
    own = np.array(data.draw(st.lists(st.integers(0, n_providers), min_size=1, max_size=4)))
    others = n_providers - bool((own < n_providers).any())
    k = data.draw(st.integers(0, others).filter(bool)) if others else 0
    if k:
        noise = data.draw(st.sampled_from([0.0, 1 - 2**-24])) * np.ones((len(own), k))
        noise = data.draw(st.sampled_from([noise, np.random.default_rng(k).random((len(own), k))]))
        for dtype in (np.float32, np.float64):
            met = meet(Encounters(providers=k), own, n_providers, noise.astype(dtype))
            assert met.min() >= 0
            assert met.max() < n_providers
            assert all(
                len(set(row)) == k and mine not in row
                for row, mine in zip(met.tolist(), own, strict=True)
            )


def test_every_set_of_others_is_equally_likely() -> None:
    own, games = np.full(30_000, 2), np.random.default_rng(0).random((30_000, 3))
    met = np.sort(meet(Encounters(providers=3), own, 6, games), axis=1)
    found = {tuple(row): 0 for row in combinations([0, 1, 3, 4, 5], 3)}
    for row in met.tolist():
        found[tuple(row)] += 1
    assert len(found) == 10
    assert all(abs(count - 3000) < 5 * 52 for count in found.values())  # 5 standard deviations


# --- seeds and order
# ----------------------------------------------------------------------------------


def final_trust(game: SparseGame, seed: int) -> np.ndarray:
    random = game.random(seed)
    *_, last = rollout(JointPolicy(game, {}), random, random)
    return np.concatenate(game.published(last.state))


def test_a_seed_gives_the_same_game_and_another_seed_another() -> None:
    scenario = Scenario.model_validate(MARKET)
    once, twice, other = (final_trust(SparseGame(scenario), seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(once, twice)
    assert not np.allclose(once, other)


def test_the_order_of_raters_changes_nothing() -> None:
    scenario = Scenario.model_validate(MARKET)
    order, played = np.random.default_rng(5).permutation(7), []
    for mixed in (slice(None), order):
        game = SparseGame(scenario)
        random = game.random(3)
        state, met = game.start(game.draw(random, start=True)), None
        for _ in range(scenario.max_cycles):
            noise, n = game.draw(random), state.round
            ratings = np.random.default_rng(int(n)).random((7, 3))
            cells = Noise(
                *(part[mixed] if part is not None and part.ndim == 2 else part for part in noise)
            )
            state, _ = game.step(state, Actions(np.ones(5), ratings[mixed]), cells)
        played.append((game.published(state), met))
    (straight, _), (shuffled, _) = played
    np.testing.assert_allclose(shuffled[0], straight[0][order], **TOLERANCE)
    np.testing.assert_allclose(shuffled[1], straight[1], **TOLERANCE)


# --- size
# ---------------------------------------------------------------------------------------------


def test_no_array_of_all_pairs_is_made() -> None:
    """A flag for each of these pairs would take 400 MB."""
    agents = [{"role": "SR", "count": 20_000, "noise": 0.1}, {"role": "SP", "count": 20_000}]
    access = {"kind": "encounters", "providers": 3}
    tracemalloc.start()
    try:
        game = SparseGame(
            Scenario.model_validate({"agents": agents, "access": access, "max_cycles": 2})
        )
        random = game.random(0)
        for played in rollout(
            JointPolicy(game, {"sr_7": BadMouthing(targets=(3,))}), random, random
        ):
            game.bought(*played[:3])
            game.known_trust(played.state)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 80e6


# --- bad input
# ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "model", "words"),
    [
        (
            {"access": {"kind": "everyone"}},
            "mean",
            ("everyone", "encounters"),
        ),
        ({"access": ACCESS["in-range"]}, "mean", ("in-range", "encounters")),
        ({"ratings": {"late": 0.1}}, "mean", ("ratings.late", "0.1")),
        ({"ratings": {"open": 7}}, "mean", ("ratings.open", 7)),
        ({"ratings": {"deadline": 8}}, "mean", ("ratings.deadline", 8)),
        ({"service": "hog"}, "mean", ("service", "hog")),
        ({}, "travos", ("Travos",)),
        ({}, "nobody", ("nobody",)),
        (
            {"agents": [{"role": "SR+SP", "count": 5}]},
            "eigentrust",
            ("EigenTrust()",),
        ),
    ],
)
def test_what_a_sparse_game_refuses(fields: dict, model: str, words: tuple[str, ...]) -> None:
    scenario = Scenario.model_validate(MARKET | fields)
    with refuses(ValueError, *words):
        SparseGame(scenario, model)


@pytest.mark.parametrize(
    ("agents", "providers", "most"),
    [
        ([{"role": "SR"}, {"role": "SP", "count": 3}], 4, 3),
        ([{"role": "SR+SP", "count": 3}], 3, 2),
        ([{"role": "SR"}, {"role": "SP", "count": 2, "reserve": 1}], 5, 4),
    ],
)
def test_nobody_can_meet_more_providers_than_there_are(
    agents: list, providers: int, most: int
) -> None:
    data = {"agents": agents, "access": {"kind": "encounters", "providers": providers}}
    with refuses(ValueError, "access.providers", providers, most):
        Scenario.model_validate(data)
    data["access"]["providers"] = most
    Scenario.model_validate(data)


def test_a_state_is_stepped_from_once_and_can_still_be_read() -> None:
    game = SparseGame(Scenario.model_validate(MARKET))
    random = game.random(0)
    states = [game.start(game.draw(random, start=True))]
    act = Actions(np.ones(5), np.full((7, 3), 0.2))
    for _ in range(3):
        states.append(game.step(states[-1], act, game.draw(random))[0])
    trust = [game.published(state)[1] for state in states]
    assert all(not np.array_equal(one, other) for one, other in pairwise(trust[1:]))
    with refuses(ValueError, "round", "1", "3"):
        game.step(states[1], act, game.draw(random))
    assert game.step(states[-1], act, game.draw(random))[0].round == 4
    with refuses(ValueError, "(7, 5)", "(7, 3)"):
        game.step(states[-1], Actions(np.ones(5), np.ones((7, 5))), game.draw(random))
    with refuses(ValueError, "withheld", "(7, 5)", "(7, 3)"):
        game.step(states[-1], act._replace(withheld=np.zeros((7, 5), bool)), game.draw(random))
    with refuses(ValueError, "sparse"):
        game.step(states[-1], act._replace(treatment=np.ones((7, 3))), game.draw(random))


@pytest.mark.parametrize(
    ("seated", "word"),
    [
        ({"sr_0": RankLies()}, "rank-lies"),
        ({"sp_0": Conflicting()}, "conflicting"),
    ],
)
def test_policies_that_a_sparse_game_cannot_seat(seated: dict[str, Policy], word: str) -> None:
    game = SparseGame(Scenario.model_validate(MARKET))
    with refuses(ValueError, word):
        JointPolicy(game, seated).begin(game.random(0))


def test_batches_and_observations_are_refused() -> None:
    game = SparseGame(Scenario.model_validate(MARKET))
    with refuses(ValueError, "(7, 3, 4)", "(7, 3)"):
        game.start(game.draw(game.random(0), (4,), start=True))
    with refuses(ValueError, "sparse"):
        game.observations(game.start(game.draw(game.random(0), start=True)))


def test_a_city_is_not_played_on_a_grid() -> None:
    for play in Game, parallel_env:
        with refuses(ValueError, "city", "8,000", "2,000"):
            play(make_scenario("city"))


def test_the_record_of_a_sparse_game_counts_all_providers() -> None:
    game = SparseGame(Scenario.model_validate(MARKET))
    found = record(JointPolicy(game, {}), game.random(0))
    assert (
        repr(found)
        == f"History(rounds: {len(found.tor)}, raters: 7, providers: 5, agents: 12, batch: ())"
    )
