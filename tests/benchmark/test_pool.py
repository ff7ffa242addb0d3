"""Processes that play cells: cells that hang or kill their process harm no others."""

import pytest
from benchmark_cases import results, tiny

from roletrust_env.benchmark.cells import cells
from roletrust_env.benchmark.pool import LocalPool
from roletrust_env.benchmark.run_cell import play_cell


@pytest.mark.parametrize(("model", "words"), [("Hanging", "given up after 10 seconds"), ("Dying", "died 3 times")])
def test_a_cell_that_hangs_or_kills_its_process_is_one_line(model, words):
    suite = tiny(
        models=[f"benchmark_cases:{model}", "mean"],
        limit_s=10.0,  # far more than the mean takes on a busy machine
        tracks={"honest": {}},
    )
    found = dict(LocalPool(2).play(suite, cells(suite)))
    assert found.keys() == set(cells(suite))
    bad = {cell: done for cell, done in found.items() if cell.model != "mean"}
    assert all(words in done.failed and "\n" not in done.failed for done in bad.values())
    good = [cell for cell in found if cell not in bad]
    assert results((cell, found[cell]) for cell in good) == results((cell, play_cell(suite, cell)) for cell in good)


def test_cells_that_nobody_waits_for_are_stopped():
    suite = tiny(models=["benchmark_cases:Hanging", "mean"], limit_s=600.0)
    playing = LocalPool(2).play(suite, [*cells(suite)[:1], *cells(suite)[-2:]])
    cell, done = next(playing)
    assert cell.model == "mean"
    assert not done.failed
    playing.close()
