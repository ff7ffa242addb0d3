"""How fast the games run: one environment and batches, by the rules and compiled, and peers.

Peers are mpe2, VMAS and JaxMARL, where they are installed. All contestants of a table take turns. A
step includes all that a learner needs: it draws noise, plays the round, and computes observations
and rewards. A table shows the median of the repeats, the least and the greatest, and the ratio to
the peer, which is the first of its group: the lower quartile over the turns. Two further tables
have the times until the first step, and the share of a training of Stable-Baselines3 that the
environment takes. Some minutes. `--device cuda` measures the batches that run on a GPU.
"""

import contextlib
import importlib.util
import io
import itertools
import os
import platform
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple
from unittest.mock import patch

import gymnasium
import numpy as np

from roletrust_agents.smooth import one_thread
from roletrust_env import AttackVecEnv, Game, Random, env, make_scenario, make_task, parallel_env
from roletrust_env.envs.vector import AttackVectorEnv
from roletrust_env.game.state import Actions
from roletrust_env.metrics.confidence import Floats
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.storage.provenance import software
from studies.study import Recipe, Study

COMPILED = "compiled torch"
"""Name of the library in which a step is one graph."""

_SAMPLES, _BATCH_SAMPLES = 64, 4  # actions, sampled before the clock starts, and used in turn
_REPEATS, _SLICE_S = 11, 0.4  # turns of each contestant, and their approximate length in seconds
_ROUNDS = 16  # of a batch in one step
_HEADINGS = ["contestant", "games", "M agent-steps/s", "least", "greatest", "times the peer"]
_START_HEADINGS = [
    *("scenario", "engine", "to make it", "from start to first step"),
    *("to make it again", "from start again"),
]
_SHARE_HEADINGS = ["engine", "seconds of training", "seconds in the environment", "share"]
_TRAINING_GAMES, _TRAINING_ROUNDS = 256, 100_000
_FIRST_STEP = """
import sys, time
began = time.perf_counter()
from roletrust_env import parallel_env
preset, engine = sys.argv[1:]
making = time.perf_counter()
env = parallel_env(preset, engine=engine)
made = time.perf_counter()
env.reset(seed=0)
env.step({agent: env.action_space(agent).sample() for agent in env.agents})
print(f"{made - making:.2f} {time.perf_counter() - began:.2f}")
"""
_ENGINES = ("rules", "compiled")
_PRESETS = ("paper-3x3", "peers", "robots-that-move", "crowd-10x10")
_TASKS = ("ProviderAttack", "RaterAttack", "DualAttack", "CollusionAttack")


class Options(NamedTuple):
    """Sizes of the batches, and the device of torch and JAX."""

    games: tuple[int, ...] = (1024, 8192, 65536)
    device: str = "cpu"


class Contestant(NamedTuple):
    """A step to time.

    Attributes:
        name: Name in tables.
        step: Function that takes one step.
        amount: Number of actions of agents in a step.
    """

    name: str
    step: Callable[[], Any]
    amount: int


_Entry = tuple[str, Callable[..., Contestant]]
"""The package that a contestant needs, and what makes the contestant."""
RECIPES = {"speed": Recipe(Options())}


