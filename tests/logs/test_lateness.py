"""Late, repeated and unordered ratings of a stream, also with two writers that are
killed."""

import os
import random
from pathlib import Path
from typing import Any

import pytest
from late_ratings import EVERY, Reference, check_end, some_batches, update
from refusals import refuses
from two_writers import check_two_writers

from roletrust_env.logs import TrustStream
from roletrust_env.trust import make_trust_model


def check_sequence(seed: int, model: Any) -> None:
    """One sequence in one process, saved and loaded on its way."""
    rng = random.Random(seed)
    repeats, batches = rng.random() < 0.5, some_batches(rng)
    reference = Reference(repeats=repeats)
    stream = TrustStream(model, every=EVERY, keep_evidence=True, repeats=repeats)
    for batch in batches:
        reference.update(batch)
        update(stream, batch)
        assert (stream.n_late, stream.rounds) == (reference.late, reference.rounds)
    check_end(stream, reference)


def test_late_and_repeated_ratings_follow_the_policy() -> None:
    model = make_trust_model("role-trust")
    for seed in range(150):
        check_sequence(seed, model)


@pytest.mark.slow
def test_many_sequences_follow_the_policy() -> None:
    model = make_trust_model("mean")
    for seed in range(3_000):
        check_sequence(seed, model)


def test_a_stream_of_short_rounds_does_not_end() -> None:
    """The limit of rounds is from the running one on."""
    stream = TrustStream(make_trust_model("mean"), every=1.0)
    for when in (0.0, 900_000.0, 1_800_000.0):
        stream.update(["a"], ["x"], [1.0], [when])
    assert stream.rounds == 1_800_000
    with refuses(ValueError, "3,000,000", "1,000,000"):
        stream.update(["a"], ["x"], [1.0], [3_000_000.0])


@pytest.mark.skipif(os.name != "posix", reason="folders are not locked on this system")
@pytest.mark.parametrize("sequences", [2, pytest.param(1_000, marks=pytest.mark.slow)])
def test_two_writers_that_are_killed_lose_nothing(tmp_path: Path, sequences: int) -> None:
    check_two_writers(range(sequences), tmp_path)
