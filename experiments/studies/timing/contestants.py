"""Contestants of `python -m studies.speed`, and their timing: each is a step that can be repeated."""

import contextlib
import inspect
import io
import itertools
import os
import platform
import time
import warnings
from collections.abc import Callable, Iterable, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any, NamedTuple

import numpy as np

from roletrust_env import Game, Random, Scenario, make_scenario, parallel_env
from roletrust_env.envs.vector import AttackVectorEnv
from roletrust_env.game.state import Actions
from roletrust_env.world import AgentGroup

# Actions are sampled before the clock starts, and used in turn.
_SAMPLES = 64
_BATCH_SAMPLES = 4


class Contestant(NamedTuple):
    """A step to time.

    Attributes:
        name: Name in tables.
        games: Number of games that play in one step.
        agents: Number of agents in each game.
        step: Function that takes one step in every game.
        ratings: Number of ratings in each round of a game; 0 for games without ratings.
    """

    name: str
    games: int
    agents: int
    step: Callable[[], Any]
    ratings: int = 0


class Spread(NamedTuple):
    """Median, minimum and maximum of repeats."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Iterable[float]) -> "Spread":
        """Return the spread of values."""
        known = np.asarray(list(values))
        return cls(float(np.median(known)), float(known.min()), float(known.max()))


class Timing(NamedTuple):
    """Time of one step of a contestant in each repeat, in seconds."""

    contestant: Contestant
    seconds: tuple[float, ...]

    def env_steps(self) -> Spread:
        """Return the rounds of a game per second."""
        return Spread.of(self.contestant.games / s for s in self.seconds)

    def agent_steps(self) -> Spread:
        """Return the actions of an agent per second."""
        return Spread.of(self._acts / s for s in self.seconds)

    def per_rating(self) -> Spread:
        """Return the seconds for each rating of a round."""
        return Spread.of(self._for_a_rating)

    def times_faster(self, peer: "Timing") -> Spread:
        """Return the ratio of agent-steps per second to those of a peer, turn by turn."""
        pairs = zip(self.seconds, peer.seconds, strict=True)
        return Spread.of((self._acts / ours) / (peer._acts / theirs) for ours, theirs in pairs)

    def times_dearer(self, peer: "Timing") -> Spread:
        """Return the ratio of the time per rating to that of a peer, turn by turn."""
        return Spread.of(ours / theirs for ours, theirs in zip(self._for_a_rating, peer._for_a_rating, strict=True))

    @property
    def _acts(self) -> int:
        return self.contestant.games * self.contestant.agents

    @property
    def _for_a_rating(self) -> list[float]:
        return [s / (self.contestant.games * self.contestant.ratings) for s in self.seconds]


def measure(
    contestants: Sequence[Contestant], repeats: int, slice_s: float, advance: Callable[[], None] = lambda: None
) -> list[Timing]:
    """Time contestants in turn and repeatedly, so that other work on the machine affects all alike.

    Args:
        contestants: Contestants.
        repeats: Number of turns of each contestant.
        slice_s: Approximate length of a turn in seconds; a turn is at least one step.
        advance: Called after each turn.
    """
    steps = [_steps_in(contestant, slice_s) for contestant in contestants]
    seconds: list[list[float]] = [[] for _ in contestants]
    for _ in range(repeats):
        for contestant, n, found in zip(contestants, steps, seconds, strict=True):
            found.append(_time(contestant, n))
            advance()
    return [Timing(contestant, tuple(found)) for contestant, found in zip(contestants, seconds, strict=True)]


def _time(contestant: Contestant, steps: int) -> float:
    step = contestant.step
    start = time.perf_counter()
    for _ in range(steps):
        step()
    return (time.perf_counter() - start) / steps


def _steps_in(contestant: Contestant, seconds: float) -> int:
    """Return the number of steps that fill a time."""
    _time(contestant, 3)  # torch compiles one graph for the first round and one for those that follow
    steps = 1
    while (elapsed := _time(contestant, steps) * steps) < seconds / 4:
        steps *= 2
    return max(1, round(steps * seconds / elapsed))


def one_environment(seed: int) -> Contestant:
    """Return the paper's scenario as a PettingZoo parallel environment."""
    env = parallel_env("paper-3x3")
    return Contestant("one environment", 1, len(env.possible_agents), _player(env, seed))


def simple_adversary(seed: int) -> Contestant:
    """Return the environment of mpe2, with episodes of the same length as ours."""
    from mpe2 import simple_adversary_v3

    env = simple_adversary_v3.parallel_env(max_cycles=make_scenario("paper-3x3").max_cycles)
    return Contestant("mpe2 simple_adversary", 1, len(env.possible_agents), _player(env, seed))


