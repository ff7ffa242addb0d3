"""`roletrust benchmark`: what goes wrong in a run is one clear line each, and the rest of it is
unharmed."""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest
from children import children
from command_line import run
from csv_files import csv_rows

from roletrust_env.benchmarking.store import ResultStore
from roletrust_env.benchmarking.suite_files import load_suite

SUITE = """
extends = "quick"
models = ["mean"]
own = []
attacks = ["bad-mouthing", "rank-lies"]
methods = ["scripts"]
games = 1
selection_games = 1
limit_s = 4
solo = { common = "constant", own = "constant" }
[settings.clean]
[settings.raters]
roles = ["SR"]
share = 0.3
"""
HEARS = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
"""What a shell starts in the background does not hear an interrupt."""
CODE = "from roletrust_experiments import main; main()"
ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tiny.toml").write_text(SUITE)
    return tmp_path


def benchmark(*options: str) -> tuple[int, list[str]]:
    """Return the exit code, and the lines that are printed."""
    words = ("--suite", "tiny.toml", "--workers", "2", "--out", "out")
    models = [] if any(option[:1] != "-" for option in options[:1]) else ["all"]
    result = run("benchmark", *models, *options, *words)
    return result.exit_code, result.output.splitlines()


def board(here: Path) -> dict[str, dict[str, str]]:
    return {row["model"]: row for row in csv_rows(here / "out" / "leaderboard.csv")}


def test_a_dry_run_writes_nothing(here: Path) -> None:
    code, lines = benchmark("--dry-run")
    assert code == 0
    assert any("mean" in line for line in lines)
    assert not (here / "out").exists()


def test_without_a_model_nothing_is_played(here: Path) -> None:
    result = run("benchmark", "--suite", "tiny.toml", "--out", "out")
    assert result.exit_code == 2
    assert "tiny" in result.output
    assert not (here / "out").exists()


@pytest.mark.slow
def test_models_that_misbehave_are_a_line_for_each_cell_and_harm_no_other(here: Path) -> None:
    assert benchmark()[0] == 0
    alone = board(here)["mean"]
    said = {
        "NotANumber": "nan",
        "TooMuch": "[0, 1]",
        "Hanging": "given up after 4 seconds",
        "Raising": "RuntimeError: two lines",
        "Leaving": "SystemExit: 3",
        "Dying": "died 3 times",
    }
    models = [f"benchmark_cases:{name}" for name in said]
    code, lines = benchmark("mean", *models, "--out", "again")
    assert code == 1, lines
    for name, words in said.items():
        told = [line for line in lines if line.startswith(f"benchmark_cases:{name}|")]
        assert len(told) == 2, (name, lines)
        assert all(words in line for line in told)
        assert board(here)[f"benchmark_cases:{name}"]["missing"] == "2"
    assert board(here)["mean"]["worst"] == alone["worst"]


def test_attackers_that_misbehave_are_told_and_the_others_count(
    here: Path, in_process: None
) -> None:
    attacks = [
        f"--attack=benchmark_cases:{name}" for name in ("NanRater", "WildRater", "BrokenRater")
    ]
    code, lines = benchmark("--attack=bad-mouthing", *attacks)
    assert code == 1, lines
    (told,) = (line for line in lines if line.startswith("mean|common|raters"))
    for words in (
        "attack benchmark_cases:NanRater: ",
        "attack benchmark_cases:WildRater: ",
        "ZeroDivisionError",
    ):
        assert words in told
    assert board(here)["mean"]["missing"] == "1"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["meen"], "unknown trust model 'meen'; did you mean 'mean'?"),
        (["--attack", "bad-mouth"], "unknown attacker 'bad-mouth'"),
        (["os:system:command=touch hacked"], "'os:system' must make a TrustModel"),
        (["--attack", "os:system:command=touch hacked"], "'os:system' must make a Policy"),
        (["--attack", "learned:path=a,b=c"], "learned:path=a,b=c"),
    ],
)
def test_a_name_that_nobody_has_is_refused_before_anything_happens(
    here: Path, options: list[str], words: str
) -> None:
    code, lines = benchmark(*options)
    assert code == 2
    (line,) = lines
    assert words in line
    assert sorted(path.name for path in here.iterdir()) == ["tiny.toml"]


