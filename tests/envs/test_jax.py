"""Environments on JAX play the rules of all others: beside NumPy in double precision, with the same
noise."""

import numpy as np
import pytest
from refusals import refuses

import roletrust_env
from roletrust_baselines import BadMouthing, RandomRating, Silent
from roletrust_env.envs.attack_env import TASKS
from roletrust_env.game.game import Game
from roletrust_env.game.make_task import make_task
from roletrust_env.game.state import Actions
from roletrust_env.trust import Ratings
from roletrust_env.trust.model import start_model
from roletrust_env.world.presence import PRESENT

jax = pytest.importorskip("jax")
jnp = jax.numpy
pytestmark = pytest.mark.slow  # a compiler takes seconds for each model

from roletrust_env.envs.jax_env import _KeyRandom, _words  # noqa: E402

AttackJaxEnv, RoleTrustJaxEnv = roletrust_env.AttackJaxEnv, roletrust_env.RoleTrustJaxEnv
PRESETS = ["robots-that-move", "open-system", "market", "subjective"]
DRIFTING = roletrust_env.Scenario(
    agents=[
        {"role": "SR", "count": 4},
        {"role": "SP", "count": 3, "ability": (0.2, 0.9), "drift": 0.2, "switch": 0.2},
    ]
)


@pytest.fixture
def double():
    with jax.enable_x64(True):
        yield


def words(key):
    """The words of the noise that an environment makes from a key, (STREAMS, 4)."""
    return np.asarray(_KeyRandom(_words(key), jnp.zeros(())).round_key()).view(np.uint32)


def both_play(scenario, model="role-trust", rounds=6):
    """Yield (observations, rewards, dones, state) of JAX with what NumPy has, round by round, with
    random actions."""
    env = RoleTrustJaxEnv(scenario, model, max_cycles=rounds)
    game, step, rng = (
        Game(env.game.scenario, model),
        jax.jit(env.step_env),
        np.random.default_rng(0),
    )
    roster, key = game.roster, jax.random.key(7)
    _, theirs = jax.jit(env.reset)(key)
    ours = game.start(game.noise(words(key), start=True))
    for t in range(rounds):
        key = jax.random.fold_in(key, t)
        actions = {agent: rng.random(space.shape) for agent, space in env.action_spaces.items()}
        seen, theirs, rewards, dones, infos = step(key, theirs, actions)
        quality = np.array([actions[name][0] for name in roster.provider_names])
        ratings = np.array([actions[name][-roster.n_providers :] for name in roster.rater_names])
        before = ours
        ours, earned = game.step(ours, Actions(quality, ratings), game.noise(words(key)))
        yield env, (seen, rewards, dones, infos, theirs), (game, before, ours, earned)


@pytest.mark.parametrize("scenario", [*PRESETS, DRIFTING], ids=[*PRESETS, "drifting"])
def test_every_preset_is_equal_to_numpy(scenario, double):
    for env, (seen, rewards, dones, infos, _), (game, before, ours, earned) in both_play(scenario):
        expected = [
            column for part in game.observations(ours) if part is not None for column in part.T
        ]
        present = (
            np.ones(len(env.agents), bool)
            if ours.population is None
            else ours.population.phase == PRESENT
        )
        there = present if before.population is None else before.population.phase == PRESENT
        np.testing.assert_allclose(
            [rewards[agent] for agent in env.agents], np.where(there, earned, 0), atol=1e-12
        )
        np.testing.assert_array_equal(infos["present"], present)
        np.testing.assert_allclose(infos["trust"], game.agent_trust(ours), atol=1e-12)
        gone = (
            np.zeros(len(present), bool)
            if ours.population is None
            else ours.population.phase > PRESENT
        )
        over = ours.round == 6 or not present.any()
        assert [bool(dones[agent]) for agent in [*env.agents, "__all__"]] == [*(gone | over), over]
        for agent, one in zip(env.agents, expected, strict=True):
            np.testing.assert_allclose(seen[agent], one, atol=1e-12)


@pytest.mark.parametrize("model", roletrust_env.trust_models())
def test_every_model_is_equal_to_numpy(model, double):
    model, rng = roletrust_env.make_trust_model(model), np.random.default_rng(0)
    ratings, masks = rng.random((3, 4, 3)), rng.random((3, 4, 3)) < 0.7

    def trusts(xp):
        def play(ratings, masks):
            state = start_model(model, ratings[0], xp.zeros((4, 3), dtype=bool))
            for values, mask in zip(ratings, masks, strict=True):
                state = model.update(state, Ratings(values, mask))
            return model.rater_trust(state), model.provider_trust(state)

        return play

    theirs = jax.jit(trusts(jnp), compiler_options={"xla_backend_optimization_level": 0})(
        ratings, masks
    )
    for one, other in zip(theirs, trusts(np)(ratings, masks), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)


