"""`roletrust submit` and `roletrust verify`: a true entry passes, and a false one does not."""

import json
from pathlib import Path
from typing import Any

import pytest
from command_line import printed, run
from small_suites import tiny

from roletrust_env.benchmarking.run import InProcess, play_suite
from roletrust_env.benchmarking.suite import Suite
from roletrust_experiments.commands import submit


@pytest.fixture
def played(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Suite, Path]:
    """A small suite, and the file of its run."""
    suite = tiny(methods=["scripts", "search"])
    play_suite(suite, InProcess(), out=tmp_path)
    monkeypatch.setattr(submit, "load_suite", lambda name: suite)
    return suite, tmp_path / "results.sqlite"


def test_a_true_entry_passes(tmp_path: Path, played: tuple[Suite, Path], in_process: None) -> None:
    out = tmp_path / "block.json"
    printed("submit", played[1], "block", "--out", out)
    data: Any = json.loads(out.read_text())
    assert data["model"] == "block"
    assert len(data["cells"]) == 6  # two settings, one with two methods, under two rules
    assert run("verify", str(out)).exit_code == 0
    data["cells"][0]["attacks"][0]["measured"]["skill"] = [0.99] * 3
    out.write_text(json.dumps(data))
    assert run("verify", str(out), "--cells", "0").exit_code == 0
    assert run("verify", str(out)).exit_code == 1
    data["suite_sha256"] = "0" * 64
    out.write_text(json.dumps(data))
    assert run("verify", str(out), "--cells", "0").exit_code == 1


def test_what_cannot_be_read_is_refused(tmp_path: Path, played: tuple[Suite, Path]) -> None:
    out = tmp_path / "out.json"
    for arguments in (
        ["submit", str(played[1]), "median", "--out", str(out)],
        ["submit", str(tmp_path / "none.sqlite"), "mean", "--out", str(out)],
        ["submit", str(played[1]), "os:system", "--out", str(out)],
        ["verify", str(played[1])],
    ):
        assert run(*arguments).exit_code == 2
    assert not out.exists()