@one_thread()
def main(study: Study[Options]) -> None:
    """Time all contestants, the peer of each size first, and write the table."""
    device = study.options.device
    os.environ.setdefault("JAX_PLATFORMS", device)  # before JAX is imported
    os.environ.setdefault(
        "XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    )
    groups: list[tuple[int, list[_Entry]]] = []
    if device == "cpu":
        for turns in (False, True):
            ours: list[_Entry] = [
                ("llvmlite", partial(one_environment, preset, turns, engine))
                for preset in _PRESETS
                for engine in _ENGINES
            ]
            groups.append((1, [("mpe2", partial(simple_adversary, turns)), *ours]))
        tasks = [("llvmlite", partial(one_task, task, e)) for task in _TASKS for e in _ENGINES]
        groups.append((1, [("mpe2", partial(simple_adversary, False)), *tasks]))
    for games in study.options.games:
        entries: list[_Entry] = [
            ("jaxmarl", simple_spread_on_jax),
            ("jax", batch_on_jax),
            ("jax", batch_on_jax_games_first),
            *(("torch", partial(batch, library, device)) for library in ("torch", COMPILED)),
        ]
        if device == "cpu":
            on_numpy: list[_Entry] = [
                ("llvmlite", partial(attack_tasks, engine, dtype))
                for dtype in (np.float32, np.float64)
                for engine in _ENGINES
            ]
            entries = [("vmas", simple_spread), *on_numpy, *entries]
        groups.append((games, [(package, partial(make, games)) for package, make in entries]))
    rows = []
    for games, entries in groups:
        made = [make(study.seed) for package, make in entries if importlib.util.find_spec(package)]
        seconds = measure(made, _REPEATS, _SLICE_S)
        has_peer = importlib.util.find_spec(entries[0][0])
        rows += [
            (
                *(contestant.name, games, *np.percentile(1e-6 / own, (50, 0, 100)).tolist()),
                float(np.quantile(seconds[0] / own, 0.25)) if has_peer else None,
            )
            for contestant, own in zip(made, seconds, strict=True)
        ]
    study.csv("speed.csv", _HEADINGS, rows)
    lines = [
        [name, f"{games:,}", *(f"{x:.3f}" for x in rate), f"{ratio:.1f}" if ratio else "-"]
        for name, games, *rate, ratio in rows
    ]
    tables = [markdown_table(_HEADINGS, lines, 1)]
    if device == "cpu":
        starts = [first_step(preset, engine) for preset in _PRESETS for engine in _ENGINES]
        shares = [share_of_environment(engine, study.seed) for engine in _ENGINES]
        tables += [
            "Seconds in new processes: with an empty cache of compiled code, and then again.",
            markdown_table(_START_HEADINGS, starts, 2),
            f"A training by PPO of Stable-Baselines3: {_TRAINING_ROUNDS:,} rounds in "
            f"{_TRAINING_GAMES} games of `AttackVecEnv`.",
            markdown_table(_SHARE_HEADINGS, shares, 1),
        ]
    packages = software()["packages"]
    made_by = (
        f"Made by `{study.command}` on {os.cpu_count()} cores of {platform.machine()}, Python "
        f"{platform.python_version()}, numpy {packages['numpy']}, torch {packages['torch']} on 1 "
        "of them."
    )
    study.page("speed.md", "# Speed", *tables, made_by)


def measure(contestants: Sequence[Contestant], repeats: int, slice_s: float) -> Floats:
    """Return the seconds per action of each contestant in each turn, shape (contestants, repeats).

    Contestants take turns in this process, so that other work on the machine affects all alike.

    Args:
        contestants: Contestants.
        repeats: Number of turns of each contestant.
        slice_s: Approximate length of a turn in seconds; a turn is at least one step.
    """
    steps = [_steps_in(contestant, slice_s) for contestant in contestants]
    turns = [
        [_seconds(contestant, n) for contestant, n in zip(contestants, steps, strict=True)]
        for _ in range(repeats)
    ]
    amounts = np.array([[contestant.amount] for contestant in contestants])
    seconds: Floats = np.transpose(turns) / amounts
    return seconds


def _seconds(contestant: Contestant, steps: int) -> float:
    """Return the mean time of a step in seconds."""
    step = contestant.step
    start = time.perf_counter()
    for _ in range(steps):
        step()
    return (time.perf_counter() - start) / steps


def _steps_in(contestant: Contestant, seconds: float) -> int:
    """Return the number of steps that fill a time."""
    # torch compiles one graph for the first round and one for those that follow
    _seconds(contestant, 3)
    steps = 1
    while (elapsed := _seconds(contestant, steps) * steps) < seconds / 4:
        steps *= 2
    return max(1, round(steps * seconds / elapsed))


def first_step(preset: str, engine: str) -> list[str]:
    """Return the seconds that a new process takes to make an environment, and until its first step
    from its start on.
    """
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", _FIRST_STEP, preset, engine]
        environment = {**os.environ, "XDG_CACHE_HOME": folder}
        runs = [
            subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
            for _ in range(2)
        ]
    return [preset, engine, *(word for run in runs for word in run.stdout.split())]


def share_of_environment(engine: Any, seed: int) -> list[str]:
    """Return the seconds of a short training of PPO, and the share that its environment takes."""
    from stable_baselines3 import PPO

    task = make_task("paper-3x3", ("sp_2",), objective="exploit")
    env = AttackVecEnv(task, _TRAINING_GAMES, seed=seed, engine=engine)
    spent, step_wait = [0.0], env.step_wait

    def timed() -> Any:
        began = time.perf_counter()
        step = step_wait()
        spent[0] += time.perf_counter() - began
        return step

    env.step_wait = timed  # type: ignore[method-assign]
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=1024, n_epochs=4, seed=seed, device="cpu")
    began = time.perf_counter()
    model.learn(_TRAINING_ROUNDS)
    seconds = time.perf_counter() - began
    return [engine, f"{seconds:.1f}", f"{spent[0]:.1f}", f"{spent[0] / seconds:.0%}"]


