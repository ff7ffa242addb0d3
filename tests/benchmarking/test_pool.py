"""Worker processes: cells that hang or kill their process do not affect others."""

import os
import signal
from multiprocessing.context import SpawnProcess

import pytest
from benchmark_cases import results
from small_suites import tiny

from roletrust_env.benchmarking.cells import play_cell
from roletrust_env.benchmarking.pool import JobResult, LocalPool, WorkerPool


def test_a_cell_that_hangs_or_kills_its_process_has_a_one_line_error():
    words = {
        "benchmark_cases:Hanging": "given up after 4 seconds",
        "benchmark_cases:Dying": "died 3 times",
    }
    suite = tiny(
        models=[*words, "mean"],
        limit_s=4.0,
        settings={"clean": {}, "raters": {"roles": ["SR"], "share": 0.3}},
    )
    played = dict(LocalPool(2).play(suite, suite.cells()))
    assert played.keys() == set(suite.cells())
    bad = {cell: result.failed for cell, result in played.items() if cell.model in words}
    assert all(words[cell.model] in failed and "\n" not in failed for cell, failed in bad.items())
    good = [cell for cell in played if cell not in bad]
    assert results((cell, played[cell]) for cell in good) == results(
        (cell, play_cell(suite, cell)) for cell in good
    )


def test_closing_the_generator_stops_the_cells():
    suite = tiny(models=["benchmark_cases:Hanging", "mean"], limit_s=600.0)
    playing = LocalPool(2).play(suite, [*suite.cells()[:1], *suite.cells()[-2:]])
    cell, result = next(playing)
    assert cell.model != "benchmark_cases:Hanging"
    assert not result.failed
    playing.close()


@pytest.mark.skipif(os.name != "posix", reason="there are no signals")
def test_an_interrupt_does_not_end_a_worker_that_starts(monkeypatch):
    """A shell sends it to all processes of a command, which would print how they end."""
    start = SpawnProcess.start

    def start_and_interrupt(process):
        start(process)
        os.kill(process.pid, signal.SIGINT)

    monkeypatch.setattr(SpawnProcess, "start", start_and_interrupt)
    with WorkerPool(len, 1, {}) as pool:
        assert dict(pool.run({"job": ("word",)}, limit_s=60.0)) == {"job": JobResult(4)}
