"""The folder of a training run."""

import io
import json
import platform
import subprocess
import sys

import pytest
import torch
from refusals import refuses

from roletrust_agents.training.runs import Checkpoint, RunFolder
from roletrust_env.storage.files import unfinished_path


def test_unfinished_checkpoints_of_the_dead_go_and_those_of_the_living_stay(tmp_path):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    checkpoints = tmp_path / "checkpoints"
    left = checkpoints / f".000000000007.{platform.node()}-{dead.pid}"
    living = checkpoints / f".000000000007.{platform.node()}-1"
    for folder in (left, living):
        folder.mkdir(parents=True)
        (folder / "a").write_text("half")
    run = RunFolder(tmp_path)
    run.prepare()
    assert list(checkpoints.iterdir()) == [living]
    run.save(Checkpoint(7, {"a": b"whole"}, {}))
    assert (living / "a").read_text() == "half"
    assert run.last() == Checkpoint(7, {"a": b"whole"}, {})


def test_a_checkpoint_can_be_saved_where_the_last_attempt_failed(tmp_path):
    run = RunFolder(tmp_path)
    with pytest.raises(TypeError):
        run.save(Checkpoint(7, {"a": b"", "b": None}, {}))
    assert run.last() is None
    unfinished_path(tmp_path / "checkpoints" / "000000000007").mkdir(exist_ok=True)
    run.save(Checkpoint(7, {"a": b"whole"}, {}))
    assert [path.name for path in (tmp_path / "checkpoints").iterdir()] == ["000000000007"]


@pytest.mark.parametrize(
    "change",
    [
        {"steps": 8},
        {"steps": -7},
        {"steps": "7"},
        {"sha256": {"../a": "0"}},
        {"sha256": []},
        {"notes": None},
        {"x": 1},
    ],
)
def test_a_checkpoint_with_other_data_than_it_can_have_is_passed_over(tmp_path, change):
    run = RunFolder(tmp_path)
    run.save(Checkpoint(7, {"a": b"whole"}, {}))
    file = tmp_path / "checkpoints" / "000000000007" / "about.json"
    about = json.loads(file.read_text())
    assert run.last() is not None
    file.write_text(json.dumps({**about, **change}))
    assert run.last() is None


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
