"""The folder of a training run."""

import io
import platform
import subprocess
import sys

import pytest
import torch
from refusals import refuses

from roletrust_agents.training.runs import Checkpoint, RunFolder


def test_unfinished_checkpoints_of_the_dead_go_and_those_of_the_living_stay(tmp_path):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    checkpoints = tmp_path / "checkpoints"
    checkpoints.mkdir()
    left = checkpoints / f".000000000007.{platform.node()}-{dead.pid}.npz"
    living = checkpoints / f".000000000007.{platform.node()}-1.npz"
    for file in (left, living):
        file.write_text("half")
    run = RunFolder(tmp_path)
    run.prepare()
    assert list(checkpoints.iterdir()) == [living]
    run.save(Checkpoint(7, {"a": b"whole"}, {}))
    assert living.read_text() == "half"
    assert run.last() == Checkpoint(7, {"a": b"whole"}, {})


def test_a_checkpoint_is_whole_or_missing(tmp_path):
    run = RunFolder(tmp_path)
    with pytest.raises(TypeError):
        run.save(Checkpoint(7, {"a": b""}, {"b": b""}))
    assert run.last() is None
    run.save(Checkpoint(7, {"a": b"whole"}, {}))
    assert [path.name for path in (tmp_path / "checkpoints").iterdir()] == ["000000000007.npz"]


def test_a_checkpoint_of_another_run_is_one_error(tmp_path):
    run = RunFolder(tmp_path)
    run.save(Checkpoint(7, {"state": b"no state"}, {"curve": []}))
    with (
        refuses(ValueError, "UnpicklingError", "--out"),
        run.restoring() as last,
    ):
        torch.load(io.BytesIO(last.files["state"]), weights_only=True)
    with (
        refuses(ValueError, "IndexError"),
        run.restoring() as last,
    ):
        last.notes["curve"][-1]
