"""Files of streams: on a full disk, in a folder that is read-only, behind a link, and side by
side."""

import errno
import os
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refuses

from roletrust_env.logs import TrustStream
from roletrust_env.trust import make_trust_model

pytestmark = pytest.mark.skipif(os.name != "posix", reason="folders are not locked on this system")


def opened(path: Path) -> Any:
    return TrustStream.opened(path, make_trust_model("mean"))


def rated(path: Path) -> TrustStream:
    """Take a rating more."""
    with opened(path) as stream:
        stream.update(["a"], ["x"], [1.0])
    return TrustStream.load(path, make_trust_model("mean"))


def test_a_full_disk_leaves_the_state_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "state.npz"
    rated(path)
    before = path.read_bytes()

    def savez(file: Any, **_: Any) -> None:
        file.write(before[:100])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(np, "savez", savez)
    with refuses(OSError, "state.npz"):
        rated(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_cannot_be_written_is_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: path != tmp_path)
    with (
        refuses(PermissionError, "state.npz"),
        opened(tmp_path / "state.npz"),
    ):
        raise AssertionError("the work has begun")


def test_a_file_system_without_locks_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def flock(*_: Any) -> None:
        raise OSError(errno.ENOTSUP, "Operation not supported")

    monkeypatch.setattr("fcntl.flock", flock)
    with refuses(OSError, tmp_path):
        rated(tmp_path / "state.npz")
    monkeypatch.undo()
    assert rated(tmp_path / "state.npz").rounds == 1


def test_a_link_stays_one_and_its_file_has_the_state(tmp_path: Path) -> None:
    link, path = tmp_path / "link.npz", tmp_path / "far" / "state.npz"
    path.parent.mkdir()
    link.symlink_to(path)
    assert rated(link).rounds == 1
    assert rated(path).rounds == 2
    assert rated(link).rounds == 3
    assert link.readlink() == path
    assert list(path.parent.iterdir()) == [path]
    with opened(link), refuses(OSError, "far"), opened(path):
        pass


def test_states_side_by_side_wait_for_each_other(tmp_path: Path) -> None:
    paths = [tmp_path / f"{name}.npz" for name in "ab"]
    threads = [threading.Thread(target=rated, args=(path,)) for path in paths * 3]
    with opened(paths[0]) as stream:
        for thread in threads:
            thread.start()
        stream.update(["b"], ["y"], [1.0])
        assert not paths[0].exists()
    for thread in threads:
        thread.join()
    assert [TrustStream.load(path, make_trust_model("mean")).rounds for path in paths] == [4, 3]
    assert sorted(tmp_path.iterdir()) == paths


def test_what_a_kill_has_left_elsewhere_is_removed(tmp_path: Path) -> None:
    """A container has another name each night; files of other states and other files stay."""
    others = [
        tmp_path / name
        for name in (".other.node-7.npz", ".state.npz", ".state.node-7.csv", "state.node-7.npz")
    ]
    for path in (*others, tmp_path / ".state.a1b2-7.npz"):
        path.touch()
    rated(tmp_path / "state.npz")
    assert sorted(tmp_path.iterdir()) == sorted([*others, tmp_path / "state.npz"])


def test_another_file_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "ratings.csv"
    path.write_text("rater,ratee,rating\n")
    with refuses(ValueError, "ratings.csv"):
        rated(path)
    assert path.read_text() == "rater,ratee,rating\n"
    with refuses(OSError, tmp_path):
        rated(tmp_path)
