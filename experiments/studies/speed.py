"""How fast the games run: one environment, batches, and time per rating up to 3,000 x 3,000, beside mpe2 and VMAS.

Ratings as a list of edges, as `roletrust rate` reads them, are measured up to ten million beside the same sums in plain
NumPy and the bandwidth of the memory, and streams of ratings with two million agents. Peers are measured if they are
installed; all contestants take turns. A step includes all that a learner needs: drawing noise, playing the round, and
computing observations and rewards. The tables show the median of the repeats, the least and the greatest. Five minutes,
with `--quick` half a minute.
"""

import contextlib
import importlib.util
import io
import itertools
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from importlib.metadata import distributions
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm

from roletrust_agents.training.learners import make_model
from roletrust_agents.training.settings import PPOSettings
from roletrust_env import Game, Scenario, make_scenario, parallel_env
from roletrust_env.data import TrustStream
from roletrust_env.envs.sb3 import AttackVecEnv, BatchVecEnv, Flags, Floats, Step
from roletrust_env.envs.vector import AttackVectorEnv
from roletrust_env.evaluation.resources import in_bytes
from roletrust_env.game.make_task import make_task
from roletrust_env.game.state import Actions
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust import make_trust_model
from roletrust_env.world import AgentGroup
from studies.study import Recipe, Study
from studies.timing import (
    PLAIN,
    Contestant,
    Edges,
    Size,
    Spread,
    Timing,
    by_hand,
    bytes_per_s,
    compiled,
    copying,
    machine,
    measure,
    round_of,
    source,
    torch_threads,
    trust_update,
)

EDGES = "role-trust on edges"

_PEERS = ("array-api-compat", "torch", "mpe2", "vmas")
_SAMPLES, _BATCH_SAMPLES = 64, 4  # actions, sampled before the clock starts, and used in turn
_DRAWN = 40  # batches of a stream, drawn before the clock starts, and taken in turn; then a pair meets again
_BATCHES = 100, 1000, 10_000  # ratings of a batch of a stream
_SIDES = 3, 30, 300, 3000  # raters, and as many providers, for the time per rating
_LONG, _FEW = 2_000_000, 3  # ratings of a round from which on it has few turns, and their number


class Options(NamedTuple):
    """Whether to measure fewer sizes and repeats, and the number of threads of torch."""

    quick: bool = False
    threads: int = 1


class Plan(NamedTuple):
    """Sizes and repeats of a measurement.

    Attributes:
        batches: Sizes of the batches for NumPy, torch and VMAS.
        compiled: Sizes of the batches for compiled torch.
        repeats: Number of turns of each contestant.
        slice_s: Approximate length of a turn, in seconds.
        edges: Numbers of ratings of a round as a list of edges.
        stream: Number of raters, and of as many providers, of a stream.
    """

    batches: tuple[int, ...]
    compiled: tuple[int, ...]
    repeats: int
    slice_s: float
    edges: tuple[int, ...]
    stream: int


RECIPES = {"speed": Recipe(Options())}
FULL = Plan((1024, 8192, 65536), (1024, 8192, 65536), 11, 0.4, edges=(1_000_000, 10_000_000), stream=1_000_000)
QUICK = Plan((1024, 8192), (8192,), 5, 0.1, edges=(100_000,), stream=100_000)


class Target(NamedTuple):
    """A promised speed and the measured one; `found` is None if one side of the comparison was not measured."""

    what: str
    bound: float
    at_least: bool
    found: Spread | None

    @property
    def ok(self) -> bool | None:
        """True if the median keeps the promise; None if nothing was measured."""
        if self.found is None:
            return None
        return self.found.median >= self.bound if self.at_least else self.found.median <= self.bound


