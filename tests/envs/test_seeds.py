"""Seeds, whole numbers and truth values of every entry: NumPy's are taken, and others get one
message."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Discrete
from pettingzoo.utils.conversions import parallel_to_aec
from refusals import refuses
from task_cases import PROVIDER, RATER, same

import roletrust_env
from roletrust_env import (
    AttackVecEnv,
    DiscretizeLevels,
    FixedAgents,
    Game,
    ParallelTransformAction,
    Player,
    RescaleClipAction,
    RoleVecEnv,
    TrustStream,
    env,
    evaluate,
    make_scenario,
    make_task,
    parallel_env,
)
from roletrust_env.evaluation.search import Budget
from roletrust_env.logs.log import read
from roletrust_env.logs.sources import Reading
from roletrust_env.testing import check_attack, check_trust_model

COMES_LATER = {
    "agents": [{"role": "SR", "count": 2}, {"role": "SP"}, {"role": "SP", "joins": 2}],
    "max_cycles": 3,
}


def many() -> list[Any]:
    """Every environment of many agents, also wrapped, and wrapped twice."""
    plain = lambda: parallel_env(**COMES_LATER)  # noqa: E731
    levels = lambda inner: ParallelTransformAction(inner, DiscretizeLevels, levels=np.int64(3))  # noqa: E731
    return [
        plain(),
        env(**COMES_LATER),
        FixedAgents(plain()),
        ParallelTransformAction(plain(), RescaleClipAction),
        levels(plain()),
        FixedAgents(levels(plain())),
        levels(FixedAgents(plain())),
        parallel_to_aec(levels(plain())),
    ]


def single() -> list[Any]:
    made = gymnasium.make(PROVIDER)
    vector = gymnasium.make_vec(RATER, num_envs=np.int64(2), max_episode_steps=np.int64(3))
    return [made, RescaleClipAction(made), DiscretizeLevels(made, np.uint8(3)), vector]


def test_a_seed_makes_the_actions_of_all_agents() -> None:
    for game in many():
        drawn = []
        for seed in (7, np.uint8(7), np.int64(7)):
            game.reset(seed=seed)
            drawn.append({name: game.action_space(name).sample() for name in game.possible_agents})
        assert same(drawn[0], drawn[1]), game
        assert same(drawn[0], drawn[2]), game
        game.reset(seed=8)
        others = {name: game.action_space(name).sample() for name in game.possible_agents}
        if isinstance(
            game.action_space("sr_0"), gymnasium.spaces.Box
        ):  # no agent acts as another one at the seed before
            assert not {action.tobytes() for action in drawn[0].values()} & {
                one.tobytes() for one in others.values()
            }
        game.reset(seed=np.uint8(255))  # the last agents have seeds beyond this type


def entries() -> dict[str, Callable[[Any], Any]]:
    """Every entry that has a seed, as a function of it."""
    task = make_task("paper-3x3", ("sp_2",), objective="exploit")
    game = Game(make_scenario("paper-3x3"), like=np.zeros((), np.float32))
    layout, honest = parallel_env().layout, roletrust_env.make_attacker("on-off")
    resets = {f"{one}": lambda seed, one=one: one.reset(seed=seed) for one in [*many(), *single()]}
    return resets | {
        "AttackVecEnv": lambda seed: AttackVecEnv(task, np.int64(2), seed=seed).reset(),
        "AttackVecEnv.seed": lambda seed: AttackVecEnv(task, 2).seed(seed),
        "RoleVecEnv": lambda seed: RoleVecEnv(game, "sr", np.int64(2), seed=seed).reset(),
        "Game.random": lambda seed: game.random(seed).uniform((3,)),
        "Player": lambda seed: Player(honest, "sp_0", layout, seed)._random.uniform((3,)),
        "evaluate": lambda seed: (
            evaluate("mean", "bad-mouthing", games=np.int64(1), seed=seed).damage.mean
        ),
    }


def test_numpys_numbers_are_seeds_and_others_get_one_message() -> None:
    for name, entry in entries().items():
        assert same(entry(3), entry(np.int64(3))), name
        for seed in (-1, np.int64(-1), 1.5, "3", True):
            with refuses(ValueError, "seed"):
                entry(seed)


def test_whole_numbers_may_be_numpys_and_fit() -> None:
    game, task = gymnasium.make(RATER), make_task("paper-3x3", ("sp_2",))
    takers: dict[str, Callable[[Any], Any]] = {
        "levels": lambda n: DiscretizeLevels(game, n, multidiscrete=True),
        "num_envs": lambda n: gymnasium.make_vec(RATER, num_envs=n),
        "max_episode_steps": lambda n: gymnasium.make_vec(RATER, num_envs=1, max_episode_steps=n),
        "games": lambda n: evaluate("mean", "bad-mouthing", games=n),
        "the budget": Budget,
        "workers": lambda n: n == 3 or roletrust_env.benchmark(["mean"], workers=n),
    }
    for name, take in takers.items():
        take(np.int64(3))
        for wrong in (-1, 2.5, "3", True):
            with refuses(ValueError, name, wrong):
                take(wrong)
    rules = Game(make_scenario("paper-3x3"), like=np.zeros((), np.float32))
    for make in (
        takers["num_envs"],
        lambda n: AttackVecEnv(task, n),
        lambda n: RoleVecEnv(rules, "sr", n),
    ):
        for many in (10**12, 2**70):
            with refuses(ValueError, f"{many:,}"):
                make(many)
    levels = DiscretizeLevels(game, np.int64(3), multidiscrete=True)
    assert gymnasium.make(gymnasium.envs.registration.EnvSpec.from_json(levels.spec.to_json()))


def test_truth_values_have_one_rule(tmp_path: Path) -> None:
    game, task, mean = (
        gymnasium.make(RATER),
        make_task("paper-3x3", ("sp_2",)),
        roletrust_env.make_trust_model("mean"),
    )
    takers: dict[str, Callable[[Any], Any]] = {
        "same_agents": lambda on: TrustStream(mean, same_agents=on).same_agents,
        "repeats": lambda on: TrustStream(mean, repeats=on).repeats,
        "keep_evidence": lambda on: TrustStream(mean, keep_evidence=on)._pairs is not None,
        "multidiscrete": lambda on: (
            DiscretizeLevels(game, 3, multidiscrete=on).action_space != Discrete(27)
        ),
        "scaled": lambda on: AttackVecEnv(task, 1, scaled=on).action_space.low.min() < 0,
        "header": lambda on: Reading(header=on).header,
    }
    for name, take in takers.items():
        assert [take(on) for on in ("no", 0, np.False_, True, 1, "yes")] == [False] * 3 + [
            True
        ] * 3, name
        for wrong in (
            "maybe",
            2,
            [],
            np.array([True, False]),
            math.nan,
            None,
        ):
            with refuses(ValueError, name):
                take(wrong)
    with refuses(ValueError, "maybe", "same_agents"):
        read({}, same_agents="maybe")
    for name in ("search", "progress"):
        with refuses(ValueError, "maybe", name):
            roletrust_env.benchmark(["mean"], workers=0, **{name: "maybe"})
    for check, what in (
        (check_trust_model, mean),
        (check_attack, roletrust_env.make_attacker("bad-mouthing")),
    ):
        with refuses(ValueError, "torch", "maybe"):
            check(what, torch="maybe")
