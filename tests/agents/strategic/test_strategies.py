"""The strategies against their formulas in loops, and populations in one batch against games one by
one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

from roletrust_agents.strategic.learning import mean_rewards, play
from roletrust_agents.strategic.strategies import (
    BOUNDS,
    HONEST,
    StrategicProvider,
    StrategicRater,
    StrategyProfile,
    departure,
    honest_population,
    random_population,
    uniform_population,
)
from roletrust_env import Game, JointPolicy, Player, make_scenario, parallel_env, record
from roletrust_env.game.views import ProviderView, RaterView

SMALL = make_scenario("crowd-10x10").change(
    agents=[
        {"role": "SR", "count": 4, "noise": 0.05},
        {"role": "SP", "count": 3, "ability": (0.3, 1.0)},
    ],
    max_cycles=8,
)
unit = st.floats(0, 1)
either = st.floats(-1, 1)


@given(unit, either, unit)
def test_a_provider_reacts_to_its_trust(level, reaction, trust):
    view = ProviderView(*[np.array(0.0), np.array(trust), *[np.array(0.0)] * 4])
    chosen, _ = StrategicProvider(level, reaction).quality(view, None, None)
    assert chosen == pytest.approx(min(1, max(0, level + reaction * (trust - 0.5))))


@given(either, unit, unit, unit)
def test_a_rater_lifts_sinks_and_follows(lift, following, seen, published):
    view = RaterView(
        *[np.array([0.0])] * 2, np.array([published]), np.array([seen]), *[np.array([0.0])] * 3
    )
    said, _ = StrategicRater(lift, following).ratings(view, None, None)
    moved = seen + lift * (1 - seen) if lift > 0 else seen * (1 + lift)
    assert said == pytest.approx((1 - following) * moved + following * published, abs=1e-12)


@given(either, unit)
def test_the_departure_of_a_rater_is_the_mean_over_a_grid(lift, following):
    grid = np.linspace(0, 1, 21)
    distances = []
    for seen in grid:
        for published in grid:
            moved = seen + lift * (1 - seen) if lift > 0 else seen * (1 + lift)
            distances.append(abs((1 - following) * moved + following * published - seen))
    assert departure("raters", np.array([[lift], [following]])) == pytest.approx(np.mean(distances))


def test_honest_play_departs_by_nothing_and_anything_else_by_something():
    for side, honest in HONEST.items():
        assert departure(side, np.array(honest)[:, None]) == [0]
        low, high = BOUNDS[side][0]
        other = low if honest[0] == high else high
        assert departure(side, np.array([[other], [honest[1]]])) > 0.3


def test_the_honest_population_plays_as_honest_agents_do():
    game = Game(SMALL, "role-trust")
    found = mean_rewards(game, honest_population(game, (1, 1)), (3,), (5,), rows=1)
    seed = int(np.random.SeedSequence((3,)).generate_state(1)[0])
    history = record(JointPolicy(game, {}), game.random(seed), (5,))
    np.testing.assert_allclose(found[:, 0], history.rewards.mean(axis=0), atol=1e-12)


def test_a_batch_of_populations_is_each_of_them_alone():
    game = Game(SMALL, "leave-one-out")
    population = random_population(game, (2, 3), seed=1)  # two rows in three games
    together = mean_rewards(game, population, (5,), (3,), rows=2)
    for row in range(2):
        alone = StrategyProfile(
            *(np.repeat(part[:, :, row, None], 2, axis=2) for part in population)
        )
        np.testing.assert_allclose(
            mean_rewards(game, alone, (5,), (3,), rows=2)[:, row], together[:, row]
        )


def test_welfare_is_what_consumers_get_less_what_it_costs():
    game = Game(SMALL, "beta")
    population = uniform_population(game, (0.6, 0.5), (0.3, 0.2), (1, 1))
    found = play(game, population, (7,), (4,), rows=1)
    seed = int(np.random.SeedSequence((7,)).generate_state(1)[0])
    seated = population._replace(
        **{name: part[:, :, 0] for name, part in population._asdict().items()}
    )
    history = record(seated.seated(game), game.random(seed), (4,))
    got, cost = np.zeros(4), np.zeros(4)
    for t in range(8):
        for g in range(4):
            trust = history.top[t - 1, :, g] if t else np.full(3, 0.5)
            best = np.flatnonzero(trust == trust.max())
            got[g] += history.offered[t, best, g].mean() / 8
            cost[g] += 0.1 * history.quality[t, :, g].mean() / 8
    np.testing.assert_allclose(found.welfare[0], got - cost, atol=1e-12)
    assert np.all(found.utility <= 1)


def test_a_strategy_plays_in_pettingzoo():
    env = parallel_env(SMALL)
    policies = {"sr_0": StrategicRater(0.5, 0.5), "sp_0": StrategicProvider(0.5, -1.0)}
    players = {name: Player(policy, name, env.layout) for name, policy in policies.items()}
    observations, _ = env.reset(seed=0)
    quality = players["sp_0"](observations["sp_0"])
    assert quality == pytest.approx([0.5])
    assert players["sr_0"](observations["sr_0"]).shape == (3,)


@pytest.mark.parametrize("preset", ["peers", "robots-that-move"])
def test_agents_with_both_roles_are_refused(preset):
    game = Game(make_scenario(preset).change(max_cycles=3))
    with refuses(ValueError, preset):
        honest_population(game, (1,)).seated(game)