MARKET = {
    "agents": [{"role": "SR", "count": 4, "noise": 0.1}, {"role": "SP", "count": 5}],
    "access": {"kind": "choice", "providers": 2, "by": "own", "explore": 0.3},
}
REPORTS = [
    {
        "scenario": roletrust_env.Scenario(**MARKET, ratings=ratings),
        "compromised": ["sr_3", "sp_4"],
        "observation": "accounts",
        "others": {"sr_0": BadMouthing(level=0.1), "sr_1": Silent()},
    }
    for ratings in ({"deadline": 3, "lost": 0.2}, {"open": 3, "deadline": 2, "late": 0.3})
]


@pytest.mark.parametrize(
    ("task_id", "fields"),
    [
        *((task_id, {}) for task_id in TASKS),
        *(("RoleTrust/CollusionAttack-v0", fields) for fields in REPORTS),
    ],
)
def test_tasks_are_equal_to_numpy(task_id, fields, double):
    env, key, rng = (
        AttackJaxEnv(task_id, max_cycles=4, **fields),
        jax.random.key(1),
        np.random.default_rng(1),
    )
    task = make_task(**{**TASKS[task_id].defaults, **fields, "max_cycles": 4, "like": np.zeros(())})
    random, step = task.game.random(0), jax.jit(env.step_env)
    seen, theirs = jax.jit(env.reset)(key)
    ours = task.start(task.game.noise(words(key), start=True), random)
    for t in range(4):
        np.testing.assert_allclose(seen["attacker"], task.observe(ours), atol=1e-12)
        action, key = rng.random(task.action_size), jax.random.fold_in(key, t)
        seen, theirs, rewards, dones, infos = step(key, theirs, {"attacker": action})
        ours, outcome = task.step(ours, action, task.game.noise(words(key)), random)
        np.testing.assert_allclose(rewards["attacker"], outcome.reward, atol=1e-12)
        np.testing.assert_allclose(infos["objective"], outcome.objective, atol=1e-12)
        np.testing.assert_allclose(infos["cost"], outcome.cost, atol=1e-12)
        assert bool(dones["__all__"]) == (t == 3)


@pytest.mark.parametrize("scenario", ["paper-3x3", "open-system", "robots-that-move"])
def test_a_batch_is_equal_to_its_games(scenario, double):
    env, keys = RoleTrustJaxEnv(scenario, max_cycles=3), jax.random.split(jax.random.key(5), 3)
    actions = {agent: jnp.full(space.shape, 0.7) for agent, space in env.action_spaces.items()}

    def play(reset, step):
        (seen, state), rounds = reset(keys), []
        for t in range(4):  # one episode and the first round of another
            seen, state, *outcome = step(
                jax.vmap(lambda key, t=t: jax.random.fold_in(key, t))(keys), state
            )
            rounds.append((seen, state, outcome))
        return rounds

    def together(key, state):
        return jax.vmap(env.step, in_axes=(0, 0, None))(key, state, actions)

    def one_by_one(key, state):
        return jax.lax.map(lambda both: env.step(*both, actions), (key, state))

    batch = play(jax.jit(jax.vmap(env.reset)), jax.jit(together))
    games = play(jax.jit(lambda keys: jax.lax.map(env.reset, keys)), jax.jit(one_by_one))
    jax.tree.map(
        lambda one, other: np.testing.assert_allclose(one, other, atol=1e-12), batch, games
    )


def test_derivatives_pass_through_a_batch(double):
    env, keys = RoleTrustJaxEnv("paper-3x3", max_cycles=5), jax.random.split(jax.random.key(2), 3)
    still = {agent: jnp.full(space.shape, 0.9) for agent, space in env.action_spaces.items()}

    def trust(level, key):
        state = env.reset(key)[1]
        for t in range(2):
            step = env.step(jax.random.fold_in(key, t), state, still | {"sr_2": jnp.full(3, level)})
            state = step[1]
        return step[4]["trust"][0]

    slopes = jax.jit(jax.vmap(jax.grad(trust), in_axes=(None, 0)))(0.4, keys)
    trusts = jax.jit(jax.vmap(jax.vmap(trust, in_axes=(None, 0)), in_axes=(0, None)))
    low, high = trusts(jnp.asarray([0.4 - 1e-6, 0.4 + 1e-6]), keys)
    np.testing.assert_allclose(slopes, (high - low) / 2e-6, rtol=1e-6)
    assert (slopes > 0).all()
    of_batch = jax.grad(lambda levels: jax.vmap(trust)(levels, keys).sum())(jnp.full(3, 0.4))
    np.testing.assert_allclose(of_batch, slopes, rtol=1e-9)


