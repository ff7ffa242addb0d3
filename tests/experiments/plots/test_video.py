"""A game as a video."""

import json

from refusals import assert_names
from typer.testing import CliRunner

from roletrust_env.storage import files
from roletrust_experiments.cli import app


def play(out, *arguments):
    return CliRunner().invoke(
        app, ["play", "--set", "max_cycles=12", *arguments, "--video", "--out", str(out)]
    )


def test_ffmpeg_says_nothing_where_all_is_well(tmp_path, capfd):
    assert play(tmp_path).exit_code == 0
    assert "play.mp4" in json.dumps([path.name for path in tmp_path.iterdir()])
    assert capfd.readouterr().err == ""


def test_a_film_that_cannot_be_written_is_one_error_that_names_it(tmp_path, monkeypatch, capfd):
    def to_a_full_disk(path):
        temporary = path.with_name(f".unfinished{path.suffix}")
        if path.suffix == ".mp4":
            temporary.symlink_to("/dev/full")
        return temporary

    monkeypatch.setattr(files, "unfinished_path", to_a_full_disk)
    result = play(tmp_path)
    assert result.exit_code == 2
    assert_names(result.stderr, tmp_path / "play.mp4")
    assert len(result.stderr.splitlines()) == 1
    assert capfd.readouterr().err == ""
    assert not list(tmp_path.glob("*.mp4"))
