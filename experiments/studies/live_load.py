"""The load of the manager of a live team, by team size and by trust model: CPU, memory, and the time to trust.

A manager and raters that sign their ratings run as processes on loopback, and a listener takes the trust. Use a quiet
machine, since other programs change the result. For several trust models, the table has the processor time of one
round, which they change less. 20 minutes for both recipes.
"""

import multiprocessing
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from roletrust_env import make_scenario
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.live.nodes.manager_node import run_manager_node
from roletrust_env.live.nodes.run_loop import SECOND, run_until_signal, run_with_parent
from roletrust_env.live.team import Team
from roletrust_env.live.validation import MANAGER
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node, Reader
from roletrust_env.live.wire.keys import Signer, make_keys
from roletrust_env.live.wire.topics import RATINGS, TRUST
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust import trust_models
from studies.study import Recipe, Study
from studies.timing import machine

_MEET_S = 60.0  # until a team must be complete
_MEETING_S = 1.0  # until another manager would be found
_SETTLED = 10  # complete rounds before the measurement begins
_LOOK_S = 0.05
_STOP_S = 5.0

_EACH = (
    "A team has as many raters as providers. Each rater rates each provider {rate:g} times a second for {seconds:g} s, "
    "with signed ratings, on loopback."
)
_CAPTION = (
    f"{_EACH} CPU is the manager's use of one core. Median and largest are times from the sending of the ratings to "
    "the arrival of the trust at a listener. Memory is that of the manager; grown by is the increase of its median "
    "from the first half of the time to the second. The raters and the listener run on the same machine."
)
_CAPTION_OF_MODELS = (
    "CPU time of the manager for one round in ms, with all that a round takes: ratings are received, checked and "
    f"matched, trust is updated, written to disk and published. {_EACH} A dash marks a team that did not get together. "
    "The file live-load.csv also has the delays and the share of complete rounds."
)


class Options(NamedTuple):
    """Teams to measure.

    Attributes:
        side: Numbers of raters, and of providers.
        model: Specs of the trust models of the manager; all that are installed if left out.
        seconds: Time for each team, seconds.
        rate: Rounds per second.
    """

    side: tuple[int, ...] = (3, 10, 100, 200)
    model: tuple[str, ...] = ("role-trust",)
    seconds: float = 30.0
    rate: float = 2.0


RECIPES = {
    "live-load": Recipe(Options(), {"live-load.md": "live-load.md"}),
    "live-load-models": Recipe(Options((10, 100), (), 10.0), {"live-load.md": "live-load-models.md"}),
}


