"""Two processes that write one stream and are killed: `python tests/logs/two_writers.py FIRST LAST`
for some seeds."""

import gc
import hashlib
import multiprocessing
import random
import shutil
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

from late_ratings import (
    EVERY,
    Rating,
    Reference,
    check_end,
    some_batches,
    update,
)

from roletrust_env.logs import TrustStream
from roletrust_env.trust import make_trust_model

_FORK = multiprocessing.get_context("fork")
_MODELS = "mean", "mean", "role-trust", "leave-one-out"
_ATTEMPTS, _QUIET = 20, 15  # the last attempts are not killed
_KILLED, _LONGEST = (
    0.3,
    0.015,
)  # probability that a writer is killed in an attempt, and seconds until then


class Job(NamedTuple):
    """The batches of a sequence, which both writers may send into one state."""

    folder: Path
    model: str
    batches: list[list[Rating]]

    @classmethod
    def of(cls, rng: random.Random, folder: Path) -> "Job":
        """Draw a sequence."""
        return cls(
            folder,
            rng.choice(_MODELS),
            some_batches(rng, 5),
        )

    @property
    def path(self) -> Path:
        return self.folder / "state" / "state.npz"

    @property
    def log(self) -> Path:
        return self.folder / "log"

    def opened(self) -> Any:
        settings: Any = {"every": EVERY, "keep_evidence": True, "repeats": False}
        return TrustStream.opened(self.path, make_trust_model(self.model), **settings)

    def state(self) -> str:
        """Return what tells states apart."""
        return hashlib.sha256(self.path.read_bytes()).hexdigest() if self.path.exists() else "none"

    def send(self, numbers: list[int], pipe: Connection) -> None:
        """Send some batches and acknowledge each; an attempt is noted before it changes
        anything."""
        for number in numbers:
            with self.opened() as stream:
                with self.log.open("a") as file:
                    file.write(f"{number} {self.state()}\n")
                update(stream, self.batches[number])
            pipe.send(number)


def _serve(pipe: Connection) -> None:
    """Send what is asked for, until killed."""
    gc.disable()  # it would copy all pages of the parent
    while True:
        job, numbers = pipe.recv()
        job.send(numbers, pipe)
        pipe.send(None)


class Writer:
    """A process that sends batches, warm for many sequences; `alive` is whether it may be asked
    again."""

    def __init__(self) -> None:
        self.pipe, other = _FORK.Pipe()
        self.process = _FORK.Process(target=_serve, args=(other,), daemon=True)
        self.process.start()
        other.close()
        self.alive = True

    def kill(self) -> None:
        """Kill the process at once."""
        self.process.kill()
        self.alive = False

    def end(self) -> None:
        """Kill the process if there is one, and wait."""
        if not self.pipe.closed:
            self.kill()
            self.acknowledged()

    def acknowledged(self) -> set[int]:
        """Return the batches that the process acknowledges until it is through, or dead."""
        found = set[int]()
        try:
            while (number := self.pipe.recv()) is not None:
                found.add(number)
        except (EOFError, ConnectionError):
            self.alive = False
        if not self.alive:
            self.pipe.close()
            self.process.join()
        return found


def check_two_writers(
    seeds: Iterable[int], folder: Path, tell: Callable[[int, str], None] | None = None
) -> None:
    """Check a sequence for each seed; without `tell`, which gets the faults, a fault is an
    error."""
    gc.collect()
    gc.freeze()  # else each process that is forked copies the pages of what it looks through
    writers = [Writer(), Writer()]
    try:
        for seed in seeds:
            try:
                _check(seed, writers, Job.of(random.Random(seed), folder / "sequence"))
            except Exception:
                if tell is None:
                    raise
                tell(seed, traceback.format_exc())
                for writer in writers:
                    writer.end()
            shutil.rmtree(folder / "sequence")
    finally:
        gc.unfreeze()
        for writer in writers:
            writer.end()


def _check(seed: int, writers: list[Writer], job: Job) -> None:
    """Let both share the batches of a sequence, kill them, and send again what was not
    acknowledged."""
    rng = random.Random(~seed)
    job.path.parent.mkdir(parents=True)
    left = set(range(len(job.batches)))
    for attempt in range(_ATTEMPTS):
        writers[:] = [writer if writer.alive else Writer() for writer in writers]
        for side, writer in enumerate(writers):
            writer.pipe.send((job, sorted(left)[side::2]))
        for writer in writers if attempt < _QUIET else ():
            if rng.random() < _KILLED:
                time.sleep(rng.random() * _LONGEST)
                writer.kill()
        for writer in writers:
            left -= writer.acknowledged()
        if not left:
            break
    assert not left
    attempts = [line.split() for line in job.log.read_text().splitlines()]
    states = [*(state for _, state in attempts[1:]), job.state()]
    saved = [
        int(number)
        for (number, before), after in zip(attempts, states, strict=True)
        if before != after
    ]
    assert set(saved) == set(range(len(job.batches)))  # nothing that was acknowledged is lost
    reference = Reference(repeats=False)
    for number in saved:
        reference.update(job.batches[number])
    with job.opened() as stream:
        check_end(stream, reference)
    assert [file.name for file in job.path.parent.iterdir()] == ["state.npz"]


def main() -> None:
    """Check the seeds from one to another, and print the faults."""
    first, last = map(int, sys.argv[1:])
    began, faults = time.time(), 0

    def tell(seed: int, fault: str) -> None:
        nonlocal faults
        faults += 1
        print(f"seed {seed}: {fault}", flush=True)

    with tempfile.TemporaryDirectory(dir="/dev/shm") as folder:
        for start in range(first, last, 1000):
            stop = min(start + 1000, last)
            check_two_writers(range(start, stop), Path(folder), tell)
            print(
                f"seeds {first} to {stop - 1}: {faults} faults, {time.time() - began:.0f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()