def main(arguments: Sequence[str] | None = None) -> None:
    """Time all contestants, and write the tables."""
    with Study(__name__, RECIPES, arguments) as study:
        quick, threads = study.options
        plan, seed = QUICK if quick else FULL, study.seed
        players = _players(plan, seed)
        with study.progress(len(players) + len(plan.edges) + 2) as advance, torch_threads(threads):
            steps: list[Timing] = []
            for games, entries in players.items():
                steps += _race(study, entries, plan)
                advance(f"steps of {games:,}")
            ratings = _race(study, _raters(seed), plan)
            advance("ratings")
            rounds: dict[int, list[Timing]] = {}
            memory: dict[tuple[int, str], int] = {}
            for size in plan.edges:
                edges = Edges.of(size, seed)
                made = [by_hand(edges), round_of(EDGES, make_trust_model("role-trust"), edges)]
                memory |= {(size, one.contestant.name): one.memory for one in made}
                repeats = _FEW if size > _LONG else plan.repeats
                rounds[size] = measure([one.contestant for one in made], repeats, plan.slice_s)
                advance(f"lists of {size:,}")
            (copied,) = measure([copying()], plan.repeats, plan.slice_s)
            streams = measure([stream(batch, plan.stream, seed) for batch in _BATCHES], plan.repeats, plan.slice_s)
            advance("streams")
        targets = _targets(steps, ratings)
        if not quick:
            targets += _edge_targets(rounds, streams, memory)
            share = ppo_share(seed=seed)
            targets.append(Target("frames/s of PPO on 256 attack tasks / on no game", 0.8, True, Spread(*[share] * 3)))
        lists = [timing for timings in rounds.values() for timing in timings] + streams
        study.csv("speed.csv", _HEADER, map(_row, [*steps, *ratings, *lists]))
        study.facts = {
            "targets": [{**t._asdict(), "found": t.found and t.found._asdict(), "ok": t.ok} for t in targets],
            "peak_memory": [{"ratings": size, "name": name, "bytes": peak} for (size, name), peak in memory.items()],
            "copied_bytes_per_s": bytes_per_s(copied),
            "peers": {d.metadata["Name"]: d.version for d in distributions() if d.metadata["Name"] in _PEERS},
        }
        step_headings = ["steps per second", "games", "env-steps/s", "agent-steps/s", "least - greatest"]
        rating_headings = ["time per rating on NumPy", "SR x SP", "ns per rating", "least - greatest", "ms in all"]
        list_headings = ["ratings as a list", "ratings", "M ratings/s", "least - greatest", "memory"]
        study.page(
            "speed.md",
            "# Speed",
            markdown_table(step_headings, map(_step_cells, steps), 1),
            markdown_table(rating_headings, map(_rating_cells, ratings), 1),
            markdown_table(list_headings, _list_cells(rounds, streams, memory), 1),
            markdown_table(["promise", "promised", "found", "least - greatest", ""], map(_target_cells, targets), 1),
            f"An agent-step is one agent acting once. A whole round draws noise, updates trust, plays the game and "
            f"makes observations. {PLAIN}: the same sums by hand; memory: peak, with the ratings; streams have "
            f"{2 * plan.stream:,} agents and take numbers for names; copying an array moves "
            f"{bytes_per_s(copied) / 1e9:.1f} GB/s. The last table has ratios of agent-steps/s, and of time per "
            "rating; the median decides.",
            f"Made by `{study.command}` on {machine(threads)}.",
        )


class Entry(NamedTuple):
    """A contestant that is not made yet: the package that it needs, and a function that makes it."""

    package: str
    make: Callable[[], Contestant]


def _players(plan: Plan, seed: int) -> dict[int, list[Entry]]:
    """Return the contestants for steps per second by number of games, so that equal sizes are measured together."""
    players = {1: [Entry("numpy", partial(one_environment, seed)), Entry("mpe2", partial(simple_adversary, seed))]}
    for games in sorted({*plan.batches, *plan.compiled}):
        entries = players[games] = []
        if games in plan.batches:
            entries.append(Entry("vmas", partial(simple_spread, games, seed)))
            entries.append(Entry("numpy", partial(batch, "NumPy", games, seed)))
            entries.append(Entry("torch", partial(batch, "torch", games, seed)))
            entries.append(Entry("numpy", partial(attack_tasks, games, seed)))
        if games in plan.compiled:
            entries.append(Entry("torch", partial(batch, "compiled torch", games, seed)))
    return players


def _raters(seed: int) -> list[Entry]:
    """Return the contestants for the time per rating."""
    model = Game(make_scenario("paper-3x3")).model
    entries = []
    for side in _SIDES:
        entries.append(Entry("numpy", partial(trust_update, "trust model", model, Size(side, side), "NumPy", seed)))
        entries.append(Entry("numpy", partial(whole_round, side, seed)))
    return entries