class Load(NamedTuple):
    """Measurements of a team.

    Attributes:
        model: Text of the trust model.
        raters: Number of raters, and of providers; each rater rates all providers in every round.
        rounds: Number of published rounds during the measurement.
        complete: Share of the expected rounds without a missing rater.
        cpu: CPU time of the manager as a share of a core.
        round_cpu_ms: CPU time of the manager for each published round, in ms; NaN without rounds.
        median_ms: Median time in ms from the sending of ratings to the arrival of trust at a listener.
        largest_ms: Largest of these times.
        memory_mb: Memory of the manager at the end.
        grown_mb: Growth of its median memory from the first half of the time to the second.
    """

    model: str
    raters: int
    rounds: int
    complete: float
    cpu: float
    round_cpu_ms: float
    median_ms: float
    largest_ms: float
    memory_mb: float
    grown_mb: float


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure all teams, and write their load."""
    with Study(__name__, RECIPES, arguments) as study:
        sides, chosen, seconds, rate = study.options
        models = chosen or tuple(trust_models())
        loads = list[Load]()
        for text in models:
            for side in sides:
                with tempfile.TemporaryDirectory() as folder:
                    one = measure_load(text, side, seconds, rate, Path(folder))
                loads += [one] if one else []
        study.csv("live-load.csv", Load._fields, loads)
        if len(models) > 1:
            title, caption = "# The load of a manager, by trust model", _CAPTION_OF_MODELS
            headings, lines = [f"{side}x{side}" for side in sides], _by_model(loads, models, sides)
        else:
            title, caption = "# The load of a manager", _CAPTION
            headings = ["team", "complete rounds", "CPU", "median", "largest", "memory", "grown by"]
            lines = [_line(one) for one in loads]
        study.page(
            "live-load.md",
            title,
            caption.format(rate=rate, seconds=seconds),
            markdown_table(["trust model", *headings], lines, names=1),
            f"Made by `{study.command}` on {machine()}.",
        )


def measure_load(model: str, side: int, seconds: float, rate: float, folder: Path) -> Load | None:
    """Run a manager and raters that sign their ratings, and listen to the trust.

    Args:
        model: Text of the trust model, `NAME[:key=value,...]`.
        side: Number of raters, and of providers.
        seconds: Length of the measurement.
        rate: Number of rounds per second.
        folder: New folder for keys and the journal.

    Returns:
        The load, which is read from /proc; None if the team is not complete in time.

    Raises:
        ValueError: Another manager runs.
    """
    team = Team(tuple(f"sr_{i}" for i in range(side)), tuple(f"sp_{j}" for j in range(side)))
    shared = {"team": team, "keys": folder / "keys", "period": round(SECOND / rate)}
    make_keys(folder / "keys", [MANAGER, *team.raters])
    node = Node("listener")
    time.sleep(_MEETING_S)
    if node.writers_of(TRUST):
        raise ValueError(f"a manager publishes {TRUST} already; stop it, or set another ROS_DOMAIN_ID")
    trust, made = node.reader(TRUST, messages.TRUST, depth=1000), parse_trust_model(model, make_scenario("paper-3x3"))
    with (
        _process(run_manager_node, model=made, journal=folder / "journal", **shared) as manager,
        _process(run_raters, **shared),
    ):
        if not _is_complete(trust, side):
            return None
        before, began = cpu_s(manager), time.monotonic()
        memory, delays, complete = list[float](), list[float](), 0
        while (spent := time.monotonic() - began) < seconds:
            node.wait(_LOOK_S)
            now = time.time_ns()
            memory.append(memory_mb(manager))
            for message in _received(trust):
                delays.append((now - messages.stamp_of(message)) / 1e6)
                complete += not len(message.missing)
        cpu = cpu_s(manager) - before
    half = len(memory) // 2
    grown = median(memory[half:]) - median(memory[: half + 1])
    delay = (median(delays), max(delays)) if delays else (np.nan, np.nan)
    share, of_round = min(1.0, complete / (rate * seconds)), 1e3 * cpu / len(delays) if delays else np.nan
    return Load(model, side, len(delays), share, cpu / spent, of_round, *delay, memory[-1], grown)


def run_raters(team: Team, keys: Path, period: int) -> None:
    """Run all raters of a team, each on its own topic, until a signal. Ratings are signed in advance."""
    node, random = Node("raters"), np.random.default_rng(0)
    voices = {name: node.writer(f"/{name}{RATINGS}", messages.RATINGS) for name in team.raters}
    signers = {name: Signer(keys, name) for name in team.raters}
    stamp = 0
    with run_until_signal() as active:
        while active:
            stamp = max(stamp + period, (time.time_ns() // period + 1) * period)
            signed = {name: _signed(name, stamp, team, signer, random) for name, signer in signers.items()}
            active.sleep_until(stamp)
            for name, raw in signed.items():
                voices[name].write_raw(raw)


def _signed(name: str, stamp: int, team: Team, signer: Signer, random: np.random.Generator) -> bytes:
    ratings = dict(zip(team.providers, random.random(len(team.providers)).tolist(), strict=True))
    return messages.encode(messages.ratings_message(name, stamp, ratings, signer))


@contextmanager
def _process(run: Callable[..., None], **arguments: Any) -> Iterator[int]:
    """Run a process in a context, and yield its id."""
    context = multiprocessing.get_context("spawn")
    process = context.Process(target=run_with_parent, args=(run,), kwargs=arguments, daemon=True)
    process.start()
    try:
        yield process.pid or 0
    finally:
        process.terminate()
        process.join(_STOP_S)
        process.kill()


def _is_complete(trust: Reader, side: int) -> bool:
    """Wait for some complete rounds, and return whether they come in time."""
    complete, end = 0, time.monotonic() + _MEET_S
    while complete < _SETTLED and time.monotonic() < end:
        time.sleep(_LOOK_S)
        complete += sum(not len(one.missing) and len(one.raters) == side for one in _received(trust))
    return complete >= _SETTLED


def _received(trust: Reader) -> list[Any]:
    """Return the messages since the last call."""
    return [messages.decode(raw, messages.TRUST) for raw in trust.take()]


def cpu_s(process: int) -> float:
    """Return the CPU time of a process and its threads in seconds."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def memory_mb(process: int) -> float:
    """Return the memory of a process in megabytes."""
    pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def _by_model(loads: Sequence[Load], models: Sequence[str], sides: Sequence[int]) -> list[list[str]]:
    """Return a line for each trust model with the CPU time of a round for each size, in ms."""
    cpu = {(one.model, one.raters): f"{one.round_cpu_ms:.1f}" for one in loads if one.rounds}
    return [[text, *(cpu.get((text, side), "-") for side in sides)] for text in models]


def _line(one: Load) -> list[str]:
    return [
        one.model,
        f"{one.raters}x{one.raters}",
        f"{one.complete:.0%} of {one.rounds}",
        f"{one.cpu:.1%}",
        f"{one.median_ms:.0f} ms",
        f"{one.largest_ms:.0f} ms",
        f"{one.memory_mb:.0f} MB",
        f"{one.grown_mb:.1f} MB",
    ]


if __name__ == "__main__":
    main()
