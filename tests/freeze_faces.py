"""The cases of `freeze.py` for environments: all that a user is handed in seeded episodes."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import roletrust_env as rt

Case = tuple[str, Callable[[], Any]]
"""The name of a case, and a function that computes its numbers."""

ROUNDS = {"paper-3x3-hog": 4, "crowd-100x100": 4, "market": 16}
"""Number of rounds in presets that are slow."""


def faces() -> Iterator[Case]:
    """Seeded episodes of every environment in every preset: all that a user is handed."""
    for preset in rt.scenarios():
        if preset == "city":
            continue  # it has no environment
        for model in ("role-trust", "first-hand"):
            yield f"parallel {preset} {model}", lambda p=preset, m=model: parallel_face(p, m)
            yield f"aec {preset} {model}", lambda p=preset, m=model: aec_face(p, m)
        for task_id in TASKS:
            if not compromised(task_id, preset):
                continue
            for knowledge in ("black_box", "white_box"):
                yield (
                    f"{task_id} {preset} {knowledge}",
                    lambda t=task_id, p=preset, k=knowledge: task_face(t, p, k),
                )
            yield f"vector {task_id} {preset}", lambda t=task_id, p=preset: vector_face(t, p)
            yield f"sb3 {task_id} {preset}", lambda t=task_id, p=preset: sb3_face(t, p)
            if preset != "paper-3x3-hog":
                yield f"jax {task_id} {preset}", lambda t=task_id, p=preset: jax_task_face(t, p)
        if preset not in ("open-system", "newcomers"):  # where agents come and go
            yield f"sb3 roles {preset}", lambda p=preset: role_face(p)
        if preset != "paper-3x3-hog":
            yield f"jax {preset}", lambda p=preset: jax_face(p)


TASKS = {
    "RoleTrust/ProviderAttack-v0": ("sp",),
    "RoleTrust/RaterAttack-v0": ("sr",),
    "RoleTrust/DualAttack-v0": ("srsp",),
    "RoleTrust/CollusionAttack-v0": ("sr", "sp", "srsp"),
}
"""Roles that each task compromises an agent of."""


def compromised(task_id: str, preset: str) -> tuple[str, ...]:
    """The last agent of each role of a task in a preset."""
    names = rt.Game(rt.make_scenario(preset)).roster.names
    members = ([name for name in names if name.startswith(f"{r}_")] for r in TASKS[task_id])
    return tuple(agents[-1] for agents in members if agents)


def rounds_of(preset: str, most: int = 24) -> int:
    """The number of rounds that an environment of a preset plays here."""
    return min(most, ROUNDS.get(preset, most))


def task_arguments(task_id: str, preset: str) -> dict[str, Any]:
    """The arguments of a task in a preset, with a price of a trust gap."""
    names = compromised(task_id, preset)
    return {
        "scenario": preset,
        "compromised": names,
        "objective": "damage" if names[-1].startswith("sr_") else "exploit",
        "stealth": {"weight": 0.5, "tolerance": 0.05},
        "max_cycles": rounds_of(preset),
    }


def parallel_face(preset: str, model: str) -> Any:
    """Two episodes, one of which ends by the number of its rounds, with the state of each round."""
    env = rt.parallel_env(preset, model, max_cycles=rounds_of(preset))
    seen: list[Any] = []
    for seed in (0, None):
        seen += env.reset(seed=seed)
        random = np.random.default_rng(1)
        while env.agents:
            seen += env.step(
                {
                    agent: random.random(env.action_space(agent).shape, np.float32)
                    for agent in env.agents
                }
            )
            seen.append(env.state())
    return seen


def aec_face(preset: str, model: str) -> Any:
    """An episode, agent by agent."""
    env, random, seen = rt.env(preset, model, max_cycles=rounds_of(preset, 6)), None, []
    env.reset(seed=0)
    random = np.random.default_rng(1)
    for agent in env.agent_iter():
        observation, reward, terminated, truncated, info = env.last()
        seen += [agent, observation, reward, terminated, truncated, info, env.state()]
        over = terminated or truncated
        env.step(None if over else random.random(env.action_space(agent).shape, np.float32))
    return seen


def task_face(task_id: str, preset: str, knowledge: str) -> Any:
    """Two episodes of a task."""
    import gymnasium

    env = gymnasium.make(task_id, **task_arguments(task_id, preset), knowledge=knowledge)
    random, seen = np.random.default_rng(1), []
    for seed in (0, None):
        seen += env.reset(seed=seed)
        over = False
        while not over:
            step = env.step(random.random(env.action_space.shape, np.float32))
            over = step[2] or step[3]
            seen += step
    return seen


def vector_face(task_id: str, preset: str) -> Any:
    """Games of a task side by side, in which episodes end and begin."""
    import gymnasium

    seen = []
    for mode in ("NextStep", "SameStep"):
        arguments = {**task_arguments(task_id, preset), "max_cycles": rounds_of(preset, 5)}
        env = gymnasium.make_vec(task_id, num_envs=3, autoreset_mode=mode, **arguments, **SINGLE)
        seen += env.reset(seed=0)
        random = np.random.default_rng(1)
        for _ in range(12):
            seen += env.step(random.random(env.action_space.shape, np.float32))
    return seen


SINGLE: dict[str, Any] = {"like": np.zeros((), np.float32)}
"""Argument by which games side by side are played in float32."""


def sb3_face(task_id: str, preset: str) -> Any:
    """Games of a task for Stable-Baselines3."""
    arguments = {**task_arguments(task_id, preset), "max_cycles": rounds_of(preset, 5)}
    return vec_env(rt.AttackVecEnv(rt.make_task(**arguments, **SINGLE), 3, seed=0))


def role_face(preset: str) -> Any:
    """Games in which all agents of a role learn, for Stable-Baselines3."""
    scenario = rt.make_scenario(preset).change(max_cycles=rounds_of(preset, 5))
    game = rt.Game(scenario, like=SINGLE["like"])
    role = game.roster.names[0].partition("_")[0]
    return vec_env(rt.RoleVecEnv(game, role, 3, seed=0))


def vec_env(env: Any) -> Any:
    """The rounds of a `VecEnv`, without times."""
    random, seen = np.random.default_rng(1), [env.reset()]
    for _ in range(12):
        seen += env.step(2 * random.random((env.num_envs, *env.action_space.shape), np.float32) - 1)
        for info in seen[-1]:
            info.get("episode", {}).pop("t", None)
    return seen


def jax_face(preset: str) -> Any:
    """Games of all agents on JAX."""
    return on_jax(lambda: rt.RoleTrustJaxEnv(preset, max_cycles=rounds_of(preset, 5)))


def jax_task_face(task_id: str, preset: str) -> Any:
    """Games of a task on JAX."""
    arguments = {**task_arguments(task_id, preset), "max_cycles": rounds_of(preset, 5)}
    return on_jax(lambda: rt.AttackJaxEnv(task_id, **arguments))


def on_jax(make: Callable[[], Any]) -> Any:
    """Two games side by side in double precision, to six digits: XLA rounds by its version."""
    import jax

    with jax.enable_x64(True):
        env, keys, seen = make(), jax.random.split(jax.random.key(0)), []
        observations, state = jax.vmap(env.reset)(keys)
        seen.append(observations)
        random, step = np.random.default_rng(1), jax.jit(jax.vmap(env.step))
        for _ in range(8):
            actions = {a: random.random((2, *env.action_space(a).shape)) for a in env.agents}
            observations, state, *outcome = step(keys, state, actions)
            seen += [observations, *outcome]
    return jax.tree.map(lambda leaf: np.round(np.asarray(leaf, np.float64), 6) + 0.0, seen)