def _race(study: Study[Options], entries: Sequence[Entry], plan: Plan) -> list[Timing]:
    """Make the contestants and time them; say which could not be made."""
    contestants = []
    for package, make in entries:
        if importlib.util.find_spec(package) is None:
            study.warn(f"not measured: {package} is not installed")
            continue
        try:
            contestants.append(make())
        except RuntimeError as error:  # such as torch.compile without a C++ compiler
            study.warn(f"not measured: {package}: {str(error).strip().splitlines()[0]}")
    return measure(contestants, plan.repeats, plan.slice_s)


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


def stream(batch: int, agents: int, seed: int) -> Contestant:
    """Return a stream of role-trust with so many raters and as many providers, known by numbers, as a contestant."""
    rng, everyone = np.random.default_rng(seed), np.arange(agents)
    taken = TrustStream(make_trust_model("role-trust"))
    for raters, providers in ((everyone, rng.permutation(agents)), (rng.permutation(agents), everyone)):
        taken.update(raters, providers, rng.random(agents))
    drawn = [(rng.integers(0, agents, batch), rng.integers(0, agents, batch), rng.random(batch)) for _ in range(_DRAWN)]
    batches = itertools.cycle(drawn)
    return Contestant(f"stream in batches of {batch:,}", 1, 2 * agents, lambda: taken.update(*next(batches)), batch)


class NoGame(BatchVecEnv):
    """An empty `VecEnv` with the spaces and the size of another one.

    Args:
        like: Other environment, whose games have a fixed length.
        length: Length of an episode in rounds.
    """

    def __init__(self, like: AttackVecEnv, length: int) -> None:
        zeros: Floats = np.zeros((like.num_envs, *(like.observation_space.shape or ())), np.float32)
        self._zeros, self._length, self._round = zeros, length, 0
        self._infos: list[dict[str, Any]] = [{} for _ in range(like.num_envs)]
        seen: Any = like.observation_space
        action: Any = like.action_space
        super().__init__(like.num_envs, like.task.game, seen, action, scaled=False, seed=0)

    def step_async(self, actions: Any) -> None:
        """Ignore the actions."""

    def step_wait(self) -> tuple[Floats, Floats, Flags, list[dict[str, Any]]]:
        """Return zeros."""
        self._round += 1
        over = self._round % self._length == 0
        return self._zeros, self._zeros[:, 0], np.full(self.num_envs, over), self._infos

    def _restart(self, ended: Flags | None) -> None:
        self._round = 0

    def _play(self, actions: Floats) -> Step:
        raise NotImplementedError("no round is ever played")

    def _observe(self) -> Floats:
        return self._zeros


def ppo_share(*, games: int = 256, rollouts: int = 8, turns: int = 5, seed: int = 0) -> float:
    """Return the frames per second of PPO on `ProviderAttack`, as a share of those on an empty environment.

    The settings are those of `roletrust train`. Both take turns, and of each the fastest one counts, which other work
    on the machine disturbed least.

    Args:
        games: Size of the batch.
        rollouts: Number of rollouts with updates in a turn.
        turns: Number of turns of each environment.
        seed: Random seed.
    """
    settings = PPOSettings(games=games)
    task = make_task("paper-3x3", ("sp_2",), objective="exploit", max_cycles=200)
    env = AttackVecEnv(task, games)
    on_task, on_nothing = make_model("ppo", settings, env, seed), make_model("ppo", settings, env, seed)
    on_nothing.set_env(NoGame(env, 200))
    frames = rollouts * settings.n_steps * games
    speeds = np.asarray([[_speed(model, frames) for model in (on_task, on_nothing)] for _ in range(turns + 1)][1:])
    on_the_task, on_none = speeds.max(axis=0).tolist()
    return float(on_the_task / on_none)


def _speed(model: BaseAlgorithm, frames: int) -> float:
    """Return the frames per second of one turn."""
    began = perf_counter()
    model.learn(frames, reset_num_timesteps=False)
    return frames / (perf_counter() - began)


