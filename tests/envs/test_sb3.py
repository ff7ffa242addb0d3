import numpy as np
import pytest
from refusals import refuses

pytest.importorskip("stable_baselines3")

import gymnasium
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import DummyVecEnv, VecFrameStack, VecMonitor, VecNormalize

from roletrust_env import Game, Policy, make_scenario, parallel_env
from roletrust_env.envs.attack_env import TASKS
from roletrust_env.envs.sb3 import AttackVecEnv, RoleVecEnv
from roletrust_env.game.make_task import make_task

SHORT = {"scenario": "paper-3x3", "max_cycles": 5}


def provider(games=4, *, scaled=True, seed=None, **rules):
    task = make_task(**{**SHORT, **rules}, compromised=("sp_2",), objective="exploit")
    return AttackVecEnv(task, games, scaled=scaled, seed=seed)


def actions_of(env, rounds, seed=0):
    shape = (rounds, env.num_envs, *env.action_space.shape)
    return np.random.default_rng(seed).uniform(env.action_space.low[0], 1, shape).astype(np.float32)


@pytest.mark.parametrize("scaled", [True, False])
def test_it_plays_what_gymnasiums_batch_plays(scaled):
    env = provider(scaled=scaled, seed=7)
    other = gymnasium.make_vec(
        "RoleTrust/ProviderAttack-v0",
        4,
        **SHORT,
        like=np.zeros((), np.float32),
        autoreset_mode=gymnasium.vector.AutoresetMode.SAME_STEP,
    )
    assert (env.reset() == other.reset(seed=7)[0]).all()
    for actions in actions_of(env, 12):
        a = env.step(actions)
        b = other.step(actions / 2 + 0.5 if scaled else actions)
        assert (a[0] == b[0]).all()
        assert a[0].dtype == np.float32
        assert (a[1] == b[1]).all()
        assert (a[2] == (b[2] | b[3])).all()
        if a[2].any():
            final = [info["terminal_observation"] for info in a[3]]
            assert (np.stack(final) == np.stack(list(b[4]["final_obs"]))).all()


def test_the_end_of_a_game():
    env = provider(seed=0)
    first = env.reset()
    total = np.zeros(4)
    for i, actions in enumerate(actions_of(env, 10)):
        observation, rewards, dones, infos = env.step(actions)
        total += rewards
        last = i % 5 == 4
        assert (dones == last).all()
        for game, info in enumerate(infos):
            assert set(info) == {"objective", "cost", "trust", "honest_trust"} | (
                {"terminal_observation", "TimeLimit.truncated", "episode"} if last else set()
            )
            if last:
                assert info["TimeLimit.truncated"]
                assert info["terminal_observation"][0] == 1
                assert info["episode"]["r"] == pytest.approx(total[game])
                assert info["episode"]["l"] == 5
                assert info["episode"]["t"] > 0
        if last:
            assert (observation == first).all()
            total[:] = 0


def test_who_is_cut_off_is_terminated_and_the_others_go_on():
    env = provider(64, max_cycles=60, admission={"threshold": 0.3, "rounds": 2}, noise=0.2, seed=0)
    env.reset()
    ends = []
    for actions in actions_of(env, 60):
        _, _, dones, infos = env.step(actions * 0.5 - 0.5)
        ends += [info for done, info in zip(dones, infos, strict=True) if done]
    assert {info["episode"]["l"] for info in ends} > {60} or len(
        {info["episode"]["l"] for info in ends}
    ) > 2
    assert all(info["TimeLimit.truncated"] == (info["episode"]["l"] == 60) for info in ends)


def test_the_same_seed_is_the_same_luck():
    runs = []
    for _ in range(2):
        env = provider(noise=0.1)
        env.seed(3)
        env.reset()
        runs.append([env.step(actions)[0] for actions in actions_of(env, 7)])
    assert np.array_equal(*runs)
    env.seed(4)
    env.reset()
    assert not np.array_equal(runs[0], [env.step(actions)[0] for actions in actions_of(env, 7)])


