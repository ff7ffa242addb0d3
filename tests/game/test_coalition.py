"""What a coalition knows and decides, against a slow reference, and the task that offers it."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refuses

from roletrust_env import Actions, AttackVecEnv, make_scenario, make_task
from roletrust_env.envs.task_batch import TaskBatch
from roletrust_env.evaluation.attackers import OpenLoop, Scripted
from roletrust_env.evaluation.measurement import SEARCHED, mean_rewards
from roletrust_env.game.accounts import ACCOUNT_FEATURES
from roletrust_env.game.coalition import FEATURES, IDENTITY_FEATURES, REACH, Coalition
from roletrust_env.game.coalition_task import CoalitionTask
from roletrust_env.game.game import Game

WORLD = {
    "max_cycles": 8,
    "agents": [
        {"role": "SR", "count": 4, "noise": 0.1},
        {"role": "SP", "count": 3, "ability": [0.3, 1.0]},
    ],
}
TEAM = ("sr_2", "sr_3", "sp_2")


def task_of(compromised=TEAM, **arguments):
    options = {
        "objective": "mislead",
        "observation": "coalition",
        "like": np.zeros(()),
        **WORLD,
        **arguments,
    }
    return make_task("market", compromised, **options)


def play(task, decide, batch=(3,), seed=0):
    """Yield the state of a task in every round, its observation and the decision."""
    random = task.game.random(seed)
    state = task.start(task.game.draw(random, batch, start=True), random)
    rng = np.random.default_rng(seed)
    for _ in range(task.game.scenario.max_cycles):
        decision = decide(rng, task.action_size, batch)
        yield state, task.observe(state), decision
        state, _ = task.step(state, decision, task.game.draw(random, batch), random)


def at_random(rng, size, batch):
    return rng.random((size, *batch))


def ranks(values):
    """Return the rank of each value among P, 0 for the highest and 1 for the lowest, with loops."""
    p = len(values)
    return [
        sum(0.5 + 0.5 * np.sign(values[j] - v) for j in range(p) if j != i) / (p - 1)
        for i, v in enumerate(values)
    ]


@pytest.mark.parametrize("compromised", [TEAM, ("sr_3",), ("sp_1", "sp_2")])
def test_the_features_are_those_of_a_loop(compromised):
    task = task_of(compromised)
    raters = [int(name[3:]) for name in compromised if name.startswith("sr")]
    own = [int(name[3:]) for name in compromised if name.startswith("sp")]
    total, count = np.zeros((3, 3)), np.zeros((3, 3))
    before = np.full((3, 3), task.game.scenario.initial_trust)
    for state, seen, _ in play(task, at_random):
        game, found = state.game, seen.reshape(len(FEATURES), 3, 3)
        tor, exact = task.game.published(game)
        top = np.round(exact, 4)
        for g in range(3):
            known = [top[p, g] if raters or p in own else np.mean(top[own, g]) for p in range(3)]
            for p in range(3):
                for s in raters:
                    total[p, g] += game.service[s, p, g] * game.awaiting[s, p, g]
                    count[p, g] += game.awaiting[s, p, g]
            felt = [total[p, g] / count[p, g] if count[p, g] else known[p] for p in range(3)]
            for p in range(3):
                said = [game.ratings[s, p, g] for s in raters if game.rated[s, p, g]]
                expected = {
                    "published": known[p],
                    "published_rank": ranks(known)[p],
                    "published_change": np.clip(5 * (known[p] - before[p, g]), -1, 1),
                    "perceived": felt[p],
                    "perceived_rank": ranks(felt)[p],
                    "published_less_perceived": known[p] - felt[p],
                    "last_lie": np.mean(said) - felt[p] if said else 0,
                    "most_trusted": known[p] == max(known),
                    "lead": np.clip(10 * (known[p] - max(known[:p] + known[p + 1 :])), -1, 1),
                    "perceived_gap": max(felt) - felt[p],
                    "accomplice": p in own,
                    "served": any(game.awaiting[s, p, g] for s in raters),
                    "own_trust": np.mean(tor[raters, g] if raters else exact[own, g]),
                    "own_share": len(raters) / 4,
                    "clock": game.round[g] / 8,
                }
                for name, value in zip(FEATURES, found[:, p, g], strict=True):
                    assert value == pytest.approx(float(expected[name]), abs=1e-12), (name, p, g)
            before[:, g] = known


@pytest.mark.parametrize("compromised", [TEAM, ("sp_1", "sp_2")])
def test_the_features_of_accounts_are_those_of_a_loop(compromised):
    task = task_of(
        compromised, observation="accounts", access={"kind": "everyone"}, ratings={"lost": 0.5}
    )
    raters = [int(name[3:]) for name in compromised if name.startswith("sr")]
    own = [int(name[3:]) for name in compromised if name.startswith("sp")]
    heard = {(s, p, g): [] for s in range(4) for p in own for g in range(3)}
    given = np.zeros((4, len(own), 3))
    for state, seen, decision in play(task, at_random):
        game, known = state.game, state.coalition
        found = seen[len(FEATURES) * 3 :].reshape(len(ACCOUNT_FEATURES), 4, len(own), 3)
        for (s, p, g), ratings in heard.items():
            if game.rated[s, p, g]:
                ratings.append(game.ratings[s, p, g])
        for g in range(3):
            mean = {(s, p): np.mean(heard[s, p, g] or [0]) for s in range(4) for p in own}
            best = max(known.perceived[p, g] for p in range(3) if p not in own)
            for s in range(4):
                for k, p in enumerate(own):
                    count = [len(heard[other, p, g]) for other in range(4)]
                    expected = {
                        "account": mean[s, p],
                        "known": count[s] / (2 + count[s]),
                        "last": heard[s, p, g][-1] if count[s] else 0,
                        "lead": np.clip(2 * (mean[s, p] - best), -1, 1),
                        "own_lead": mean[s, p] - max(mean[s, other] for other in own),
                        "deviation": mean[s, p] - np.mean([mean[other, p] for other in range(4)]),
                        "voice": count[s] / max(1, *count),
                        "given": given[s, k, g],
                        "ally": s in raters,
                        "place": s / 3,
                    }
                    for name, value in zip(ACCOUNT_FEATURES, found[:, s, k, g], strict=True):
                        assert value == pytest.approx(float(expected[name]), abs=1e-12), (
                            name,
                            s,
                            p,
                            g,
                        )
        chosen = task.coalition.decision(decision)
        given = chosen.treatment * chosen.quality[None, own]
    assert (abs(found) <= 1).all()


def test_a_wide_coalition_is_silent_and_treats_each_rater():
    task = task_of(observation="accounts")
    flat = np.concatenate([np.full(3, 0.5), [1, 1, 0.8], [0.1, 0.9, 0.5], [0, 0.25, 0.5, 1]])
    assert task.action_size == len(flat)
    random = task.game.random(0)
    state = task.start(task.game.draw(random, (), start=True), random)
    actions, _ = task.joint(state, flat, random)
    assert np.array_equal(actions.withheld, [[False] * 3] * 2 + [[False, True, False]] * 2)
    assert np.array_equal(actions.treatment[:, 2], [0, 0.25, 0.5, 1])
    assert (actions.treatment[:, :2] == 1).all()
    assert actions.quality[2] == 0.8


def test_rounding_errors_decide_no_rank(monkeypatch):
    """All providers begin alike, and differences as of another order of a sum leave them alike."""
    task = task_of()
    random = task.game.random(0)
    state = task.start(task.game.draw(random, (3,), start=True), random)
    tor, top = task.game.published(state.game)
    alike = task.observe(state)
    monkeypatch.setattr(
        Game, "published", lambda game, state: (tor, top + 1e-8 * np.arange(3)[:, None])
    )
    other = task.coalition.features(
        state.game, task.coalition.remember(state.game, state.coalition)
    )
    np.testing.assert_allclose(other.reshape(alike.shape), alike, atol=1e-6)


def test_features_stay_in_their_bounds():
    task = task_of()
    for _, seen, _ in play(task, lambda rng, size, batch: rng.integers(0, 2, (size, *batch)) + 0.0):
        assert (abs(seen) <= 1).all()


@settings(max_examples=20, deadline=None)
@given(st.lists(st.floats(0, 1), min_size=6, max_size=6))
def test_a_decision_is_a_lie_about_each_provider_and_a_quality_of_each_accomplice(decision):
    task = task_of()
    coalition = Coalition(task.game, task.identities)
    for state, _, _ in play(task, at_random, (), seed=3):
        felt = state.coalition.perceived
        actions = coalition.actions(coalition.decision(np.asarray(decision)), state.coalition)
        for p in range(3):
            for s in range(4):
                assert actions.ratings[s, p] == np.clip(
                    felt[p] + REACH * (2 * decision[p] - 1), 0, 1
                )
        assert actions.quality[2] == decision[5]


def test_the_truth_has_less_noise_than_an_honest_rating():
    task = task_of(("sr_2", "sr_3"))
    *_, (state, _, _) = play(task, lambda rng, size, batch: np.full((size, *batch), 0.5), (200,))
    game, true = state.game, state.game.quality
    lie_ratings = task.coalition.actions(
        task.coalition.decision(np.full((3, 200), 0.5)), state.coalition
    ).ratings[0]
    assert abs(lie_ratings - true).mean() < 0.7 * abs(game.service[0] - true).mean()


@pytest.mark.parametrize("observation", ["coalition", "accounts"])
def test_every_game_of_a_batch_is_the_single_game(observation):
    task = task_of(observation=observation)
    random = task.game.random(1)
    noise = [
        task.game.draw(random, (4,), start=True),
        *(task.game.draw(random, (4,)) for _ in range(5)),
    ]
    rng = np.random.default_rng(0)
    decisions = rng.random((5, task.action_size, 4))

    def observed(pick):
        noises = [
            type(one)(*(None if part is None else pick(part) for part in one)) for one in noise
        ]
        state = task.start(noises[0], random)
        for decision, one in zip(decisions, noises[1:], strict=True):
            state, outcome = task.step(state, pick(decision), one, random)
        return task.observe(state), outcome.reward

    together = observed(lambda part: part)
    for g in range(4):
        for whole, single in zip(together, observed(lambda part, g=g: part[..., g]), strict=True):
            assert np.allclose(whole[..., g], single, atol=1e-12)


def test_it_plays_the_game_of_the_plain_task():
    """The same actions bring the same rewards, whatever is observed."""
    plain = make_task("market", TEAM, objective="mislead", like=np.zeros(()), **WORLD)
    honest = [
        mean_rewards(task, Scripted({}), 0, (1, 5), SEARCHED)[0] for task in (plain, task_of())
    ]
    assert np.array_equal(*honest)
    task, decision = task_of(), np.full((8, 6), 0.3)
    by_rollout = mean_rewards(task, OpenLoop(decision), 0, (1, 5), SEARCHED)[0]
    assert 0 < by_rollout.mean() < 1


def test_gymnasium_accepts_the_environment():
    env = gymnasium.make("RoleTrust/CollusionAttack-v0", observation="coalition", max_cycles=6)
    check_env(env.unwrapped, skip_render_check=True)
    assert env.observation_space.shape == (len(FEATURES) * 10,)
    assert env.action_space.shape == (20,)
    wide = gymnasium.make("RoleTrust/CollusionAttack-v0", observation="accounts", max_cycles=6)
    check_env(wide.unwrapped, skip_render_check=True)
    own = len(wide.unwrapped.task.coalition.providers)
    assert wide.observation_space.shape == (len(FEATURES) * 10 + len(ACCOUNT_FEATURES) * 10 * own,)
    assert wide.action_space.shape == (30 + 10 * own,)


def test_a_game_that_restarts_alone_forgets_alone():
    task = task_of()
    batch, random = TaskBatch(task, (3,)), task.game.random(0)
    batch.restart(random)
    for _ in range(4):
        batch.step(np.full((6, 3), 0.2), random)
    count = batch.state.coalition.count.copy()
    batch.restart(random, np.asarray([False, True, False]))
    assert (batch.state.coalition.count[:, 1] == 0).all()
    assert (batch.state.coalition.count[:, [0, 2]] == count[:, [0, 2]]).all()


def test_stable_baselines_gets_the_same_observations():
    env = AttackVecEnv(task_of(like=np.zeros((), np.float32)), 5, seed=0)
    seen = env.reset()
    assert seen.shape == (5, len(FEATURES) * 3)
    seen, rewards, _, _ = env.step(np.zeros((5, 6), np.float32))
    assert env.observation_space.contains(seen[0])
    assert rewards.shape == (5,)


@pytest.mark.parametrize("arguments", [{"observation": "team"}, {"knowledge": "white_box"}])
def test_what_it_cannot_be_is_refused(arguments):
    with refuses(ValueError, *arguments.values()):
        task_of(**arguments)


def test_identities_are_seen_and_called():
    groups = [
        {"role": "SR", "count": 3, "noise": 0.1},
        {"role": "SR", "count": 1, "noise": 0.1, "reserve": 2},
        {"role": "SP", "count": 3, "ability": [0.3, 1.0]},
    ]
    scenario = make_scenario("market").change(max_cycles=6, agents=groups)
    task = make_task(scenario, ("sr_3",), objective="mislead", like=np.zeros(()))
    coalition = Coalition(task.game, task.identities)
    one = [groups[0], groups[1] | {"reserve": 1}, groups[2]]
    for agents, has in (
        (groups, True),
        (one, True),
        ([*groups[:1], groups[1] | {"reserve": 0}, groups[2]], False),
    ):
        other = make_task(
            scenario.change(agents=agents), ("sr_3",), objective="mislead", like=np.zeros(())
        )
        assert Coalition(other.game, other.identities).has_reserve is has
    random = task.game.random(0)
    state = task.start(task.game.draw(random, (2,), start=True), random)
    chosen = np.asarray([[True, True], [True, False], [False, False]])
    wanted = coalition.wanted(chosen)
    assert wanted.shape == (task.game.roster.n_agents, 2)
    actions = Actions(0 * state.game.quality + 1, 0 * state.game.ratings, presence=wanted)
    for _ in range(2):
        state, _ = task.step(state, actions, task.game.draw(random, (2,)), random)
    features = dict(zip(IDENTITY_FEATURES, coalition.identity_features(state.game), strict=True))
    assert np.array_equal(features["present"], chosen)
    assert np.array_equal(features["turn"][:, 0], [0, 0.5, 1])
    assert (features["clock"] == 2 / 6).all()
    assert not features["provides"].any()
    assert not features["succeeds"].any()


def test_the_state_of_another_task_is_refused():
    plain = make_task("market", TEAM, objective="mislead", like=np.zeros(()), **WORLD)
    random = plain.game.random(0)
    state = plain.start(plain.game.draw(random, (), start=True), random)
    with refuses(ValueError, "state"):
        CoalitionTask(plain.game, TEAM, objective="mislead").observe(state)
