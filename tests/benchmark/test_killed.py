"""A run that is killed goes on where it was: no cell is lost, and none is counted twice."""

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
from benchmark_cases import results, run, tiny
from children import children

from roletrust_env.benchmark.cells import cells
from roletrust_env.benchmark.store import Store

ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
OFTEN = pytest.mark.parametrize(
    "times", [pytest.param(2, marks=pytest.mark.slow), pytest.param(10, marks=pytest.mark.extras)]
)


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """The results, and seconds that the run took."""
    began = time.monotonic()
    whole = results(run(tmp_path_factory.mktemp("whole") / "results.sqlite"))
    assert len(whole) == len(cells(tiny(seeds=[0, 1])))
    return whole, time.monotonic() - began


def begun(path):
    return subprocess.Popen([sys.executable, benchmark_cases.__file__, path], env=ENVIRONMENT)


def workers(process):
    """Processes that a run has started to play, by their ids."""
    found = []
    for pid in children(process.pid):
        with suppress(OSError):
            if "resource_tracker" not in Path(f"/proc/{pid}/cmdline").read_text():  # of multiprocessing
                found.append(pid)
    return found


def kept(path):
    """How many cells a file holds; none, as long as it has no tables."""
    with suppress(ValueError), Store(path) as store:
        return len(store.finished())
    return 0


def goes(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def kill_runs(path, times, seconds, luck):
    """Begin a run so many times and kill it at a random moment; the number of cells that each left behind."""
    found = []
    for _ in range(times):
        process = begun(path)
        time.sleep(luck.uniform(0.1, 1.0) * seconds)
        theirs = workers(process)
        process.kill()
        process.wait()
        until = time.monotonic() + 300
        while any(map(goes, theirs)):  # they end by themselves
            assert time.monotonic() < until
            time.sleep(0.05)
        found.append(kept(path))
    return found


def kill_workers(process, path, times, pause, luck):
    """Kill a worker at random so many times, as long as the run goes on; how often that was.

    Between two of them a cell at least is played: workers of which many in a row end before they can work are not
    started again, and on a busy machine that start takes long.
    """
    killed, before = 0, 0
    while killed < times and process.poll() is None:
        time.sleep(luck.uniform(0, 2 * pause))
        if kept(path) == before:
            continue
        before = kept(path)
        if theirs := workers(process):
            with suppress(ProcessLookupError):
                os.kill(luck.choice(theirs), signal.SIGKILL)
                killed += 1
    return killed


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked up in /proc")
class TestKilled:
    @OFTEN
    def test_whole_runs(self, tmp_path, uninterrupted, times):
        expected, seconds = uninterrupted
        path = tmp_path / "results.sqlite"
        left = kill_runs(path, times, seconds / 2, random.Random(times))
        assert left == sorted(left)  # nothing that was kept is lost
        assert results(run(path)) == expected

    @OFTEN
    def test_workers(self, tmp_path, uninterrupted, times):
        expected, seconds = uninterrupted
        path, killed, luck = tmp_path / "results.sqlite", 0, random.Random(times)
        while killed < times:
            path.unlink(missing_ok=True)
            process = begun(path)
            killed += kill_workers(process, path, times - killed, seconds / times / 2, luck)
            assert process.wait(timeout=600) == 0
            with Store(path) as store:
                assert results(store.all()) == expected
