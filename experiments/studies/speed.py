"""How fast the games run: one environment, batches on NumPy, torch and JAX; mpe2, VMAS and JaxMARL beside them.

Peers are measured if they are installed; all contestants take turns. A step includes all that a learner needs: drawing
noise, playing the round, and computing observations and rewards. The table shows the median of the repeats, the least
and the greatest; and the ratio to the peer, which is the first of its group: the lower quartile over the turns. Some
minutes.
"""

import contextlib
import importlib.util
import io
import itertools
import os
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, NamedTuple

import gymnasium

from roletrust_agents.smooth import one_thread
from roletrust_env import Game, env, make_scenario, parallel_env
from roletrust_env.envs.vector import AttackVectorEnv
from roletrust_env.game.state import Actions
from roletrust_env.game.traced.kernels import Kernel
from roletrust_env.game.traced.rounds import Rounds
from roletrust_env.storage.markdown import markdown_table
from studies.study import Recipe, Study
from studies.timing import COMPILED, Contestant, compiled, machine, measure, source

_SAMPLES, _BATCH_SAMPLES = 64, 4  # actions, sampled before the clock starts, and used in turn
_BEFORE = 100  # rounds before the clock starts, in which our games are traced
_REPEATS, _SLICE_S = 11, 0.4  # turns of each contestant, and their approximate length in seconds
_JAX_ROUNDS = 16  # in one call
_HEADINGS = ["contestant", "games", "M agent-steps/s", "least", "greatest", "times the peer"]
_FORMS = ["scenario", "forms of a round", "s to trace", "s to compile", "s to find them in the cache"]
_ABOUT_FORMS = "All forms of the rounds of one scenario; they are compiled beside the play, and nobody waits for it."
_PREPARE = """
import sys, time
from roletrust_env import parallel_env
env = parallel_env(sys.argv[1])
env.reset(seed=0)
for _ in range(30):
    env.step({agent: env.action_space(agent).sample() for agent in env.agents})
began = time.perf_counter()
env.rounds.compile()
forms = env.rounds.forms
print(len(forms), f"{sum(form.trace_s for form in forms):.2f} {time.perf_counter() - began:.2f}")
"""
_PRESETS = ("paper-3x3", "peers", "robots-that-move", "crowd-10x10")
_TASKS = ("ProviderAttack", "RaterAttack", "DualAttack", "CollusionAttack")


class Options(NamedTuple):
    """Sizes of the batches."""

    games: tuple[int, ...] = (1024, 8192, 65536)


RECIPES = {"speed": Recipe(Options())}


def main(arguments: Sequence[str] | None = None) -> None:
    """Time all contestants, the peer of each size first, and write the table."""
    with Study(__name__, RECIPES, arguments) as study, one_thread():
        groups: list[tuple[int, list[tuple[str, Callable[[int], Contestant]]]]] = [
            (1, [("mpe2", simple_adversary), *(("numpy", partial(one_environment, preset)) for preset in _PRESETS)]),
            (1, [("mpe2", adversary_in_turn), *(("numpy", partial(agents_in_turn, preset)) for preset in _PRESETS)]),
            (1, [("mpe2", simple_adversary), *(("numpy", partial(one_task, task)) for task in _TASKS)]),
        ]
        for games in study.options.games:
            ours = [("numpy", partial(attack_tasks, games, threads)) for threads in (0, 1)]
            libraries = ("NumPy", "numpy"), ("C", "numpy"), ("torch", "torch"), (COMPILED, "torch")
            ours += [(package, partial(batch, library, games)) for library, package in libraries]
            on_jax = ("jaxmarl", partial(simple_spread_on_jax, games)), ("jax", partial(batch_on_jax, games))
            groups.append((games, [("vmas", partial(simple_spread, games)), *ours, *on_jax]))
        rows = []
        for games, entries in groups:
            made = [make(study.seed) for package, make in entries if importlib.util.find_spec(package)]
            found = measure(made, _REPEATS, _SLICE_S)
            peer = found[0] if importlib.util.find_spec(entries[0][0]) else None
            rows += [(one.contestant.name, games, *one.rate(), peer and one.ratio(peer)) for one in found]
        study.csv("speed.csv", _HEADINGS, rows)
        lines = [
            [name, f"{games:,}", *(f"{x:.3f}" for x in rate), f"{ratio:.1f}" if ratio else "-"]
            for name, games, *rate, ratio in rows
        ]
        times = markdown_table(_FORMS, [[preset, *preparation(preset)] for preset in _PRESETS], 1)
        table = markdown_table(_HEADINGS, lines, 1)
        study.page("speed.md", "# Speed", table, _ABOUT_FORMS, times, f"Made by `{study.command}` on {machine()}.")


