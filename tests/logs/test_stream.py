"""Streams of ratings: what they compute, what they refuse, and that they can be saved and
continued."""

import json
import platform
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from refusals import refuses

from roletrust_env.logs import TrustStream
from roletrust_env.storage.arrays import load_arrays, save_arrays
from roletrust_env.trust import make_trust_model

MODELS = pytest.mark.parametrize(
    "name", ["role-trust", "median", "beta-filtered", "wary-role-trust", "eigentrust"]
)


def some_ratings(
    n: int = 400, seed: int = 0
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return (
        rng.integers(0, 30, n),
        rng.integers(40, 60, n),
        rng.integers(1, 6, n),
        np.sort(rng.uniform(7, 107, n)),
    )


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
    table = pd.DataFrame(
        {"who": [f"r{n}" for n in raters], "whom": [f"p{n}" for n in providers], "how": ratings}
    )
    names = TrustStream(make_trust_model("role-trust"), scale=(1, 5), every=10)
    names.update(table["who"], table["whom"], table["how"], times)
    for one, other, letter in zip(trusts(numbers), trusts(names), "rp", strict=True):
        assert {f"{letter}{name}": trust for name, trust in one.items()} == pytest.approx(
            other, abs=1e-12
        )


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
    with refuses(ValueError, "0.5", "0.7"):
        TrustStream.load(path, make_trust_model("role-trust", lam=0.7))
    whole = path.read_bytes()
    with np.load(path) as stored:
        arrays = dict(stored)
    header = bytes(arrays["header"]).replace(b'"format": 7', b'"format": 9')
    changes: dict[str, Any] = {
        "state_0": arrays["state_0"] + 7,
        "state_1": arrays["state_1"] * np.nan,
        "names_0": np.array([1, 1]),
        "names_1": np.arange(3),
    }
    for name, array in changes.items():
        np.savez(path, **{**arrays, name: array})  # type: ignore[arg-type]
        with refuses(ValueError, "state.npz"):
            TrustStream.load(path, model)
        del arrays["sha256"]
        save_arrays(path, {**arrays, name: array})
        arrays["sha256"] = np.zeros(32, np.uint8)
        if name.startswith("names"):  # only what was made on purpose has the right checksum
            with refuses(ValueError, "state.npz"):
                TrustStream.load(path, model)
    del arrays["sha256"]
    save_arrays(path, {**arrays, "header": np.frombuffer(header, np.uint8)})
    with refuses(ValueError, "9", "7"):
        TrustStream.load(path, model)
    del arrays["header"]
    save_arrays(path, arrays)
    with refuses(ValueError, "header"):
        TrustStream.load(path, model)
    for broken in (whole[:400], whole[:-300], b"", b"PK", b"nothing"):
        path.write_bytes(broken)
        with refuses(ValueError, "state.npz"):
            TrustStream.load(path, model)
    with refuses(OSError, str(tmp_path / "none")):
        TrustStream.load(tmp_path / "none", model)


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize(
    "name",
    [
        "wary-role-trust",
        *(pytest.param(n, marks=pytest.mark.slow) for n in ("fire", "power-trust", "travos")),
    ],
)
def test_what_no_stream_can_have_is_refused_when_it_is_loaded(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """States that were changed, and whose checksum was made again, are refused or are those of
    other ratings."""
    monkeypatch.setattr("os.fsync", lambda file: None)
    path, model, rng = tmp_path / "state.npz", make_trust_model(name), np.random.default_rng(0)
    agents = [f"a{n}" for n in range(5)]
    settings: dict[str, Any] = {"every": 1.0, "agents": (agents, agents), "keep_evidence": True}

    def batch(day: int) -> tuple[Any, ...]:
        who, whom = ([agents[n] for n in rng.integers(0, 5, 20)] for _ in "ab")
        return who, whom, rng.random(20), day + rng.random(20)

    stream = TrustStream(model, **settings)
    for day in range(3):
        stream.update(*batch(day))
    stream.save(path)
    arrays = load_arrays(path)
    header = json.loads(arrays["header"].tobytes())
    cases: dict[Any, dict[str, Any]] = {"more": {**arrays, "more": np.zeros(1)}}
    for key, array in arrays.items():
        for what, changed in enumerate((array[:-1], array[None], array.astype("S1"))):
            cases[key, what] = {**arrays, key: changed}
        for value in (np.nan, -0.5, 7, -7, 1e300, -1e300):
            if array.dtype.kind == "f" or (
                float(value).is_integer() and abs(value) < 2**62 and key != "header"
            ):
                cases[key, value] = {**arrays, key: np.full_like(array, value)}
    for name_of, value in [
        *(
            (key, value)
            for key in header
            for value in (None, -1, np.nan, 1e308, [1], "x", True, "\ud800")
        ),
        *(
            (n, value)
            for n in range(4)
            for value in ([1], 5, ["\ud800"] * 5, [*agents[:4], "\ud800"])
        ),
        ("more", 1),
    ]:
        texts = [value if n == name_of else there for n, there in enumerate(header["texts"])]
        changed = {**header, "texts": texts} | (
            {name_of: value} if isinstance(name_of, str) else {}
        )
        cases[name_of, str(value)] = {
            **arrays,
            "header": np.frombuffer(json.dumps(changed).encode(), np.uint8),
        }
    taken, messages = set(), set[str]()
    for what, case in cases.items():
        save_arrays(path, case)
        try:
            stream = TrustStream.load(path, model, **settings)
        except ValueError as error:
            messages.add(str(error))
            continue
        taken.add(what)
        for day in (3, 4):
            stream.update(*batch(day))
            assert all(0 <= value <= 1 for trust in trusts(stream) for value in trust.values())
        assert len(stream.evidence("rater").names) == 5
    refusal = re.compile(
        r".+(is no saved stream, or is damaged: |was saved with other settings: ).+"
    )
    assert all(refusal.fullmatch(message) and message.isprintable() for message in messages)
    possible = {
        ("fire", "state_2", 7),
        ("fire", "state_1", -0.5),
        ("fire", "state_3", -0.5),
        ("fire", "state_5", -0.5),
    }  # no shares
    odd = {(key, value) for key, value in taken if str(key).startswith("state_")}
    assert name not in ("fire", "wary-role-trust") or {(name, *case) for case in odd} <= possible
    assert len(taken) < 0.2 * len(cases)


_SAVING = """
import sys, pathlib, numpy as np
from roletrust_env.logs import TrustStream
from roletrust_env.trust import make_trust_model
stream, rng, path = TrustStream(make_trust_model("role-trust")), np.random.default_rng(0), pathlib.Path(sys.argv[1])
while True:
    stream.update(rng.integers(0, 5000, 5000), rng.integers(0, 5000, 5000), rng.random(5000))
    stream.save(path)
    print(stream.rounds, flush=True)
"""  # noqa: E501


def test_a_killed_process_leaves_a_whole_state(tmp_path: Path) -> None:
    path = tmp_path / "state.npz"
    process = subprocess.Popen(
        [sys.executable, "-c", _SAVING, str(path)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    written = 0
    for line in process.stdout:
        written = int(line)
        if written == 12:
            break
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    stream = TrustStream.load(path, make_trust_model("role-trust"))
    assert stream.rounds >= written
    (
        tmp_path / f".state.{platform.node()}-{process.pid}.npz"
    ).touch()  # as a kill in the middle of a save leaves it
    stream.save(path)
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("same_agents", [False, True])
def test_a_stream_without_agents_goes_on_with_any_names(tmp_path: Path, same_agents: bool) -> None:
    stream = TrustStream(make_trust_model("mean"), same_agents=same_agents)
    stream.save(tmp_path / "state.npz")
    for raters, providers in (([1], [2]), (["a"], ["b"])):
        again = TrustStream.load(
            tmp_path / "state.npz", make_trust_model("mean"), same_agents=same_agents
        )
        again.update(raters, providers, [1.0])
        assert again.provider_trust()[providers[0]] > 0.5


BAD: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "off the scale": ({"ratings": [1, 9]}, ("2", "9")),
    "NaN": ({"ratings": [1, float("nan")]}, ("ratings", "nan", "2")),
    "no number": ({"ratings": ["good", "bad"]}, ("ratings",)),
    "too few": ({"ratings": [1]}, ("ratings", "(1,)", "2")),
    "providers": ({"providers": ["x"]}, ("2", "1")),
    "no names": (
        {"raters": [None, "b"]},
        ("raters", "object"),
    ),
    "numbers after texts": ({"raters": [1, 2]}, ("raters", "whole numbers", "texts")),
    "floats": ({"raters": [0.5, 1.0]}, ("raters", "float64")),
    "no times": ({"times": None}, ("times",)),
    "never": ({"times": [25.0, float("inf")]}, ("times", "inf", "2")),
    "another unit": ({"times": [25.0, 1e9]}, ("100,000,000", "1,000,000")),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_batches_change_nothing(case: str) -> None:
    stream = TrustStream(make_trust_model("role-trust"), scale=(1, 5), every=10)
    good = {"raters": ["a", "b"], "providers": ["x", "y"], "ratings": [1, 5], "times": [0.0, 15.0]}
    stream.update(**good)
    before = trusts(stream)
    change, words = BAD[case]
    with refuses(ValueError, *words):
        stream.update(**{**good, "raters": ["new", "b"], "times": [25.0, 26.0], **change})
    assert trusts(stream) == before
    stream.update(["a"], ["x"], [2], [26.0])
    assert set(stream.rater_trust()) <= {"a", "b"}


@pytest.mark.filterwarnings("error")
def test_times_further_apart_than_numbers_reach_are_refused_without_a_warning() -> None:
    stream = TrustStream(make_trust_model("mean"), every=1)
    with refuses(ValueError, "times", "-1e+308"):
        stream.update(["a", "b"], ["x", "y"], [0, 1], [-1e308, 1e308])


def test_members_do_not_rate_themselves() -> None:
    stream = TrustStream(make_trust_model("eigentrust"), same_agents=True)
    with refuses(ValueError, "2", "7"):
        stream.update([1, 7], [2, 7], [0.5, 0.5])
    stream.update([1, 7], [7, 2], [0.5, 1.0])
    assert stream.rater_trust() == stream.provider_trust()


def test_what_cannot_be_a_stream_is_refused() -> None:
    with refuses(ValueError, "0.2", "0.95"):
        TrustStream(make_trust_model("travos"))
    with refuses(ValueError, "scale", "1"):
        TrustStream(make_trust_model("mean"), scale=(1, 1))
    with refuses(ValueError, "every", "0"):
        TrustStream(make_trust_model("mean"), every=0)
    with refuses(ValueError, "times"):
        TrustStream(make_trust_model("mean"), every=1).update([1], [2], [1])


def test_times_without_rounds_by_time_tell_when_agents_were_rated_last(tmp_path: Path) -> None:
    stream = TrustStream(make_trust_model("mean"), keep_evidence=True)
    for raters, ratees, times in (([1], [2], [30.0]), ([1, 3], [2, 4], [10.0, 70.0]), ([], [], [])):
        stream.update(raters, ratees, [1.0] * len(raters), times)
    stream.save(tmp_path / "state")
    loaded = TrustStream.load(tmp_path / "state", make_trust_model("mean"), keep_evidence=True)
    for one in (stream, loaded):
        assert one.evidence("ratee").last.astype(int).tolist() == [30 * 10**9, 70 * 10**9]
        assert one.window is not None
        assert one.window.tolist() == [10 * 10**9, 70 * 10**9]


def test_a_loaded_stream_goes_on_with_the_round_that_has_begun(tmp_path: Path) -> None:
    """Also where its names have no place yet."""
    model = make_trust_model("mean")
    for second in (12.0, 2.0):
        streams = []
        for loads in (False, True):
            stream = TrustStream(model, every=10.0)
            stream.update([1, 2], [3, 3], [0.5, 1.0], [1.0, second])
            if loads:
                stream.save(tmp_path / "state")
                stream = TrustStream.load(tmp_path / "state", model, every=10.0)
            with refuses(ValueError, "raters"):
                stream.update(["x"], ["y"], [0.5], [second + 1])
            stream.finish()
            stream.update([4], [3], [0.25], [second + 2])  # its round has ended
            stream.finish()
            streams.append(stream)
        kept = [
            (one.rounds, one.n_late, one.rater_trust(), one.provider_trust()) for one in streams
        ]
        assert kept[0] == kept[1]
        assert kept[0][:2] == (1 + (second > 10), 1)