def one_environment(preset: str, in_turn: bool, engine: Any, seed: int) -> Contestant:
    """Return a scenario as a PettingZoo environment in which agents act at once, or in turn."""
    made = (env if in_turn else parallel_env)(preset, engine=engine)
    return _in_pettingzoo(f"{preset}, {engine}", made, in_turn, seed)


def one_task(name: str, engine: Any, seed: int) -> Contestant:
    """Return an attack task as `gymnasium.make` makes it; all agents of its game count."""
    task = gymnasium.make(f"roletrust_env:RoleTrust/{name}-v0", engine=engine)
    task.reset(seed=seed)
    task.action_space.seed(seed)
    actions = itertools.cycle([task.action_space.sample() for _ in range(_SAMPLES)])

    def step() -> None:
        *_, terminated, truncated, _ = task.step(next(actions))
        if terminated or truncated:
            task.reset()

    inner: Any = task.unwrapped
    return Contestant(f"{name}, {engine}", step, len(inner.task.game.roster.names))


def simple_adversary(in_turn: bool, seed: int) -> Contestant:
    """Return the environment of mpe2, with episodes of the same length as ours."""
    from mpe2 import simple_adversary_v3 as peer

    made = (peer.env if in_turn else peer.parallel_env)(
        max_cycles=make_scenario("paper-3x3").max_cycles
    )
    return _in_pettingzoo("mpe2 simple_adversary", made, in_turn, seed)


def _in_pettingzoo(name: str, env: Any, in_turn: bool, seed: int) -> Contestant:
    """Return an environment under random actions; a step is that of all agents."""
    env.reset(seed=seed)
    spaces = {agent: env.action_space(agent) for agent in env.possible_agents}
    for i, space in enumerate(spaces.values()):
        space.seed(seed + i)
    actions = itertools.cycle(
        [{agent: space.sample() for agent, space in spaces.items()} for _ in range(_SAMPLES)]
    )

    def step() -> None:
        if not env.agents:
            env.reset()
        env.step(next(actions))

    def turns() -> None:
        chosen = next(actions)
        for _ in spaces:
            if not env.agents:
                env.reset()
            _, _, terminated, truncated, _ = env.last()
            env.step(None if terminated or truncated else chosen[env.agent_selection])

    name = f"{name}, {'in turn' if in_turn else 'parallel'}"
    return Contestant(name, turns if in_turn else step, len(spaces))


def simple_spread(games: int, seed: int) -> Contestant:
    """Return the batched environment of VMAS with three agents and continuous actions."""
    with contextlib.redirect_stderr(io.StringIO()), warnings.catch_warnings(action="ignore"):
        import vmas  # and the old gym, which prints that it is no longer maintained

        env = vmas.make_env(
            "simple_spread", num_envs=games, device="cpu", continuous_actions=True, seed=seed
        )
    actions = itertools.cycle(
        [[env.get_random_action(agent) for agent in env.agents] for _ in range(_BATCH_SAMPLES)]
    )
    return Contestant(
        "VMAS simple_spread", lambda: env.step(next(actions)), games * len(env.agents)
    )