@pytest.mark.parametrize("bad", [np.nan, 1.5, -1.5])
def test_bad_actions_are_refused_and_change_nothing(bad):
    env = provider(seed=0)
    env.reset()
    with refuses(ValueError, "action", "[-1, 1]"):
        env.step(np.full((4, 1), bad, np.float32))
    with refuses(ValueError, "action", "(4, 1)"):
        env.step(np.zeros((4, 2), np.float32))
    assert env.step(np.zeros((4, 1), np.float32))[0][0, 0] == pytest.approx(0.2)


def test_what_is_refused_at_the_beginning():
    torch = pytest.importorskip("torch")
    with refuses(ValueError, "Tensor", "NumPy"):
        AttackVecEnv(make_task("paper-3x3", ("sp_2",), like=torch.zeros(())), 4)
    with refuses(ValueError, "num_envs", "0"):
        provider(0)


def test_sb3_finds_all_it_asks_for():
    env = provider()
    assert env.get_attr("render_mode", [0, 2]) == [None, None]
    assert env.get_attr("render_mode", 1) == [None]
    assert env.metadata["autoreset_mode"] is gymnasium.vector.AutoresetMode.SAME_STEP
    for word, refused in (
        ("x", lambda: env.set_attr("x", 1, [0])),
        ("reset()", lambda: env.env_method("reset")),
        ("step()", lambda: env.env_method("step")),
    ):
        with refuses(NotImplementedError, word):
            refused()
    env.close()


def test_its_slots_answer_as_those_of_sb3s_own():
    """Who asks for the environments of a `DummyVecEnv` gets the same of it."""
    env = provider()
    own = DummyVecEnv([lambda: TASKS["RoleTrust/ProviderAttack-v0"](**SHORT)] * 4)
    for name in ("spec", "render_mode", "observation_space"):
        assert env.get_attr(name) == own.get_attr(name)
        assert env.get_attr(name, [0, 2]) == own.get_attr(name, [0, 2])
    for name, known in (("task", True), ("action_masks", False)):
        assert env.has_attr(name) == own.has_attr(name) == known
    for one in (env, own):
        one.set_attr("phase", 3)
        assert one.get_attr("phase", 1) == [3]
        assert one.env_is_wrapped(VecNormalize) == [False] * 4
        with pytest.raises(AttributeError):
            one.env_method("no_such_method")
        with pytest.raises(IndexError):
            one.get_attr("spec", 4)
    own.close()


def test_lists_are_actions_too():
    env, twin = provider(seed=0), provider(seed=0)
    for one in (env, twin):
        one.reset()
    for actions in actions_of(env, 3):
        assert (env.step(actions.tolist())[0] == twin.step(actions)[0]).all()
    for bad in ([["0.5"]] * 4, [[None]] * 4, [[0.5], [0.5, 0.5], [0.5], [0.5]]):
        with refuses(ValueError, "action", "(4, 1)"):
            env.step(bad)


@pytest.mark.filterwarnings("ignore:The environment is already wrapped with a `Monitor`")
def test_wrappers_of_sb3_fit():
    env = VecNormalize(VecFrameStack(VecMonitor(provider(seed=0)), 2))
    assert env.reset().shape == (4, 20)
    for actions in actions_of(provider(), 5):
        *_, dones, infos = env.step(actions)
    assert dones.all()
    assert all(info["episode"]["l"] == 5 for info in infos)


@pytest.mark.parametrize("task_id", TASKS)
@pytest.mark.parametrize("knowledge", ["black_box", "white_box"])
def test_ppo_learns_on_every_task(task_id, knowledge, recwarn):
    task = make_task(**{**TASKS[task_id].defaults, "max_cycles": 6, "knowledge": knowledge})
    env = AttackVecEnv(task, 8)
    model = PPO("MlpPolicy", env, n_steps=8, batch_size=32, n_epochs=1, seed=0, device="cpu").learn(
        64
    )
    mean, _ = evaluate_policy(model, env, n_eval_episodes=8)
    assert np.isfinite(mean)
    assert not [w for w in recwarn if "Monitor" in str(w.message)]


def role_env(role, scenario="paper-3x3", games=3, **options):
    rules = make_scenario(scenario).change(max_cycles=5, noise=0.0)
    return RoleVecEnv(Game(rules, like=np.zeros((), np.float32)), role, games, **options)