def other_version(path: Path) -> None:
    file = sqlite3.connect(path)
    with file:
        file.execute("UPDATE facts SET value = '99' WHERE name = 'format'")
    file.close()


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def test_a_file_that_cannot_be_gone_on_with_is_left_as_it_is(here: Path, in_process: None) -> None:
    benchmark()
    path = here / "out" / "results.sqlite"
    whole = path.read_bytes()
    spoilt = (
        (truncate, "is damaged or is not a results file"),
        (other_version, "has the format 99; this version"),
    )
    for spoil, words in spoilt:
        path.write_bytes(whole)
        spoil(path)
        before = path.read_bytes()
        code, lines = benchmark()
        assert (code, len(lines)) == (2, 1)
        assert words in lines[0]
        assert path.read_bytes() == before


def test_a_run_that_goes_on_is_left_alone(here: Path, in_process: None) -> None:
    benchmark()
    path = here / "out" / "results.sqlite"
    with ResultStore(path) as store:
        suite = store.suite
    with ResultStore(path, suite):
        code, lines = benchmark()
        assert (code, len(lines)) == (2, 1)
        assert "another run writes to" in lines[0]
    with ResultStore(path) as store:
        assert len(store.all()) == 4


@pytest.mark.slow
def test_a_full_disk_is_one_line_and_the_run_goes_on_once_there_is_room(here: Path) -> None:
    limit = "import resource, signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN); "
    limit += "resource.setrlimit(resource.RLIMIT_FSIZE, (33_000, resource.RLIM_INFINITY)); "
    options = ["benchmark", "all", "--suite", "tiny.toml", "--workers", "1", "--out", "out"]
    more = (f"[settings.more-{k}]\nroles = ['SR']\nshare = 0.{k}\n" for k in range(2, 6))
    (here / "tiny.toml").write_text(SUITE + "".join(more))
    full = subprocess.run(
        [sys.executable, "-c", limit + CODE, *options],
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert full.returncode == 2, full.stderr
    assert "Traceback" not in full.stderr
    (line,) = full.stderr.splitlines()
    assert "results.sqlite cannot be written" in line
    assert "free some space and run the command again" in line
    code, lines = benchmark()
    assert code == 0, lines
    assert board(here)["mean"]["missing"] == "0"


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked up in /proc")
def test_an_interrupt_stops_all_and_says_how_to_go_on(here: Path) -> None:
    options = [
        "benchmark",
        "mean",
        "benchmark_cases:Hanging",
        "--suite",
        "tiny.toml",
    ]
    (here / "tiny.toml").write_text(SUITE.replace("limit_s = 4", "limit_s = 600"))
    process = subprocess.Popen(
        [sys.executable, "-c", HEARS + CODE, *options, "--out", "out"],
        env=ENVIRONMENT,
        stderr=subprocess.PIPE,
        text=True,
    )
    path, until = here / "out" / "results.sqlite", time.monotonic() + 120
    while True:  # until the mean is played, and the other hangs
        assert time.monotonic() < until
        time.sleep(0.2)
        try:
            with ResultStore(path) as store:
                if len(store.finished_keys()) >= 2:
                    break
        except ValueError:
            continue
    theirs = children(process.pid)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130
    assert told.splitlines()[-1].startswith("Stopped.")
    assert theirs
    until = time.monotonic() + 30
    while any(Path(f"/proc/{pid}").exists() for pid in theirs):
        assert time.monotonic() < until
        time.sleep(0.1)


def test_a_suite_of_a_file_names_what_is_installed(here: Path) -> None:
    (here / "tiny.toml").write_text(SUITE.replace('"mean"', '"benchmark_cases:Raising"'))
    code, lines = benchmark()
    assert code == 2
    assert "which is not installed" in lines[0]
    assert load_suite("tiny.toml").models == ("benchmark_cases:Raising",)
