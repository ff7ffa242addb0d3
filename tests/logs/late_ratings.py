"""Random sequences of ratings that are late, repeated and out of order, and what a stream must make
of them."""

import math
import random
from collections import Counter
from typing import Any, get_args

import numpy as np

from roletrust_env.logs import TrustStream
from roletrust_env.logs.evidence import Role
from roletrust_env.trust.run import make_run

EVERY = 10.0
Rating = tuple[int, int, float, float]


class Reference:
    """The policies, rating by rating: which ratings count, and in which round."""

    def __init__(self, *, repeats: bool) -> None:
        self.repeats, self.rounds = repeats, 0
        self.start = self.latest = math.nan
        self.running: list[Rating] = []
        self.ended: list[list[Rating]] = []
        self.late = self.repeated = 0

    def update(self, batch: list[Rating]) -> None:
        """Take a batch."""
        taken = batch
        if not self.rounds:
            earliest = min(rating[3] for rating in batch)
            self.start = earliest if math.isnan(self.start) else min(self.start, earliest)
        first = max(self.start + self.rounds * EVERY, self.start)
        self.late += sum(rating[3] < first for rating in taken)
        taken = [rating for rating in taken if rating[3] >= first]
        self.running += taken
        self.latest = max(
            [self.latest] * (not math.isnan(self.latest)) + [rating[3] for rating in taken]
            or [math.nan]
        )
        while any(rating[3] >= self.start + (self.rounds + 1) * EVERY for rating in self.running):
            end = self.start + (self.rounds + 1) * EVERY
            self._end([rating for rating in self.running if rating[3] < end])
            self.running = [rating for rating in self.running if rating[3] >= end]
        self.running = self._distinct(self.running)

    def _end(self, ratings: list[Rating]) -> None:
        self.ended.append(self._distinct(ratings))
        self.rounds += 1

    def _distinct(self, ratings: list[Rating]) -> list[Rating]:
        distinct = ratings if self.repeats else list(dict.fromkeys(ratings))
        self.repeated += len(ratings) - len(distinct)
        return distinct

    def finish(self) -> list[list[Rating]]:
        """End the round that has begun, and return the ratings of all rounds."""
        if self.running:
            self._end(self.running)
            self.running = []
        return self.ended

    def trust(self, model: Any) -> list[dict[int, float]]:
        """Return the trust of raters and of providers by name, as one run of all rounds computes
        it."""
        rounds = self.finish()
        names = [
            list(dict.fromkeys(rating[side] for some in rounds for rating in some))
            for side in (0, 1)
        ]
        run = make_run(model)
        for some in rounds:
            who, whom = (
                np.array([names[side].index(rating[side]) for rating in some], np.int64)
                for side in (0, 1)
            )
            run.play(who, whom, np.array([rating[2] for rating in some], float))
        return [
            dict(zip(who, trust.tolist(), strict=True))
            for who, trust in zip(names, (run.rater_trust, run.provider_trust), strict=True)
        ]


def some_batches(rng: random.Random, most: int = 8) -> list[list[Rating]]:
    """Return so many batches at most near a clock that goes on: some late, some long after; and
    copies of them."""
    clock, sent, batches = 0.0, list[Rating](), list[list[Rating]]()
    for _ in range(rng.randint(1, most)):
        clock += rng.choice([0, 3, 12, 30])
        batch = list[Rating]()
        for _ in range(rng.randint(1, 6)):
            off = rng.choice([0, 0, 0, rng.randint(-30, 9), rng.choice([-500, 500])])
            batch.append(
                (
                    rng.randint(0, 3),
                    rng.randint(0, 3),
                    rng.randint(0, 4) / 4,
                    clock + off + rng.randint(0, 5),
                )
            )
        sent += batch
        batches.append([*batch, *rng.choices(sent, k=rng.choice([0, 0, 2]))])
        if rng.random() < 0.2:
            batches.append(list(batch))
    return batches


def check_end(stream: TrustStream, reference: Reference) -> None:
    """Trust, evidence and counts are those of one log of what was taken."""
    stream.finish()
    found = stream.rater_trust(), stream.provider_trust()
    for one, other in zip(found, reference.trust(stream.model), strict=True):
        assert one.keys() == other.keys()
        assert max((abs(one[name] - other[name]) for name in one), default=0.0) < 1e-12
    ratings = [rating for some in reference.finish() for rating in some]
    for side, role in enumerate(get_args(Role)[::-1]):
        names, _, *columns = stream.evidence(role)
        wanted = {
            name: _counted([one for one in ratings if one[side] == name], 1 - side)
            for name in found[side]
        }
        assert (
            dict(
                zip(names, zip(*(column.tolist() for column in columns), strict=True), strict=True)
            )
            == wanted
        )
    assert (stream.n_late, stream.n_repeated) == (reference.late, reference.repeated)


def _counted(ratings: list[Rating], others: int) -> tuple[int, int, float, int]:
    """Return the numbers of ratings, agents and independent agents, and the last time."""
    counts = Counter(rating[others] for rating in ratings)
    independent = len(ratings) ** 2 / sum(count**2 for count in counts.values())
    last = round(max(rating[3] for rating in ratings) * 1e9)
    return len(ratings), len(counts), independent, last


def update(stream: TrustStream, batch: list[Rating]) -> None:
    stream.update(*([rating[n] for rating in batch] for n in range(4)))
