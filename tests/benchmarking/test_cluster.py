"""A Ray cluster on this machine plays the same cells with the same results."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from benchmark_cases import results
from refusals import refuses
from small_suites import tiny

from roletrust_env.benchmarking.pool import LocalPool

pytest.importorskip("ray")
pytestmark = pytest.mark.extras


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """Address of a cluster with two workers, which stops after the tests."""
    port = 20_000 + os.getpid() % 10_000
    folder = Path(sys.executable).parent
    options = [
        f"--port={port}",
        "--num-cpus=2",
        "--include-dashboard=false",
        "--disable-usage-stats",
        "--block",
    ]
    options += ["--node-ip-address=127.0.0.1", "--object-store-memory=100000000"]
    environment = {**os.environ, "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}"}
    log = (tmp_path_factory.mktemp("ray") / "log").open("w")
    head = subprocess.Popen(
        [folder / "ray", "start", "--head", *options],
        env=environment,
        stdout=log,
        stderr=log,
        start_new_session=True,
    )
    yield f"127.0.0.1:{port}"
    os.killpg(head.pid, signal.SIGTERM)
    head.wait(timeout=60)


@pytest.fixture
def cluster(address):
    from roletrust_env.benchmarking.cluster import Cluster

    until = time.monotonic() + 120
    while True:
        try:
            connection = Cluster(address)
            break
        except ValueError:  # it has not started yet
            assert time.monotonic() < until
            time.sleep(1)
    yield connection
    connection.close()


def test_two_ray_workers_give_the_results_of_one_process(cluster):
    suite = tiny()
    assert results(cluster.play(suite, suite.cells())) == results(
        LocalPool(1).play(suite, suite.cells())
    )


def test_cells_that_hang_or_kill_their_process_do_not_affect_others(cluster):
    names = [f"benchmark_cases:{name}" for name in ("Hanging", "Dying", "Raising")]
    suite = tiny(
        models=[*names, "mean"],
        settings={"clean": {}, "raters": {"roles": ["SR"], "share": 0.3}},
        limit_s=3.0,
    )
    by_model = {cell.model: result for cell, result in cluster.play(suite, suite.cells())}
    words = ("given up after 3 seconds", "died 3 times", "RuntimeError: two lines")
    for name, message in zip(names, words, strict=True):
        assert message in by_model[name].failed
    assert by_model["mean"].rows


def test_closing_the_generator_stops_the_cells(cluster):
    suite = tiny(
        models=["mean", "benchmark_cases:Hanging"],
        settings={"clean": {}, "raters": {"roles": ["SR"], "share": 0.3}},
    )
    playing = cluster.play(suite, suite.cells())
    cell, _ = next(playing)
    assert cell.model == "mean"
    playing.close()


def test_a_missing_cluster_is_a_one_line_error():
    from roletrust_env.benchmarking.cluster import Cluster

    with refuses(ValueError, "Ray"):
        Cluster("127.0.0.1:1")
