"""`roletrust entry`: a true entry passes, and a false one does not."""

import json
from pathlib import Path
from typing import Any

import pytest
from command_line import printed, run
from small_suites import tiny

from roletrust_env.benchmarking import entry_check
from roletrust_env.benchmarking.entries import pack_entry
from roletrust_env.benchmarking.run import InProcess, play_suite
from roletrust_env.benchmarking.suite import Suite


@pytest.fixture
def played(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Suite, Path]:
    """A small suite, and the file of its run."""
    suite = tiny(methods=["scripts", "search"])
    play_suite(suite, InProcess(), out=tmp_path)
    monkeypatch.setattr(entry_check, "load_suite", lambda name: suite)
    return suite, tmp_path / "results.sqlite"


def test_a_true_entry_passes(tmp_path: Path, played: tuple[Suite, Path], in_process: None) -> None:
    out = tmp_path / "block.json"
    printed("entry", "pack", played[1], "block", out)
    data: Any = json.loads(out.read_text())
    assert data["model"] == "block"
    assert len(data["cells"]) == 6  # two settings, one with two methods, under two rules
    assert run("entry", "check", str(out)).exit_code == 0
    data["cells"][0]["attacks"][0]["measured"]["skill"] = [0.99] * 3
    out.write_text(json.dumps(data))
    assert run("entry", "check", str(out), "--cells", "0").exit_code == 0
    assert run("entry", "check", str(out)).exit_code == 1
    data["suite_sha256"] = "0" * 64
    out.write_text(json.dumps(data))
    assert run("entry", "check", str(out), "--cells", "0").exit_code == 1


def test_what_cannot_be_read_is_refused(tmp_path: Path, played: tuple[Suite, Path]) -> None:
    out = tmp_path / "out.json"
    for arguments in (
        ["pack", str(played[1]), "median", str(out)],
        ["pack", str(tmp_path / "none.sqlite"), "mean", str(out)],
        ["pack", str(played[1]), "os:system", str(out)],
        ["check", str(played[1])],
    ):
        assert run("entry", *arguments).exit_code == 2
    assert not out.exists()


def test_the_function_checks_what_its_command_prints(
    tmp_path: Path, played: tuple[Suite, Path], in_process: None
) -> None:
    out = tmp_path / "block.json"
    pack_entry(played[1], "block").write(out)
    checked = entry_check.check_entry(out, played[0], cells=1, seed=4)
    assert (checked.ok, checked.played, checked.seed) == (True, 1, 4)
    shown = printed("entry", "check", out, "--cells", 1, "--seed", 4)
    for check in checked.checks:
        assert check.subject in shown
        assert check.message in checked._repr_markdown_()
