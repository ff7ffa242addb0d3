"""Files of arrays: they come back as they were, and whatever else is in the file is one error."""

import io
import os
import pickle
import zipfile
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from refusals import refuses

from roletrust_env.storage.arrays import load_arrays, save_arrays

ARRAYS = {
    "numbers": np.arange(7.0),
    "places": np.zeros((0,), np.int64),
    "text": np.frombuffer(b"{}", np.uint8),
}


def test_arrays_come_back(tmp_path: Path) -> None:
    save_arrays(tmp_path / "a.npz", ARRAYS)
    found = load_arrays(tmp_path / "a.npz")
    assert found.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        assert found[name].dtype == array.dtype
        assert np.array_equal(found[name], array)
    assert list(tmp_path.iterdir()) == [tmp_path / "a.npz"]


def test_a_file_is_on_the_disk_before_it_replaces_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, sizes = tmp_path / "a.npz", list[int]()
    monkeypatch.setattr(
        os, "fsync", lambda file: sizes.append(os.fstat(file).st_size * (not path.exists()))
    )
    save_arrays(path, ARRAYS)
    assert sizes == [path.stat().st_size]


def written(change: Any, save: Any = np.savez) -> bytes:
    """Return a file of arrays that a function of its arrays has changed."""
    path = io.BytesIO()
    save(path, **change)
    return path.getvalue()


def packed(whole: bytes, flag: int = 0, method: int = 0) -> bytes:
    """Return a zip file whose members say that they are encrypted, or compressed in another way."""
    broken = bytearray(whole)
    for mark, at in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        place = whole.find(mark)
        while place >= 0:
            broken[place + at] |= flag
            broken[place + at + 2] = method or broken[place + at + 2]
            place = whole.find(mark, place + 1)
    return bytes(broken)


class Evil:
    def __reduce__(self) -> Any:
        return exec, ("raise SystemExit('code was run')",)


def bad_files(whole: bytes) -> dict[str, tuple[bytes, str]]:
    with np.load(io.BytesIO(whole)) as stored:
        arrays = dict(stored)
    array = io.BytesIO()
    np.save(array, np.arange(3))
    foreign = io.BytesIO()
    with zipfile.ZipFile(foreign, "w") as file:
        file.writestr("readme.txt", "hello")
    objects = {**arrays, "numbers": np.array([Evil()], object)}
    return {
        "nothing": (b"", ()),
        "two bytes": (b"PK", ()),
        "a text": (b"nothing", ()),
        "an array": (array.getvalue(), ()),
        "a pickle": (pickle.dumps(Evil()), ("zip",)),
        "a pickle in it": (written(objects), ("allow_pickle",)),
        "another zip file": (foreign.getvalue(), ("sha256",)),
        "an encrypted one": (packed(whole, flag=1), ("encrypted",)),
        "an unknown compression": (packed(whole, method=99), ("compressed",)),
        "a bomb": (
            written(arrays, np.savez_compressed),
            ("compressed",),
        ),
        "no checksum": (written({"numbers": arrays["numbers"]}), ("sha256",)),
        "another number": (
            written({**arrays, "numbers": np.arange(7.0)[::-1]}),
            ("checksum",),
        ),
        "another type": (written({**arrays, "numbers": np.arange(7)}), ("checksum",)),
        "one array more": (written({**arrays, "more": np.zeros(1)}), ("checksum",)),
        "a wrong checksum": (written({**arrays, "sha256": np.zeros(3)}), ("checksum",)),
    }


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("arrays") / "a.npz"
    save_arrays(path, ARRAYS)
    return path.read_bytes()


def refused(path: Path, content: bytes, *words: str) -> None:
    path.write_bytes(content)
    with refuses(ValueError, *words):
        load_arrays(path)


def test_what_is_no_such_file_is_one_error(tmp_path: Path, whole: bytes) -> None:
    for content, words in bad_files(whole).values():
        refused(tmp_path / "a.npz", content, *words)
    with refuses(OSError, "none.npz"):
        load_arrays(tmp_path / "none.npz")


def test_a_truncated_file_is_refused_wherever_it_ends(tmp_path: Path, whole: bytes) -> None:
    for end in range(0, len(whole), 11):
        refused(tmp_path / "a.npz", whole[:end])


@given(data=st.data())
def test_a_damaged_file_is_refused_or_as_it_was(
    tmp_path_factory: pytest.TempPathFactory, whole: bytes, data: st.DataObject
) -> None:
    """A byte that nobody reads, such as one of a date, may be another."""
    path, broken = tmp_path_factory.getbasetemp() / "damaged.npz", bytearray(whole)
    broken[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(broken)
    try:
        found = load_arrays(path)
    except ValueError:
        return
    assert found.keys() == ARRAYS.keys()
    assert all(np.array_equal(found[name], array) for name, array in ARRAYS.items())
