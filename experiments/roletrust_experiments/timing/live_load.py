"""What a manager of a large team takes: CPU, memory, and the time from ratings to trust, on loopback."""

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.live.nodes.manager_node import run_manager_node
from roletrust_env.live.nodes.run_loop import SECOND, run_until_signal
from roletrust_env.live.nodes.topics import RATINGS, TRUST
from roletrust_env.live.trust_tracker import Team
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.dds import Node, Reader
from roletrust_env.live.wire.keys import Signer, make_keys
from roletrust_env.trust import make_trust_model

_MEET_S = 60.0  # in which a team must get together
_MEETING_S = 1.0  # in which another manager would be found
_SETTLED = 10  # rounds in which nobody is missing, before anything is measured
_LOOK_S = 0.05
_STOP_S = 5.0


class Load(NamedTuple):
    """What was measured of a team.

    Attributes:
        raters: how many, and as many providers; each rates all of them in every round.
        rounds: that were published while it was measured.
        complete: the share of the rounds that there should be in which nobody was missing.
        cpu: of the manager, as a share of a core.
        median_ms: from the moment at which ratings are sent to the trust that follows, as somebody else hears it.
        largest_ms: the largest of these.
        memory_mb: of the manager at the end.
        grown_mb: by which its median grew from the first half of the time to the second.
    """

    raters: int
    rounds: int
    complete: float
    cpu: float
    median_ms: float
    largest_ms: float
    memory_mb: float
    grown_mb: float


def measure_load(side: int, seconds: float, rate: float, folder: Path, advance: Callable[[float], object]) -> Load:
    """Run a manager and raters, who sign, and listen to the trust.

    Args:
        side: raters, and providers.
        seconds: how long it is measured.
        rate: rounds in a second.
        folder: for keys and the journal, a new one.
        advance: told how long it was measured so far, seconds.

    Raises:
        ValueError: this system does not tell what processes take, or the team does not get together.
    """
    if not Path("/proc/self/stat").exists():
        raise ValueError("what processes take is read from /proc, which this system has not")
    team = Team(tuple(f"sr_{i}" for i in range(side)), tuple(f"sp_{j}" for j in range(side)))
    shared = {"team": team, "keys": folder / "keys", "period": round(SECOND / rate)}
    make_keys(folder / "keys", team.raters)
    node = Node("listener")
    time.sleep(_MEETING_S)
    if node.writers_of(TRUST):
        raise ValueError(f"a manager publishes {TRUST} already; stop it, or set another ROS_DOMAIN_ID")
    trust, model = node.reader(TRUST, messages.TRUST, depth=1000), make_trust_model("role-trust")
    with (
        _process(run_manager_node, model=model, journal=folder / "journal", **shared) as manager,
        _process(run_raters, **shared),
    ):
        _gather(trust, side)
        before, began = cpu_s(manager), time.monotonic()
        memory, delays, complete = list[float](), list[float](), 0
        while (spent := time.monotonic() - began) < seconds:
            node.wait(_LOOK_S)
            now = time.time_ns()
            advance(spent)
            memory.append(_memory_mb(manager))
            for said in _heard(trust):
                delays.append((now - messages.stamp_of(said)) / 1e6)
                complete += not len(said.missing)
        cpu = (cpu_s(manager) - before) / spent
    half = len(memory) // 2
    grown = median(memory[half:]) - median(memory[: half + 1])
    delay = (median(delays), max(delays)) if delays else (np.nan, np.nan)
    return Load(side, len(delays), min(1.0, complete / (rate * seconds)), cpu, *delay, memory[-1], grown)


def run_raters(team: Team, keys: Path, period: int) -> None:
    """Be all raters of a team, each on a topic of its own, until told to stop. Ratings are signed before their time."""
    node, random = Node("raters"), np.random.default_rng(0)
    voices = {name: node.writer(f"/{name}{RATINGS}", messages.RATINGS) for name in team.raters}
    signers = {name: Signer(keys, name) for name in team.raters}
    stamp = 0
    with run_until_signal() as active:
        while active:
            stamp = max(stamp + period, (time.time_ns() // period + 1) * period)
            said = {name: _signed(name, stamp, team, signer, random) for name, signer in signers.items()}
            active.sleep_until(stamp)
            for name, raw in said.items():
                voices[name].write_raw(raw)


def _signed(name: str, stamp: int, team: Team, signer: Signer, random: np.random.Generator) -> bytes:
    ratings = dict(zip(team.providers, random.random(len(team.providers)).tolist(), strict=True))
    message = messages.ratings_message(name, stamp, ratings)
    message.signature = np.frombuffer(signer.sign(messages.encode(message)), np.uint8)
    return messages.encode(message)


@contextmanager
def _process(run: Callable[..., None], **arguments: Any) -> Iterator[int]:
    """A process that is stopped at the end, by its number."""
    process = multiprocessing.get_context("spawn").Process(target=run, kwargs=arguments, daemon=True)
    process.start()
    try:
        yield process.pid or 0
    finally:
        process.terminate()
        process.join(_STOP_S)
        process.kill()


def _gather(trust: Reader, side: int) -> None:
    """Wait until some rounds in which nobody was missing."""
    complete, end = 0, time.monotonic() + _MEET_S
    while complete < _SETTLED:
        if time.monotonic() > end:
            raise ValueError(f"{side} raters do not get together in {_MEET_S:.0f} s; that is too many for this machine")
        time.sleep(_LOOK_S)
        complete += sum(not len(said.missing) and len(said.raters) == side for said in _heard(trust))


def _heard(trust: Reader) -> list[Any]:
    """What was published since the last time."""
    return [messages.decode(raw, messages.TRUST) for raw in trust.take()]


def cpu_s(process: int) -> float:
    """What a process and its threads took of the processor so far, seconds."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _memory_mb(process: int) -> float:
    """What a process has of the memory, megabytes."""
    pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