def simple_spread(games: int, seed: int) -> Contestant:
    """Return the batched environment of VMAS with three agents and continuous actions."""
    # VMAS imports the old gym, which prints that it is no longer maintained.
    with contextlib.redirect_stderr(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import vmas

        env = vmas.make_env("simple_spread", num_envs=games, device="cpu", continuous_actions=True, seed=seed)
    samples = [[env.get_random_action(agent) for agent in env.agents] for _ in range(_BATCH_SAMPLES)]
    actions = itertools.cycle(samples)
    return Contestant("VMAS simple_spread", games, len(env.agents), lambda: env.step(next(actions)))


def batch(library: str, games: int, seed: int) -> Contestant:
    """Return a batch of games of the paper's scenario in float32, with all that a learner needs of a step.

    A step draws noise, plays the round, and computes observations and rewards. Finished games start again.

    Args:
        library: `NumPy`, `torch` or `compiled torch`.
        games: Size of the batch.
        seed: Random seed of noise and actions.
    """
    scenario = make_scenario("paper-3x3")
    step = _rounds(scenario, library, (games,), seed)
    return Contestant(f"{library} batch", games, len(Game(scenario).roster.names), step)


def attack_tasks(games: int, seed: int) -> Contestant:
    """Return a batch of `RoleTrust/ProviderAttack-v0` through Gymnasium, as learners play it.

    Args:
        games: Size of the batch.
        seed: Random seed of noise and actions.
    """
    env = AttackVectorEnv("RoleTrust/ProviderAttack-v0", games)
    env.reset(seed=seed)
    env.action_space.seed(seed)
    actions = env.action_space.sample()
    return Contestant("attack task batch", games, len(env.task.game.roster.names), lambda: env.step(actions))


def whole_round(side: int, seed: int) -> Contestant:
    """Return one game of `side` raters and providers on NumPy in float32; a step is as in `batch`."""
    return Contestant("whole round", 1, 2 * side, _rounds(_square(side), "NumPy", (), seed), side**2)


def _square(side: int) -> Scenario:
    groups = AgentGroup(role="SR", count=side, noise=0.005), AgentGroup(role="SP", count=side)
    return Scenario(name=f"{side}x{side}", agents=groups)


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


def _rounds(scenario: Scenario, library: str, shape: tuple[int, ...], seed: int) -> Callable[[], None]:
    """Return a step of a game or of a batch under random actions."""
    like, random = source(library, seed)
    game = Game(scenario, like=like)
    s, p = game.roster.n_raters, game.roster.n_providers
    samples = [Actions(random.uniform((p, *shape)), random.uniform((s, p, *shape))) for _ in range(_BATCH_SAMPLES)]
    actions = itertools.cycle(samples)

    def advance(state: Any, joint: Actions, key: Any) -> tuple[Any, ...]:
        state, rewards = game.step(state, joint, game.noise(key, shape))
        return state, rewards, game.observations(state)

    if library == "compiled torch":
        advance = compiled(advance)

    def play() -> Iterable[None]:
        while True:
            state = game.start(game.draw(random, shape, start=True))
            for _ in range(scenario.max_cycles):
                state, *_ = advance(state, next(actions), random.round_key())
                yield

    rounds = iter(play())
    with warnings.catch_warnings():  # on caches that torch.compile looks through
        warnings.simplefilter("ignore")
        for _ in range(4):  # the first rounds are of three kinds
            next(rounds)
    return lambda: next(rounds)


def compiled(step: Callable[..., Any]) -> Callable[..., Any]:
    """Return a step on tensors, compiled by torch into one graph."""
    import torch

    # Steps of several sizes share their code, and torch limits the compilations of a code by default.
    known = inspect.signature(torch.compile).parameters
    apart: Any = {"isolate_recompiles": True} if "isolate_recompiles" in known else {}
    # The library does not change during the timing; guards on the arguments stay.
    unguarded: dict[str, Any] = {"guard_filter_fn": torch.compiler.skip_guard_on_globals_unsafe}
    made: Any = torch.compile(step, dynamic=False, fullgraph=True, options=unguarded, **apart)
    in_inference: Callable[..., Any] = torch.inference_mode()(made)
    return in_inference


def source(library: str, seed: int) -> tuple[Any, Random]:
    """Return an array with the library and dtype, and a matching source of random numbers."""
    like: Any = np.zeros((), np.float32)
    if library != "NumPy":
        import torch

        like = torch.zeros(())
    return like, Random(np.random.default_rng(seed), like)


def machine(threads: int = 1) -> str:
    """Return the machine and the software that timings are of, in words."""
    packages = [f"Python {platform.python_version()}"]
    for name in ("numpy", "torch"):
        try:
            packages.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    return f"{os.cpu_count()} cores of {platform.machine()}, {', '.join(packages)}, torch on {threads} of them"
