"""Results on disk: complete or absent, and no temporary files."""

import errno
import os
import platform
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from refusals import refuses
from typer.testing import CliRunner

from roletrust_env.storage import files
from roletrust_experiments.cli import app

WRITER = """
import sys, time
from pathlib import Path
from roletrust_env.storage.files import replacing
with replacing(Path(sys.argv[1])) as temporary:
    temporary.write_text("half")
    print("writing", flush=True)
    time.sleep(600)
"""


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
def test_interrupted_writing_leaves_the_old_file_and_nothing_else(tmp_path, error):
    path = tmp_path / "table.csv"
    files.write_csv(path, ["a"], [[1.0]])

    def rows():
        yield [2.0]
        raise error

    with pytest.raises(error):
        files.write_csv(path, ["a"], rows())
    assert path.read_text() == "a\n1.000000\n"
    assert [file.name for file in tmp_path.iterdir()] == ["table.csv"]


def test_a_file_keeps_its_permissions_and_a_link_stays_one(tmp_path):
    path, link = tmp_path / "private.csv", tmp_path / "link.csv"
    path.touch(0o600)
    link.symlink_to(path)
    files.write_csv(link, ["a"], [])
    assert link.readlink() == path
    assert path.read_text() == "a\n"
    assert path.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_what_is_no_file_stays(tmp_path, make):
    make(tmp_path / "there")
    before = (tmp_path / "there").stat()
    with refuses(OSError, "22", "there"):
        files.write_text(tmp_path / "there", "lost")
    assert (tmp_path / "there").stat().st_ino == before.st_ino
    assert [path.name for path in tmp_path.iterdir()] == ["there"]


def test_files_of_a_killed_run_are_removed_and_those_of_a_living_one_stay(tmp_path):
    for name in ("killed.csv", "living.csv"):
        writer = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(tmp_path / name)],
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        )
        assert writer.stdout is not None
        assert writer.stdout.readline() == b"writing\n"
        if name == "killed.csv":
            writer.kill()
            writer.wait()
            writer.stdout.close()
    others = [".bashrc", ".my.notes.1.txt", f".killed.elsewhere-{writer.pid}.csv"]
    for other in others:
        (tmp_path / other).touch()
    (tmp_path / files.unfinished_path(tmp_path / "mine.csv").name).touch()
    assert len(list(tmp_path.glob(".killed.*"))) == 2
    files.prepare_folder(tmp_path)
    here = f"{platform.node()}-{writer.pid}.csv"
    mine = f".mine.{platform.node()}-{os.getpid()}.csv"
    assert {path.name for path in tmp_path.iterdir()} == {*others, mine, f".living.{here}"}
    writer.send_signal(signal.SIGKILL)
    writer.communicate()


def test_checking_a_folder_leaves_it_unchanged(tmp_path):
    (tmp_path / "probe").write_text("not to be lost")
    files.prepare_folder(tmp_path)
    files.prepare_folder(tmp_path / "a" / "b")
    assert [path.name for path in tmp_path.iterdir()] == ["probe"]
    with refuses(OSError, "--out", "probe/out"):
        files.prepare_folder(tmp_path / "probe" / "out")


def test_a_file_that_cannot_be_written_is_named_and_not_its_unfinished_one(tmp_path):
    with (
        refuses(PermissionError, "/votes.csv"),
        files.replacing(tmp_path / "votes.csv") as unfinished,
    ):
        raise PermissionError(errno.EACCES, "Permission denied", str(unfinished))


def test_a_folder_that_another_run_writes_to_meanwhile_stays(tmp_path, monkeypatch):
    touch = Path.touch

    def meanwhile(path):
        touch(path)
        (tmp_path / "results" / "play").mkdir()

    monkeypatch.setattr(Path, "touch", meanwhile)
    files.prepare_folder(tmp_path / "results" / "train")
    assert [path.name for path in (tmp_path / "results").iterdir()] == ["play"]
    monkeypatch.undo()
    files.prepare_folder(tmp_path / "new" / ".." / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


@pytest.mark.parametrize("out", ["file", "file/below"])
@pytest.mark.parametrize(
    "command",
    [["train", "RaterAttack"], ["play"], ["figures", "paper-3x3"]],
    ids=lambda command: command[0],
)
def test_output_folders_are_tried_before_the_work(tmp_path, monkeypatch, command, out):
    def work(*_, **__):
        raise AssertionError("the work begins before the output folder is checked")

    for module, name in (
        ("roletrust_agents.training.loop", "train"),
        ("roletrust_experiments.commands.play", "play_games"),
        ("roletrust_experiments.paper.figures", "track_curves"),
    ):
        monkeypatch.setattr(f"{module}.{name}", work)
    (tmp_path / "file").write_text("in the way")
    result = CliRunner().invoke(app, [*command, "--out", str(tmp_path / out)])
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith(
        f"Error: --out {tmp_path / out} is no folder that can be written: "
    )
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
