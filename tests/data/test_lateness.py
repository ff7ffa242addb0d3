"""Late, future, repeated and unordered ratings of a stream, also with two writers that are killed."""

import hashlib
import math
import multiprocessing
import os
import random
import time
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import pytest

from roletrust_env.data import TrustStream
from roletrust_env.trust import make_trust_model
from roletrust_env.trust.run import make_run

EVERY = 10.0
Rating = tuple[int, int, float, float]


class Policy(NamedTuple):
    """Settings of a stream."""

    late: Literal["drop", "count"] = "drop"
    lead: float | None = None
    repeats: bool = True


class Reference:
    """The policies, rating by rating: which ratings count, and in which round."""

    def __init__(self, policy: Policy) -> None:
        self.policy, self.rounds = policy, 0
        self.start = self.latest = math.nan
        self.running: list[Rating] = []
        self.ended: list[list[Rating]] = []
        self.late = self.ahead = self.repeated = 0

    def update(self, batch: list[Rating]) -> None:
        """Take a batch."""
        times = sorted(rating[3] for rating in batch)
        known = times[len(times) // 2] if math.isnan(self.latest) else self.latest
        reach, back = known, known
        for when in times:
            if when <= reach + (math.inf if self.policy.lead is None else self.policy.lead):
                reach = max(reach, when)
        for when in reversed(times):
            if when >= back - (math.inf if self.policy.lead is None else self.policy.lead):
                back = min(back, when)
        taken = [rating for rating in batch if rating[3] <= reach]
        self.ahead += len(batch) - len(taken)
        if not self.rounds:
            self.start = min([back, *([] if math.isnan(self.start) else [self.start])])
        first = max(self.start + self.rounds * EVERY, self.start)
        self.late += sum(rating[3] < first for rating in taken)
        if self.policy.late == "drop":
            taken = [rating for rating in taken if rating[3] >= first]
        self.running += taken
        self.latest = max([self.latest] * (not math.isnan(self.latest)) + [rating[3] for rating in taken] or [math.nan])
        while any(rating[3] >= self.start + (self.rounds + 1) * EVERY for rating in self.running):
            end = self.start + (self.rounds + 1) * EVERY
            self._end([rating for rating in self.running if rating[3] < end])
            self.running = [rating for rating in self.running if rating[3] >= end]
        self.running = self._distinct(self.running)

    def _end(self, ratings: list[Rating]) -> None:
        self.ended.append(self._distinct(ratings))
        self.rounds += 1

    def _distinct(self, ratings: list[Rating]) -> list[Rating]:
        distinct = ratings if self.policy.repeats else list(dict.fromkeys(ratings))
        self.repeated += len(ratings) - len(distinct)
        return distinct

    def trust(self, model: Any) -> list[dict[int, float]]:
        """Return the trust of raters and of providers by name, as one run of all rounds computes it."""
        rounds = [*self.ended, *([self._distinct(self.running)] if self.running else [])]
        names = [list(dict.fromkeys(rating[side] for some in rounds for rating in some)) for side in (0, 1)]
        run = make_run(model)
        for some in rounds:
            who, whom = (np.array([names[side].index(rating[side]) for rating in some], np.int64) for side in (0, 1))
            run.play(who, whom, np.array([rating[2] for rating in some], float))
        return [
            dict(zip(who, trust.tolist(), strict=True))
            for who, trust in zip(names, (run.rater_trust, run.provider_trust), strict=True)
        ]


def some_policy(rng: random.Random) -> Policy:
    return Policy(rng.choice(["drop", "count"]), rng.choice([None, 0, 15.0, 40.0]), rng.random() < 0.5)


def some_batches(rng: random.Random) -> list[list[Rating]]:
    """Return batches near a clock that goes on: some late, some far ahead, some sent again."""
    clock, sent, batches = 0.0, list[Rating](), list[list[Rating]]()
    for _ in range(rng.randint(1, 8)):
        clock += rng.choice([0, 3, 12, 30])
        batch = list[Rating]()
        for _ in range(rng.randint(1, 6)):
            off = rng.choice([0, 0, 0, rng.randint(-30, 9), rng.choice([-500, 500])])
            batch.append((rng.randint(0, 3), rng.randint(0, 3), rng.randint(0, 4) / 4, clock + off + rng.randint(0, 5)))
        sent += batch
        batches.append([*batch, *rng.choices(sent, k=rng.choice([0, 0, 2]))])
        if rng.random() < 0.2:
            batches.append(list(batch))
    return batches


def same_trust(stream: TrustStream, reference: Reference) -> None:
    stream.finish()
    found = stream.rater_trust(), stream.provider_trust()
    for one, other in zip(found, reference.trust(stream.model), strict=True):
        assert one == pytest.approx(other, abs=1e-12)


def update(stream: TrustStream, batch: list[Rating]) -> None:
    stream.update(*([rating[n] for rating in batch] for n in range(4)))


def check_sequence(seed: int, model: Any) -> None:
    """One sequence in one process, saved and loaded on its way."""
    rng = random.Random(seed)
    policy, batches = some_policy(rng), some_batches(rng)
    reference, stream = Reference(policy), TrustStream(model, every=EVERY, **policy._asdict())
    for batch in batches:
        reference.update(batch)
        update(stream, batch)
        assert (stream.n_late, stream.n_ahead, stream.rounds) == (reference.late, reference.ahead, reference.rounds)
    same_trust(stream, reference)
    assert stream.n_repeated == reference.repeated


def test_late_future_and_repeated_ratings_follow_the_policy() -> None:
    model = make_trust_model("role-trust")
    for seed in range(150):
        check_sequence(seed, model)


@pytest.mark.slow
def test_many_sequences_follow_the_policy() -> None:
    model = make_trust_model("mean")
    for seed in range(3_000):
        check_sequence(seed, model)


def test_one_wrong_time_does_not_end_a_stream() -> None:
    """Nor in its first batch, in either direction; and after a long silence the lead is raised."""
    stream = TrustStream(make_trust_model("mean"), every=1.0, lead=30.0)
    stream.update(["a", "b", "c", "d"], ["x"] * 4, [1.0] * 4, [0.0, 20_000.0, 20_001.0, 25_000.0])
    assert (stream.n_late, stream.n_ahead, stream.rounds) == (1, 1, 1)
    stream.update(["a"], ["x"], [1.0], [20_100.0])
    assert stream.n_ahead == 2
    stream.lead = 200.0
    stream.update(["a"], ["x"], [1.0], [20_100.0])
    assert (stream.n_ahead, stream.rounds) == (2, 100)


def test_a_stream_of_short_rounds_does_not_end() -> None:
    """The limit of rounds is from the running one on."""
    stream = TrustStream(make_trust_model("mean"), every=1.0)
    for when in (0.0, 900_000.0, 1_800_000.0):
        stream.update(["a"], ["x"], [1.0], [when])
    assert stream.rounds == 1_800_000
    with pytest.raises(ValueError, match="at most 1,000,000 are allowed"):
        stream.update(["a"], ["x"], [1.0], [3_000_000.0])


@pytest.mark.parametrize(
    ("policy", "words"),
    [
        ({"late": "error"}, "late is 'error'; it must be 'drop' or 'count'"),
        ({"lead": -1}, "the lead is -1"),
        ({"lead": math.nan}, "the lead is nan"),
        ({"lead": True}, "the lead is True"),
        ({"lead": 1, "every": None}, "a lead needs rounds by time"),
    ],
)
def test_what_is_no_policy_is_refused(policy: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        TrustStream(make_trust_model("mean"), **{"every": 1.0, **policy})


# --- two processes ------------------------------------------------------------------------------------


class Writer(NamedTuple):
    """What two processes do: batches that both may send, into one state."""

    folder: Path
    log: Path
    policy: Policy
    batches: list[list[Rating]]

    @property
    def path(self) -> Path:
        return self.folder / "state.npz"

    def opened(self) -> Any:
        return TrustStream.opened(self.path, make_trust_model("mean"), every=EVERY, **self.policy._asdict())

    def state(self) -> str:
        """Return what tells states apart."""
        return hashlib.sha256(self.path.read_bytes()).hexdigest() if self.path.exists() else "none"

    def send(self, numbers: list[int], acknowledged: Any) -> None:
        """Send some batches, one after the other; each attempt is noted before it changes anything."""
        for number in numbers:
            with self.opened() as stream:
                with self.log.open("a") as file:
                    file.write(f"{number} {self.state()}\n")
                update(stream, self.batches[number])
            acknowledged[number] = 1


def check_two_writers(seed: int, folder: Path) -> None:
    """Two processes share the batches of a sequence, are killed, and send again what was not acknowledged."""
    rng, fork = random.Random(seed), multiprocessing.get_context("fork")
    policy, batches = some_policy(rng)._replace(repeats=False), some_batches(rng)
    writer = Writer(folder / "state", folder / "log", policy, batches)
    writer.folder.mkdir(parents=True)
    acknowledged = fork.RawArray("b", len(batches))
    for attempt in range(20):
        left = [number for number in range(len(batches)) if not acknowledged[number]]
        if not left:
            break
        workers = [fork.Process(target=writer.send, args=(left[side::2], acknowledged)) for side in (0, 1)]
        for worker in workers:
            worker.start()
        for worker in workers if attempt < 15 else ():
            if rng.random() < 0.7:
                time.sleep(rng.random() * 0.02)
                worker.kill()
        for worker in workers:
            worker.join()
    assert all(acknowledged)
    with writer.opened():
        pass
    assert [file.name for file in writer.folder.iterdir()] == ["state.npz"]
    attempts = [line.split() for line in writer.log.read_text().splitlines()]
    states = [*(state for _, state in attempts[1:]), writer.state()]
    saved = [int(number) for (number, before), after in zip(attempts, states, strict=True) if before != after]
    assert set(saved) == set(range(len(batches)))  # nothing that was acknowledged is lost
    reference = Reference(policy)
    for number in saved:
        reference.update(batches[number])
    with writer.opened() as stream:
        assert (stream.n_late, stream.n_ahead, stream.n_repeated) == (
            reference.late,
            reference.ahead,
            reference.repeated,
        )
    same_trust(stream, reference)


@pytest.mark.skipif(os.name != "posix", reason="folders are not locked on this system")
@pytest.mark.parametrize("sequences", [3, pytest.param(300, marks=pytest.mark.slow)])
def test_two_writers_that_are_killed_lose_nothing(tmp_path: Path, sequences: int) -> None:
    for seed in range(sequences):
        check_two_writers(seed, tmp_path / str(seed))