def batch(library: str, device: str, games: int, seed: int) -> Contestant:
    """Return a batch of games of the paper's scenario in float32, with all that a learner needs of
    a step.

    A step draws noise, plays the round, and computes observations and rewards. Finished games start
    again. The library is `torch` or `COMPILED`.
    """
    import torch

    like: Any = torch.zeros((), device=device)
    random = Random(np.random.default_rng(seed), like)
    game = Game(make_scenario("paper-3x3"), like=like)
    s, p = game.roster.n_raters, game.roster.n_providers
    samples = [
        Actions(random.uniform((p, games)), random.uniform((s, p, games)))
        for _ in range(_BATCH_SAMPLES)
    ]
    actions = itertools.cycle(samples)

    def advance(state: Any, joint: Actions, key: Any) -> tuple[Any, ...]:
        state, rewards = game.step(state, joint, game.noise(key, state.round.shape))
        return state, rewards, game.observations(state)

    if library == COMPILED:
        settings: dict[str, Any] = {
            # Steps of several sizes share their code, and torch limits the compilations of a code
            # by default.
            "isolate_recompiles": True,
            # The library does not change during the timing; guards on the arguments stay.
            "options": {"guard_filter_fn": torch.compiler.skip_guard_on_globals_unsafe},
        }
        compiled: Any = torch.compile(advance, dynamic=False, fullgraph=True, **settings)
        played = torch.inference_mode()(compiled)
    else:
        played = advance

    def play() -> Iterator[None]:
        while True:
            state = game.start(game.draw(random, (games,), start=True))
            for _ in range(game.scenario.max_cycles):
                state, *_ = played(state, next(actions), random.round_key())
                yield

    rounds = play()
    with warnings.catch_warnings(action="ignore"):  # on caches that torch.compile looks through
        for _ in range(4):  # the first rounds are of three kinds
            next(rounds)

    def step() -> None:
        for _ in range(_ROUNDS):
            next(rounds)
        if device != "cpu":
            like.sum().item()  # waits until the device is done

    return Contestant(f"{library} batch", step, _ROUNDS * games * len(game.roster.names))


def batch_on_jax(games: int, seed: int) -> Contestant:
    """Return a batch of the paper's scenario on JAX, see `_on_jax`."""
    from roletrust_env import RoleTrustJaxEnv

    return _on_jax("JAX batch", RoleTrustJaxEnv("paper-3x3"), games, seed)


def batch_on_jax_games_first(games: int, seed: int) -> Contestant:
    """Return the batch of `batch_on_jax` with the games first, as `jax.vmap` puts them."""
    from roletrust_env.envs import jax_env

    with patch.object(jax_env, "games_last", lambda function, *_: function):
        made = jax_env.RoleTrustJaxEnv("paper-3x3")
    return _on_jax("JAX batch, games first", made, games, seed)


def simple_spread_on_jax(games: int, seed: int) -> Contestant:
    """Return a batch of JaxMARL's environment with three agents and continuous actions, see
    `_on_jax`.
    """
    import jaxmarl

    return _on_jax(
        "JaxMARL simple_spread",
        jaxmarl.make("MPE_simple_spread_v3", action_type="Continuous"),
        games,
        seed,
    )


def _on_jax(name: str, env: Any, games: int, seed: int) -> Contestant:
    """Return a batch of an environment in JaxMARL's form: one call plays rounds and carries what
    agents see along.
    """
    import jax

    key = jax.random.key(seed)
    shapes = {agent: (_ROUNDS, games, *env.action_space(agent).shape) for agent in env.agents}
    actions = {
        agent: jax.random.uniform(jax.random.fold_in(key, i), shapes[agent])
        for i, agent in enumerate(shapes)
    }

    def play(begun: tuple[Any, Any], sample: tuple[Any, Any]) -> tuple[Any, Any]:
        key, actions = sample
        seen, states, rewards, *_ = jax.vmap(env.step)(
            jax.random.split(key, games), begun[1], actions
        )
        return (seen, states), rewards

    rounds = jax.jit(
        lambda begun, key, actions: jax.lax.scan(
            play, begun, (jax.random.split(key, _ROUNDS), actions)
        )
    )
    begun = jax.jit(jax.vmap(env.reset))(jax.random.split(key, games))

    def step() -> None:
        nonlocal key, begun
        key = jax.random.fold_in(key, 0)
        begun, _ = jax.block_until_ready(rounds(begun, key, actions))

    return Contestant(name, step, _ROUNDS * games * len(env.agents))


def attack_tasks(engine: Any, dtype: Any, games: int, seed: int) -> Contestant:
    """Return a batch of `RoleTrust/ProviderAttack-v0` through Gymnasium."""
    like = np.zeros((), dtype)
    env = AttackVectorEnv("RoleTrust/ProviderAttack-v0", games, engine=engine, like=like)
    env.reset(seed=seed)
    env.action_space.seed(seed)
    actions = env.action_space.sample()
    agents = len(env.task.game.roster.names)
    name = f"attack tasks, {engine}, {like.dtype}"
    return Contestant(name, lambda: env.step(actions), games * agents)
