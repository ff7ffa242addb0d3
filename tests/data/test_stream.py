"""Streams of ratings: what they compute, what they refuse, and that they can be saved and continued."""

import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from roletrust_env.data import TrustStream
from roletrust_env.trust import make_trust_model

MODELS = pytest.mark.parametrize("name", ["role-trust", "median", "beta-filtered", "wary-role-trust", "eigentrust"])


def some_ratings(n: int = 400, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.integers(0, 30, n), rng.integers(40, 60, n), rng.integers(1, 6, n), np.sort(rng.uniform(7, 107, n))


def trusts(stream: TrustStream) -> list[dict[Any, float]]:
    return [stream.rater_trust(), stream.provider_trust()]


@MODELS
def test_batches_of_any_size_are_the_same_rounds(name: str) -> None:
    columns = some_ratings()
    found = []
    for size in (400, 37, 1):
        stream = TrustStream(make_trust_model(name), scale=(1, 5), every=10)
        for at in range(0, 400, size):
            stream.update(*(column[at : at + size] for column in columns))
        assert stream.rounds == 9
        stream.finish()
        assert stream.rounds == 10
        found.append(trusts(stream))
    for other in found[1:]:
        for one, two in zip(found[0], other, strict=True):
            assert one == pytest.approx(two, abs=1e-12)


def test_names_and_numbers_are_alike_and_tables_are_welcome() -> None:
    raters, providers, ratings, times = some_ratings()
    numbers = TrustStream(make_trust_model("role-trust"), scale=(1, 5), every=10)
    numbers.update(raters, providers, ratings, times)
    table = pd.DataFrame({"who": [f"r{n}" for n in raters], "whom": [f"p{n}" for n in providers], "how": ratings})
    names = TrustStream(make_trust_model("role-trust"), scale=(1, 5), every=10)
    names.update(table["who"], table["whom"], table["how"], times)
    for one, other, letter in zip(trusts(numbers), trusts(names), "rp", strict=True):
        assert {f"{letter}{name}": trust for name, trust in one.items()} == pytest.approx(other, abs=1e-12)


def test_rounds_without_ratings_count() -> None:
    """An unsteady rating weighs more, the more rounds it is old."""
    found = []
    for again in (1.5, 5.5):
        stream = TrustStream(make_trust_model("role-trust"), every=1)
        for time, rating in ((0.5, 0.5), (again + 0.5, 1.0)):
            stream.update(["a"], ["b"], [rating], [time])
        stream.finish()
        found.append(stream.provider_trust()["b"])
    assert found[0] > found[1]


@MODELS
@pytest.mark.parametrize("texts", [False, True])
@pytest.mark.parametrize("same_agents", [False, True])
def test_a_saved_stream_goes_on_as_if_it_had_not_stopped(
    tmp_path: Path, name: str, texts: bool, same_agents: bool
) -> None:
    columns: list[Any] = list(some_ratings())
    if texts:
        columns[:2] = ([f"agent {n}" for n in column] for column in columns[:2])
    settings: dict[str, Any] = {"scale": (1, 5), "every": 10.0, "same_agents": same_agents}
    whole = TrustStream(make_trust_model(name), **settings)
    part = TrustStream(make_trust_model(name), **settings)
    whole.update(*columns)
    part.update(*(column[:150] for column in columns))
    part.save(tmp_path / "state.npz")
    again = TrustStream.load(tmp_path / "state.npz", make_trust_model(name), **settings)
    again.update(*(column[150:] for column in columns))
    for one, other in zip(trusts(whole), trusts(again), strict=True):
        assert one == pytest.approx(other, abs=1e-12)
    assert list(tmp_path.iterdir()) == [tmp_path / "state.npz"]


def test_what_is_no_saved_stream_is_refused(tmp_path: Path) -> None:
    path, model = tmp_path / "state.npz", make_trust_model("role-trust")
    stream = TrustStream(model)
    stream.update([1, 2], [1, 2], [0.5, 1.0])
    stream.save(path)
    with pytest.raises(ValueError, match=r"RoleTrust\(lam=0.5.* other settings"):
        TrustStream.load(path, make_trust_model("role-trust", lam=0.7))
    whole = path.read_bytes()
    for broken in (whole[:400], whole[:-300], b"", b"PK", b"nothing"):
        path.write_bytes(broken)
        with pytest.raises(ValueError, match="damaged"):
            TrustStream.load(path, model)
    arrays = {"header": np.array([object()], dtype=object)}
    np.savez(path, **arrays)  # a pickle
    with pytest.raises(ValueError, match="damaged"):
        TrustStream.load(path, model)


_SAVING = """
import sys, pathlib, numpy as np
from roletrust_env.data import TrustStream
from roletrust_env.trust import make_trust_model
stream, rng, path = TrustStream(make_trust_model("role-trust")), np.random.default_rng(0), pathlib.Path(sys.argv[1])
while True:
    stream.update(rng.integers(0, 5000, 5000), rng.integers(0, 5000, 5000), rng.random(5000))
    stream.save(path)
    print(stream.rounds, flush=True)
"""


def test_a_killed_process_leaves_a_whole_state(tmp_path: Path) -> None:
    path = tmp_path / "state.npz"
    process = subprocess.Popen([sys.executable, "-c", _SAVING, str(path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    written = 0
    for line in process.stdout:
        written = int(line)
        if written == 12:
            break
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    assert TrustStream.load(path, make_trust_model("role-trust")).rounds >= written


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "off the scale": ({"ratings": [1, 9]}, "rating 2 is 9; the scale is from 1 to 5"),
    "NaN": ({"ratings": [1, float("nan")]}, "ratings hold nan at position 2"),
    "no number": ({"ratings": ["good", "bad"]}, "ratings must be numbers"),
    "too few": ({"ratings": [1]}, r"ratings have shape \(1,\); there are 2 raters"),
    "providers": ({"providers": ["x"]}, "2 raters and 1 providers"),
    "no names": ({"raters": [None, "b"]}, "raters are of type object; they must be whole numbers or texts"),
    "numbers after texts": ({"raters": [1, 2]}, "raters are whole numbers; they were texts before"),
    "floats": ({"raters": [0.5, 1.0]}, "raters are of type float64"),
    "no times": ({"times": None}, "times are missing"),
    "late": ({"times": [25.0, 3.0]}, "rating 2 is of time 3, in a round that has ended"),
    "never": ({"times": [25.0, float("inf")]}, "times hold inf at position 2"),
    "another unit": ({"times": [25.0, 1e12]}, "at most 1,000,000 are allowed"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_batches_change_nothing(case: str) -> None:
    stream = TrustStream(make_trust_model("role-trust"), scale=(1, 5), every=10)
    good = {"raters": ["a", "b"], "providers": ["x", "y"], "ratings": [1, 5], "times": [0.0, 15.0]}
    stream.update(**good)
    before = trusts(stream)
    change, message = BAD[case]
    with pytest.raises(ValueError, match=message):
        stream.update(**{**good, "raters": ["new", "b"], "times": [25.0, 26.0], **change})
    assert trusts(stream) == before
    stream.update(["a"], ["x"], [2], [26.0])
    assert set(stream.rater_trust()) <= {"a", "b"}


def test_members_do_not_rate_themselves() -> None:
    stream = TrustStream(make_trust_model("eigentrust"), same_agents=True)
    with pytest.raises(ValueError, match="rating 2 is of 7 by itself"):
        stream.update([1, 7], [2, 7], [0.5, 0.5])
    stream.update([1, 7], [7, 2], [0.5, 1.0])
    assert stream.rater_trust() == stream.provider_trust()


def test_what_cannot_be_a_stream_is_refused() -> None:
    with pytest.raises(ValueError, match="does not run on edges"):
        TrustStream(make_trust_model("travos"))
    with pytest.raises(ValueError, match="scale is from 1 to 1"):
        TrustStream(make_trust_model("mean"), scale=(1, 1))
    with pytest.raises(ValueError, match="length of a round is 0"):
        TrustStream(make_trust_model("mean"), every=0)
    stream = TrustStream(make_trust_model("mean"))
    stream.update([], [], [])
    with pytest.raises(ValueError, match="times are given"):
        stream.update([1], [2], [1], [1])