def _targets(steps: Sequence[Timing], ratings: Sequence[Timing]) -> list[Target]:
    """Return the promised and the measured speeds."""
    played = {(t.contestant.name, t.contestant.games): t for t in steps}
    rated = {(t.contestant.name, t.contestant.agents // 2): t for t in ratings}

    def faster(ours: str, peer: str, games: int, bound: float) -> Target:
        a, b = played.get((ours, games)), played.get((peer, games))
        what = f"{ours}{f' of {games:,}' * (games > 1)} / {peer}"
        return Target(what, bound, True, a.times_faster(b) if a and b else None)

    def steady(name: str, side: int, bound: float) -> Target:
        a, b = rated.get((name, 3000)), rated.get((name, side))
        return Target(f"{name}, 3,000 x 3,000 / {side} x {side}", bound, False, a.times_dearer(b) if a and b else None)

    tasks = played.get(("attack task batch", 1024))
    million = Spread.of(rate / 1e6 for rate in tasks.env_steps()) if tasks else None

    return [
        Target("attack task batch of 1,024, million env-steps/s", 1.0, True, million),
        faster("one environment", "mpe2 simple_adversary", 1, 7.0),
        faster("NumPy batch", "VMAS simple_spread", 1024, 12.0),
        faster("compiled torch batch", "VMAS simple_spread", 8192, 20.0),
        steady("trust model", 300, 1.5),
        steady("whole round", 30, 2.0),
    ]


def _edge_targets(
    rounds: Mapping[int, Sequence[Timing]], streams: Sequence[Timing], memory: Mapping[tuple[int, str], int]
) -> list[Target]:
    """Return the promised and the measured speeds of lists."""
    listed = next(t for t in rounds[1_000_000] if t.contestant.name == EDGES)
    most = max(peak for (size, _), peak in memory.items() if size == 10_000_000) / 1e9
    return [
        Target("M ratings/s of a list of 1,000,000", 10.0, True, _millions(listed)),
        Target("GB of memory for a list of 10,000,000", 3.0, False, Spread.of([most])),
        Target("M ratings/s of a stream in batches of 10,000", 2.5, True, _millions(streams[-1])),
    ]


_HEADER = (
    *("name", "games", "agents", "ratings", "step_us", "step_us_least", "step_us_greatest"),
    *("env_steps_per_s", "agent_steps_per_s", "ns_per_rating"),
)


def _row(t: Timing) -> tuple[Any, ...]:
    """Return a row of the table of numbers."""
    who, per_rating = t.contestant, t.per_rating().median * 1e9 if t.contestant.ratings else None
    rates = t.env_steps().median, t.agent_steps().median
    return (
        who.name,
        who.games,
        who.agents,
        who.ratings or None,
        *Spread.of(1e6 * s for s in t.seconds),
        *rates,
        per_rating,
    )


def _step_cells(t: Timing) -> list[str]:
    acts = t.agent_steps()
    rates = [f"{t.env_steps().median:,.0f}", f"{acts.median:,.0f}", f"{acts.low:,.0f} - {acts.high:,.0f}"]
    return [t.contestant.name, f"{t.contestant.games:,}", *rates]


def _rating_cells(t: Timing) -> list[str]:
    side, each = t.contestant.agents // 2, Spread.of(1e9 * s for s in t.per_rating())
    whole = f"{each.median * t.contestant.ratings / 1e6:,.3f}"
    return [
        t.contestant.name,
        f"{side:,} x {side:,}",
        f"{each.median:,.1f}",
        f"{each.low:,.1f} - {each.high:,.1f}",
        whole,
    ]


def _list_cells(
    rounds: Mapping[int, Sequence[Timing]], streams: Sequence[Timing], memory: Mapping[tuple[int, str], int]
) -> Iterable[list[str]]:
    for size, timings in [*rounds.items(), (0, streams)]:
        for t in timings:
            rate, name = _millions(t), t.contestant.name
            peak = in_bytes(memory[size, name]) if size else ""
            yield [name, f"{t.contestant.ratings:,}", f"{rate.median:.2f}", f"{rate.low:.2f} - {rate.high:.2f}", peak]


def _millions(t: Timing) -> Spread:
    """Return millions of ratings per second."""
    return Spread.of(t.contestant.ratings / seconds / 1e6 for seconds in t.seconds)


def _target_cells(target: Target) -> list[str]:
    promised = f"{'at least' if target.at_least else 'at most'} {target.bound:g}"
    if target.found is None:
        return [target.what, promised, "not measured", "", ""]
    median, low, high = target.found
    return [target.what, promised, f"{median:.2f}", f"{low:.2f} - {high:.2f}", "ok" if target.ok else "not ok"]


if __name__ == "__main__":
    main()