def preparation(preset: str) -> list[str]:
    """Return the number of forms of a round, and the seconds to trace them, to compile them, and to find them again."""
    with tempfile.TemporaryDirectory() as folder:
        command, environment = [sys.executable, "-c", _PREPARE, preset], {**os.environ, "XDG_CACHE_HOME": folder}
        runs = [subprocess.run(command, env=environment, capture_output=True, text=True, check=True) for _ in range(2)]
    first, then = (run.stdout.split() for run in runs)
    return [*first, then[-1]]


def one_environment(preset: str, seed: int) -> Contestant:
    """Return a scenario as a PettingZoo parallel environment."""
    env = parallel_env(preset)
    return _warm(f"{preset}, parallel", _player(env, seed), len(env.possible_agents), env.rounds)


def agents_in_turn(preset: str, seed: int) -> Contestant:
    """Return a scenario as a PettingZoo environment in which agents act in turn."""
    made = env(preset)
    inner: Any = made.unwrapped
    return _warm(f"{preset}, in turn", _turns(made, seed), len(made.possible_agents), inner.rounds)


def one_task(name: str, seed: int) -> Contestant:
    """Return an attack task as `gymnasium.make` makes it; all agents of its game count."""
    task = gymnasium.make(f"roletrust_env:RoleTrust/{name}-v0")
    task.reset(seed=seed)
    task.action_space.seed(seed)
    actions = itertools.cycle([task.action_space.sample() for _ in range(_SAMPLES)])

    def step() -> None:
        *_, terminated, truncated, _ = task.step(next(actions))
        if terminated or truncated:
            task.reset()

    inner: Any = task.unwrapped
    return _warm(f"{name}, gymnasium.make", step, len(inner.task.game.roster.names), inner.rounds)


def simple_adversary(seed: int) -> Contestant:
    """Return the environment of mpe2, with episodes of the same length as ours."""
    from mpe2 import simple_adversary_v3

    env = simple_adversary_v3.parallel_env(max_cycles=make_scenario("paper-3x3").max_cycles)
    return Contestant("mpe2 simple_adversary", _player(env, seed), len(env.possible_agents))


def adversary_in_turn(seed: int) -> Contestant:
    """Return the same environment of mpe2 with agents in turn."""
    from mpe2 import simple_adversary_v3

    env = simple_adversary_v3.env(max_cycles=make_scenario("paper-3x3").max_cycles)
    return Contestant("mpe2 simple_adversary, in turn", _turns(env, seed), len(env.possible_agents))


