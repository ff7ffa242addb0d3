"""A killed run continues where it stopped. No cell is lost, and none is counted twice."""

import os
import random
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import benchmark_cases
import pytest
from benchmark_cases import results, run
from children import children
from small_suites import tiny

from roletrust_env.benchmarking.pool import TRIES
from roletrust_env.benchmarking.store import ResultStore

ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
OFTEN = pytest.mark.parametrize(
    "times", [pytest.param(2, marks=pytest.mark.slow), pytest.param(10, marks=pytest.mark.extras)]
)


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """Results of an uninterrupted run, and its duration in seconds."""
    began = time.monotonic()
    whole = results(run(tmp_path_factory.mktemp("whole") / "results.sqlite"))
    assert len(whole) == len(tiny(methods=["scripts", "search"]).cells())
    return whole, time.monotonic() - began


def start_run(path):
    return subprocess.Popen([sys.executable, benchmark_cases.__file__, path], env=ENVIRONMENT)


def workers(process):
    """Return the ids of the worker processes of a run."""
    pids = []
    for pid in children(process.pid):
        with suppress(OSError):
            if (
                "resource_tracker" not in Path(f"/proc/{pid}/cmdline").read_text()
            ):  # a helper of multiprocessing
                pids.append(pid)
    return pids


def count_cells(path):
    """Return the number of stored cells, which is 0 before the tables exist."""
    with suppress(ValueError), ResultStore(path) as store:
        return len(store.finished_keys())
    return 0


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def kill_runs(path, times, seconds, random_source):
    """Start and kill a run several times at random moments. Return the number of stored cells after
    each kill."""
    counts = []
    for _ in range(times):
        process = start_run(path)
        time.sleep(random_source.uniform(0.1, 1.0) * seconds)
        pids = workers(process)
        process.kill()
        process.wait()
        until = time.monotonic() + 300
        while any(map(is_running, pids)):  # workers exit after their parent
            assert time.monotonic() < until
            time.sleep(0.05)
        counts.append(count_cells(path))
    return counts


def kill_workers(process, times, seconds, random_source):
    """Kill random workers of a run at random moments, at most `times`, and return the number of
    kills."""
    killed = 0
    while killed < times and process.poll() is None:
        time.sleep(random_source.uniform(0, seconds))
        if pids := workers(process):
            with suppress(ProcessLookupError):
                os.kill(random_source.choice(pids), signal.SIGKILL)
                killed += 1
    return killed


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked up in /proc")
class TestKilled:
    @OFTEN
    def test_whole_runs(self, tmp_path, uninterrupted, times):
        expected, seconds = uninterrupted
        path = tmp_path / "results.sqlite"
        counts = kill_runs(path, times, seconds / 2, random.Random(times))
        assert counts == sorted(counts)  # no stored cell is lost
        assert results(run(path)) == expected

    @OFTEN
    def test_workers(self, tmp_path, uninterrupted, times):
        expected, seconds = uninterrupted
        path, killed, random_source = tmp_path / "results.sqlite", 0, random.Random(times)
        while killed < times:
            path.unlink(missing_ok=True)
            process = start_run(path)
            # A cell that lost its worker in every attempt counts as failed: each run keeps one
            # attempt.
            killed += kill_workers(
                process, min(times - killed, TRIES - 1), seconds / 2, random_source
            )
            assert process.wait(timeout=600) == 0
            with ResultStore(path) as store:
                assert results(store.all()) == expected
