"""A Ray cluster on this machine plays the same cells with the same results."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from benchmark_cases import results, tiny

from roletrust_env.benchmark.cells import cells
from roletrust_env.benchmark.pool import LocalPool

pytest.importorskip("ray")
pytestmark = pytest.mark.extras


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """Of a cluster with two workers, which ends with the tests."""
    port = 20_000 + os.getpid() % 10_000
    folder = Path(sys.executable).parent
    options = [f"--port={port}", "--num-cpus=2", "--include-dashboard=false", "--disable-usage-stats", "--block"]
    options += ["--node-ip-address=127.0.0.1", "--object-store-memory=100000000"]
    environment = {**os.environ, "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}"}
    log = (tmp_path_factory.mktemp("ray") / "log").open("w")
    head = subprocess.Popen(
        [folder / "ray", "start", "--head", *options], env=environment, stdout=log, stderr=log, start_new_session=True
    )
    yield f"127.0.0.1:{port}"
    os.killpg(head.pid, signal.SIGTERM)
    head.wait(timeout=60)


@pytest.fixture
def cluster(address):
    from roletrust_env.benchmark.cluster import Cluster

    until = time.monotonic() + 120
    while True:
        try:
            found = Cluster(address)
            break
        except ValueError:  # it is not there yet
            assert time.monotonic() < until
            time.sleep(1)
    yield found
    found.close()


def test_two_workers_of_ray_bring_what_one_process_brings(cluster):
    suite = tiny()
    assert results(cluster.play(suite, cells(suite))) == results(LocalPool(1).play(suite, cells(suite)))


def test_cells_that_hang_or_kill_their_process_harm_no_others(cluster):
    names = [f"benchmark_cases:{name}" for name in ("Hanging", "Dying", "Raising")]
    suite = tiny(models=[*names, "mean"], tracks={"honest": {}}, limit_s=3.0)
    found = {cell.model: done for cell, done in cluster.play(suite, cells(suite))}
    words = ("given up after 3 seconds", "died 3 times", "RuntimeError: two lines")
    for name, said in zip(names, words, strict=True):
        assert said in found[name].failed
    assert found["mean"].rows


def test_cells_that_nobody_waits_for_are_stopped(cluster):
    suite = tiny(models=["mean", "benchmark_cases:Hanging"], tracks={"honest": {}})
    playing = cluster.play(suite, cells(suite))
    cell, _ = next(playing)
    assert cell.model == "mean"
    playing.close()


def test_nobody_there_is_one_line():
    from roletrust_env.benchmark.cluster import Cluster

    with pytest.raises(ValueError, match="no Ray cluster answers there") as error:
        Cluster("127.0.0.1:1")
    assert "\n" not in str(error.value)