def test_the_quick_start_of_jaxmarl_runs():
    env = RoleTrustJaxEnv("open-system", max_cycles=4)
    _, key_reset, key_act, key_step = jax.random.split(jax.random.key(0), 4)
    _, state = env.reset(key_reset)
    key_act = jax.random.split(key_act, env.num_agents)
    actions = {a: env.action_space(a).sample(key_act[i]) for i, a in enumerate(env.agents)}
    seen, state, *_ = env.step(key_step, state, actions)
    for agent in env.agents:
        assert env.action_space(agent).contains(actions[agent])
        assert env.observation_space(agent).contains(seen[agent])
    classes = env.agent_classes
    assert [agent for agents in classes.values() for agent in agents] == env.agents
    for agents in classes.values():
        assert len({env.observation_space(a).shape for a in agents}) == 1
    available = env.get_avail_actions(state)
    present = np.asarray(env.game.present(state))
    assert not present.all()
    for agent, there in zip(env.agents, present, strict=True):
        assert available[agent].shape == env.action_space(agent).shape
        assert bool(available[agent].all()) == bool(available[agent].any()) == there


def test_an_episode_may_begin_with_a_given_state():
    env = RoleTrustJaxEnv("paper-3x3", max_cycles=2)
    keys = jax.random.split(jax.random.key(1), 3)
    still = {agent: jnp.ones(space.shape) for agent, space in env.action_spaces.items()}
    _, first = env.reset(keys[0])
    step = jax.jit(env.step)
    seen, after, _, dones, _ = step(keys[1], first, still, first)
    assert not dones["__all__"]
    assert after.round == 1
    seen, after, _, dones, _ = step(keys[2], after, still, first)
    assert dones["__all__"]
    jax.tree.map(np.testing.assert_array_equal, after, first)
    np.testing.assert_array_equal(seen["sr_0"], env.get_obs(first)["sr_0"])


def test_a_state_has_a_text_whatever_its_leaves_are():
    env = RoleTrustJaxEnv("peers", max_cycles=2)
    key = jax.random.key(0)
    _, state = env.reset(key)
    texts = [repr(jax.eval_shape(env.reset, key)[1]), repr(jax.tree.map(jnp.shape, state))]
    jax.jit(lambda state: texts.append(repr(state)) or state.round)(state)
    states = jax.vmap(lambda key: env.reset(key)[1])(jax.random.split(key, 2))
    jax.vmap(lambda state: texts.append(repr(state)) or state.round)(states)
    texts += [repr(states), repr(jax.tree.map(lambda _: None, state))]
    assert all(text.startswith("State(") for text in texts)


def test_an_episode_follows_another_in_one_scan():
    env = RoleTrustJaxEnv("paper-3x3", max_cycles=3)
    still = {agent: jnp.ones(space.shape) for agent, space in env.action_spaces.items()}

    def play(state, key):
        seen, after, _, dones, _ = env.step(key, state, still)
        return after, (after.round, dones["__all__"], seen["sr_0"])

    def episodes(key):
        return jax.lax.scan(play, env.reset(key)[1], jax.random.split(key, 7))[1]

    rounds, over, seen = jax.jit(jax.vmap(episodes))(jax.random.split(jax.random.key(0), 5))
    assert rounds.tolist() == [[1, 2, 0, 1, 2, 0, 1]] * 5
    assert over.tolist() == [[False, False, True] * 2 + [False]] * 5
    assert len({tuple(row) for row in np.asarray(seen[:, 0]).tolist()}) == 5  # games differ
    assert not np.array_equal(seen[:, 0], seen[:, 3])  # episodes differ
    np.testing.assert_array_equal(seen[:, 2, 0], 0)  # the clock begins again
    assert env.observation_space("sr_0").contains(np.asarray(seen[0, 1]))


def test_actions_are_clipped_and_scripted_others_play():
    others = {"sr_0": RandomRating(), "sr_1": BadMouthing(targets=(0,))}
    env = AttackJaxEnv(max_cycles=5, others=others)
    key, step = jax.random.key(3), jax.jit(env.step)
    _, state = jax.jit(env.reset)(key)
    outcomes = [
        step(key, state, {"attacker": jnp.full(1, value)}) for value in (2.0, 1.0, np.nan, 0.0)
    ]
    for one, other in (outcomes[:2], outcomes[2:]):
        np.testing.assert_array_equal(one[0]["attacker"], other[0]["attacker"])
    again = step(jax.random.key(4), outcomes[1][1], {"attacker": jnp.ones(1)})
    assert again[1].game.ratings[0].tolist() != outcomes[1][1].game.ratings[0].tolist()


