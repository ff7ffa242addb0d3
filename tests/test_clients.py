"""`make test-clients`: how it reports, and those clients that are installed here anyway."""

import json
import subprocess
import sys
from types import ModuleType

import pytest
from clients.__main__ import inside, main, read, try_client


def passes() -> None:
    """It passes."""


def fails() -> None:
    """It fails."""
    raise OSError("the client is ill")


@pytest.fixture
def client(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """One whose second check fails."""
    module = ModuleType(__name__)
    vars(module).update(passes=passes, fails=fails, again=passes)
    monkeypatch.setitem(sys.modules, "clients.ill", module)
    return module


def test_a_report_tells_versions_and_every_check(client, tmp_path, capsys):
    inside("ill", tmp_path / "report", ["pettingzoo"])
    versions, checks = read(tmp_path / "report")
    assert set(versions) == {"pettingzoo"}
    assert [(check.what, check.passed) for check in checks] == [
        ("It passes.", True),
        ("It fails.", False),
        ("It passes.", True),
    ]
    assert "the client is ill" in capsys.readouterr().err


@pytest.mark.parametrize("step", ["venv", "checks"])
def test_what_did_not_come_to_an_end_has_failed(monkeypatch, tmp_path, step):
    """Such as an installation, or a check that takes the process down."""

    def run(command: list[str], **_: object) -> None:
        if "--inside" in command:
            (tmp_path / "minari.json").write_text(
                '{"minari": "9.9"}\n["All is well.", true, 1.0]\n'
            )
        if step in command or (step == "checks" and "--inside" in command):
            raise subprocess.CalledProcessError(-11, command)

    monkeypatch.setattr("clients.__main__._BUILD", tmp_path)
    monkeypatch.setattr("subprocess.run", run)
    versions, [*passed, failure] = try_client("minari")
    assert not failure.passed
    assert failure.what.startswith(step)
    assert (versions, [check.what for check in passed]) == (
        ({"minari": "9.9"}, ["All is well."]) if step == "checks" else ({}, [])
    )


@pytest.mark.parametrize(("passed", "code"), [(True, 0), (False, 1)])
def test_the_exit_code_says_whether_all_passed(monkeypatch, tmp_path, capsys, passed, code):
    report = tmp_path / "report"
    report.write_text(
        '{"torchrl": "9.9"}\n'
        + json.dumps(["All is well.", True, 1.0])
        + "\n"
        + json.dumps(["So is this.", passed, 2.0])
    )
    monkeypatch.setattr("clients.__main__.try_client", lambda name: read(report))
    assert main(["torchrl"]) == code
    said = capsys.readouterr().out
    assert "torchrl 9.9" in said
    assert ("FAILED" in said) == (not passed)


def test_an_unknown_client_is_refused(capsys):
    assert main(["torchlr"]) == 2
    assert "'torchlr'" in capsys.readouterr().err


@pytest.mark.parametrize("check", ["wrappers", "vectors"])
def test_supersuit_finds_what_it_needs(check):
    pytest.importorskip("supersuit")
    from clients import supersuit

    getattr(supersuit, check)()