def simple_spread(games: int, seed: int) -> Contestant:
    """Return the batched environment of VMAS with three agents and continuous actions."""
    with contextlib.redirect_stderr(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import vmas  # and the old gym, which prints that it is no longer maintained

        env = vmas.make_env("simple_spread", num_envs=games, device="cpu", continuous_actions=True, seed=seed)
    actions = itertools.cycle([[env.get_random_action(agent) for agent in env.agents] for _ in range(_BATCH_SAMPLES)])
    return Contestant("VMAS simple_spread", lambda: env.step(next(actions)), games * len(env.agents))


def batch(library: str, games: int, seed: int) -> Contestant:
    """Return a batch of games of the paper's scenario in float32, with all that a learner needs of a step.

    A step draws noise, plays the round, and computes observations and rewards. Finished games start again.

    Args:
        library: `NumPy`, `C`, which is a kernel, `torch` or `COMPILED`.
        games: Size of the batch.
        seed: Random seed of noise and actions.
    """
    like, random = source(library, seed)
    game = Game(make_scenario("paper-3x3"), like=like)
    s, p = game.roster.n_raters, game.roster.n_providers
    samples = [Actions(random.uniform((p, games)), random.uniform((s, p, games))) for _ in range(_BATCH_SAMPLES)]
    actions = itertools.cycle(samples)

    def advance(state: Any, joint: Actions, key: Any) -> tuple[Any, ...]:
        state, rewards = game.step(state, joint, game.noise(key, state.round.shape))
        return state, rewards, game.observations(state)

    compilers: dict[str, Any] = {COMPILED: compiled, "C": Kernel}
    step = compilers.get(library, partial)(advance)

    def play() -> Iterable[None]:
        while True:
            state = game.start(game.draw(random, (games,), start=True))
            for _ in range(game.scenario.max_cycles):
                state, *_ = step(state, next(actions), random.round_key())
                yield

    rounds = iter(play())
    with warnings.catch_warnings():  # on caches that torch.compile looks through
        warnings.simplefilter("ignore")
        for _ in range(4):  # the first rounds are of three kinds
            next(rounds)
    return Contestant(f"{library} batch", lambda: next(rounds), games * len(game.roster.names))


def batch_on_jax(games: int, seed: int) -> Contestant:
    """Return a batch of the paper's scenario on JAX, see `_on_jax`."""
    from roletrust_env import RoleTrustJaxEnv

    return _on_jax("JAX batch", RoleTrustJaxEnv("paper-3x3"), games, seed)


def simple_spread_on_jax(games: int, seed: int) -> Contestant:
    """Return a batch of JaxMARL's environment with three agents and continuous actions, see `_on_jax`."""
    import jaxmarl

    return _on_jax("JaxMARL simple_spread", jaxmarl.make("MPE_simple_spread_v3", action_type="Continuous"), games, seed)


def _on_jax(name: str, env: Any, games: int, seed: int) -> Contestant:
    """Return a batch of an environment in JaxMARL's form: one call plays some rounds with random actions."""
    os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")
    import jax

    sizes = {agent: env.action_space(agent).shape for agent in env.agents}

    def play(states: Any, key: Any) -> tuple[Any, Any]:
        key, *keys = jax.random.split(key, 1 + len(sizes))
        actions = {
            agent: jax.random.uniform(k, (games, *size)) for (agent, size), k in zip(sizes.items(), keys, strict=True)
        }
        seen, states, rewards, *_ = jax.vmap(env.step)(jax.random.split(key, games), states, actions)
        return states, (sum(map(jax.numpy.sum, seen.values())), rewards)

    rounds = jax.jit(lambda key, states: jax.lax.scan(play, states, jax.random.split(key, _JAX_ROUNDS)))
    key = jax.random.key(seed)
    _, states = jax.jit(jax.vmap(env.reset))(jax.random.split(key, games))

    def step() -> None:
        nonlocal key, states
        key = jax.random.fold_in(key, 0)
        states, outcome = rounds(key, states)
        jax.block_until_ready(outcome)

    step()  # compiles
    return Contestant(name, step, _JAX_ROUNDS * games * len(env.agents))


def attack_tasks(games: int, threads: int, seed: int) -> Contestant:
    """Return a batch of `RoleTrust/ProviderAttack-v0` through Gymnasium, as learners play it.

    Args:
        games: Size of the batch.
        threads: Threads of a kernel; 0 is NumPy.
        seed: Random seed of noise and actions.
    """
    env = AttackVectorEnv("RoleTrust/ProviderAttack-v0", games, threads=threads)
    env.reset(seed=seed)
    env.action_space.seed(seed)
    actions = env.action_space.sample()
    name = f"attack task batch{', C' * threads}"
    return Contestant(name, lambda: env.step(actions), games * len(env.task.game.roster.names))


def _warm(name: str, step: Callable[[], None], amount: int, rounds: Rounds) -> Contestant:
    """Return a contestant that has played some rounds, and has compiled them if the machine has a compiler."""
    for _ in range(2):  # compiled rounds are compared with the rules, too
        for _ in range(_BEFORE):
            step()
        rounds.compile()
    return Contestant(name, step, amount)


def _player(env: Any, seed: int) -> Callable[[], None]:
    """Return a step of a PettingZoo environment under random actions."""
    env.reset(seed=seed)
    spaces = {agent: env.action_space(agent) for agent in env.possible_agents}
    for i, space in enumerate(spaces.values()):
        space.seed(seed + i)
    samples = [{agent: space.sample() for agent, space in spaces.items()} for _ in range(_SAMPLES)]
    actions = itertools.cycle(samples)

    def step() -> None:
        if not env.agents:
            env.reset()
        env.step(next(actions))

    return step


def _turns(env: Any, seed: int) -> Callable[[], None]:
    """Return a turn of every agent of a PettingZoo environment under random actions."""
    env.reset(seed=seed)
    spaces = {agent: env.action_space(agent) for agent in env.possible_agents}
    for i, space in enumerate(spaces.values()):
        space.seed(seed + i)
    samples = {agent: itertools.cycle([space.sample() for _ in range(_SAMPLES)]) for agent, space in spaces.items()}

    def step() -> None:
        for _ in spaces:
            if not env.agents:
                env.reset()
            _, _, terminated, truncated, _ = env.last()
            env.step(None if terminated or truncated else next(samples[env.agent_selection]))

    return step


if __name__ == "__main__":
    main()