def test_actions_of_another_shape_and_missing_ones_are_refused():
    env = RoleTrustJaxEnv(max_cycles=3)
    key, still = (
        jax.random.key(0),
        {agent: np.ones(space.shape) for agent, space in env.action_spaces.items()},
    )
    _, state = env.reset(key)
    for agent, wrong in (
        ("sp_0", np.ones(3)),
        ("sp_0", 0.5),
        ("sr_0", np.ones(7)),
        ("sr_0", np.ones((3, 1))),
    ):
        with refuses(ValueError, agent):
            env.step(key, state, still | {agent: wrong})
    with refuses(ValueError, "sr_0"):
        jax.jit(env.step)(key, state, {})
    listed = env.step_env(key, state, {agent: action.tolist() for agent, action in still.items()})
    np.testing.assert_array_equal(listed[0]["sr_0"], env.step_env(key, state, still)[0]["sr_0"])


def test_what_jax_cannot_play_is_refused():
    class Branching(type(roletrust_env.make_trust_model("mean"))):
        def update(self, state, ratings):
            return super().update(state, ratings) if ratings.values.sum() >= 0 else state

    with refuses(ValueError, "Branching"):
        RoleTrustJaxEnv(trust_model=Branching())
    with refuses(ValueError, "joins"):
        RoleTrustJaxEnv(agents=[{"role": "SR", "joins": 2}, {"role": "SP", "joins": 2}])
    with refuses(ValueError, "NumPy"):
        RoleTrustJaxEnv("paper-3x3-hog")
    with refuses(ValueError, "RoleTrust/Rater-v0"):
        AttackJaxEnv("RoleTrust/Rater-v0")
    with refuses(TypeError, "max_cycle"):
        RoleTrustJaxEnv(max_cycle=3)
    with refuses(ValueError, "sr_9"):
        RoleTrustJaxEnv().action_space("sr_9")


def test_a_condition_may_differ_by_game():
    env = RoleTrustJaxEnv(
        roletrust_env.Scenario(agents=[{"role": "SR"}, {"role": "SP"}], max_cycles=3), "mean"
    )
    keys = jax.random.split(jax.random.key(0), 3)
    _, states = jax.vmap(env.reset)(keys)
    actions = {agent: jnp.full((3, 1), 0.4) for agent in env.agents}
    plays = jnp.array([True, False, True])

    def perhaps(plays, key, state, actions):
        return jax.lax.cond(plays, lambda: env.step_env(key, state, actions)[1], lambda: state)

    after = jax.jit(jax.vmap(perhaps))(plays, keys, states, actions)
    assert after.round.tolist() == [1, 0, 1]


@pytest.mark.parametrize("make", [RoleTrustJaxEnv, AttackJaxEnv])
def test_games_end_at_random_and_have_the_same_rounds_until_then(make):
    goes_on, most, games = 0.8, 6, 2000
    env, endless = (make(max_cycles=most, continuation=c) for c in (goes_on, 1.0))
    keys = jax.random.split(jax.random.key(0), games)
    seen, state = jax.vmap(env.reset)(keys)
    _, other = jax.vmap(endless.reset)(keys)
    actions = {
        agent: jnp.full((games, *space.shape), 0.3) for agent, space in env.action_spaces.items()
    }
    steps = [jax.jit(jax.vmap(one.step)) for one in (env, endless)]
    playing, length = np.ones(games, bool), np.zeros(games, int)
    for t in range(most):
        keys = jax.vmap(jax.random.fold_in, (0, None))(keys, t)
        seen, state, rewards, dones, _ = steps[0](keys, state, actions)
        expected, other, paid, _, _ = steps[1](keys, other, actions)
        length += playing
        over = np.asarray(dones["__all__"])
        for agent in env.agents:
            np.testing.assert_allclose(rewards[agent][playing], paid[agent][playing], atol=1e-6)
            assert np.all(np.asarray(dones[agent]) == over)
            assert np.all(np.asarray(seen[agent])[over, 0] == 0)  # the clock of a new game
            going = playing & ~over
            np.testing.assert_allclose(seen[agent][going], expected[agent][going], atol=1e-6)
        playing &= ~over
    assert not playing.any()
    assert abs(length.mean() - env.game.scenario.mean_length) < 4 * length.std() / games**0.5
    assert length.max() == most


def test_agents_that_share_a_policy_draw_numbers_of_their_own():
    others = {"sr_0": RandomRating(), "sr_1": RandomRating()}
    env = AttackJaxEnv("RoleTrust/RaterAttack-v0", others=others)
    _, state = env.reset(jax.random.key(0))
    actions = {"attacker": jnp.zeros(env.action_space("attacker").shape)}
    for _ in range(3):
        _, state, *_ = env.step(jax.random.key(1), state, actions)
    ratings = np.asarray(state.game.ratings)
    assert len(np.unique(ratings[:2])) == 6