@pytest.mark.parametrize(
    ("role", "scenario"), [("sr", "paper-3x3"), ("sp", "paper-3x3"), ("srsp", "peers")]
)
def test_each_agent_of_the_role_is_a_slot(role, scenario):
    """Every slot has the observation, action and reward of its agent in the PettingZoo game."""
    env, games = role_env(role, scenario), 3
    pettingzoo = parallel_env(env.game.scenario)
    n = len(env.agents)
    assert env.num_envs == n * games
    for game in range(games):
        seen = env.reset()
        observations, _ = pettingzoo.reset(seed=0)
        for actions in actions_of(env, 5, game):
            slots = {agent: i * games + game for i, agent in enumerate(env.agents)}
            joint = {}
            for agent in pettingzoo.agents:
                if agent in slots:
                    assert np.allclose(seen[slots[agent]], observations[agent], atol=1e-6)
                    joint[agent] = actions[slots[agent]] / 2 + 0.5
                elif agent.startswith("sp"):
                    joint[agent] = np.ones(1, np.float32)
                else:
                    joint[agent] = pettingzoo.layout.rater(observations[agent]).service.astype(
                        np.float32
                    )
            seen, rewards, dones, infos = env.step(actions)
            observations, expected, *_ = pettingzoo.step(joint)
            assert np.allclose(
                [rewards[k] for k in slots.values()], [expected[a] for a in slots], atol=1e-6
            )
        assert dones.all()
        assert all(info["TimeLimit.truncated"] and info["episode"]["l"] == 5 for info in infos)


def test_others_play_as_they_are_told():
    class Bad(Policy):
        attacks = frozenset({"quality"})

        def quality(self, view, memory, random):
            return 0 * view.trust, memory

    honest, bad = role_env("sr"), role_env("sr", others={"sp_0": Bad()})
    for env in (honest, bad):
        env.reset()
    still = np.ones((9, 3), np.float32)
    assert (honest.step(still)[0][:, 5] == 1).all()
    assert (bad.step(still)[0][:, 5] == 0).all()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"role": "judge"}, ("role", "judge")),
        ({"role": "srsp"}, ("paper-3x3", "srsp")),
        ({"role": "sr", "scenario": "open-system"}, ("open-system",)),
        ({"role": "sr", "others": {"sr_0": Policy()}}, ("sr_0",)),
        ({"role": "sr", "games": 0}, ("games", "0")),
    ],
)
def test_roles_that_cannot_be_slots_are_refused(options, words):
    with refuses(ValueError, *words):
        role_env(**options)


def test_one_policy_learns_for_all_raters():
    env = role_env("sr")
    PPO("MlpPolicy", env, n_steps=10, batch_size=30, n_epochs=1, seed=0, device="cpu").learn(90)


@pytest.mark.parametrize("games", [0, -1, 2.5, "3", True, None])
def test_a_wrong_number_of_games_is_refused(games):
    with refuses(ValueError, "num_envs", "1"):
        provider(games)
    with refuses(ValueError, "games", "1"):
        role_env(role="sr", games=games)


def test_a_slot_that_is_not_there_is_named():
    with refuses(IndexError, "slot", "4", "0"):
        provider().get_attr("spec", 4)


def test_infos_have_the_trust_of_the_compromised_and_of_the_honest():
    """As published after the round, of the same game that a batch of Gymnasium plays."""
    task = make_task("open-system", ("sr_0", "sp_1"), max_cycles=40)
    env = AttackVecEnv(task, 5, seed=3)
    env.reset()
    names = task.game.roster.names
    for actions in actions_of(env, 30):
        *_, infos = env.step(actions)
        state = env._batch.games
        trust, present = task.game.agent_trust(state), task.game.present(state)
        for game, info in enumerate(infos):
            assert info["trust"] == {
                name: trust[names.index(name), game] for name in ("sr_0", "sp_1")
            }
            honest = [
                i
                for i, name in enumerate(names)
                if name not in ("sr_0", "sp_1") and present[i, game]
            ]
            assert info["honest_trust"] == pytest.approx(trust[honest, game].mean(), abs=1e-6)


def test_an_environment_for_sb3_shows_itself():
    env = provider()
    assert repr(env).startswith(
        "AttackVecEnv('paper-3x3', RoleTrust(lam=0.5, initial=0.5), agents: 3 SR + 3 SP, rounds: 5"
    )
    env.reset()
    assert "<img" in env._repr_html_()
