"""File of a run: every error is one line, and no stored result is lost."""

import json
import sqlite3
from pathlib import Path

import pytest
from benchmark_cases import results
from refusals import refuses
from small_suites import tiny

from roletrust_env.benchmarking import store as store_file
from roletrust_env.benchmarking.cells import play_cell
from roletrust_env.benchmarking.schema import AttackResult, CellResult
from roletrust_env.benchmarking.store import ResultStore
from roletrust_env.benchmarking.suite import Cell
from roletrust_env.evaluation.received import RANGES

SUITE = tiny()
CHOSEN = {"skill": [0.25, 0.5]}
SCORES = {name: [0.25, None, 1.0] for name in RANGES}
RESULT = CellResult(
    (
        AttackResult(
            "bad-mouthing",
            "at its defaults",
            0,
            CHOSEN,
            SCORES,
            [0.5, None],
            "{}",
            ((10, 0.25), (20, 0.5)),
        ),
    ),
    1.5,
    env_steps=15,
)


@pytest.fixture
def path(tmp_path):
    """File with three cells."""
    with ResultStore(tmp_path / "results.sqlite", SUITE) as store:
        for cell in SUITE.cells()[:3]:
            store.add(cell, RESULT)
    return tmp_path / "results.sqlite"


def refused(path, *words, suite=None, kind=ValueError):
    with refuses(kind, path, *words):
        ResultStore(path, suite).all()


def execute(path, statement, *values):
    file = sqlite3.connect(path)
    with file:
        file.execute(statement, values)
    file.close()


def test_stored_cells_can_be_read(path):
    with ResultStore(path) as store:
        assert [one.result for one in store.all()] == [RESULT] * 3
        assert {one.cell for one in store.all()} == set(SUITE.cells()[:3])
        assert store.suite == SUITE


def test_a_reader_leaves_the_folder_as_it_was(path):
    """Also beside the journal of a run that was killed, whole or cut off."""
    before = {one.name: one.read_bytes() for one in path.parent.iterdir()}
    with ResultStore(path) as store:
        assert len(store.all()) == 3
    assert {one.name: one.read_bytes() for one in path.parent.iterdir()} == before


@pytest.mark.parametrize(("length", "found"), [(None, 3), (20, 2), (0, 2)])
def test_a_reader_leaves_the_journal_of_a_killed_run(tmp_path, length, found):
    with ResultStore(tmp_path / "running.sqlite", SUITE) as store:
        for cell in SUITE.cells()[:2]:
            store.add(cell, RESULT)
    folder = tmp_path / "copy"
    folder.mkdir()
    with ResultStore(tmp_path / "running.sqlite", SUITE) as store:
        store.add(SUITE.cells()[2], RESULT)
        for end in ("", "-wal"):
            (folder / f"results.sqlite{end}").write_bytes(
                (tmp_path / f"running.sqlite{end}").read_bytes()[: length if end else None]
            )
    before = {one.name: one.read_bytes() for one in folder.iterdir()}
    with ResultStore(folder / "results.sqlite") as store:
        assert len(store.all()) == found
    assert {one.name: one.read_bytes() for one in folder.iterdir()} == before


def test_a_reader_beside_a_writer_leaves_its_journals(path):
    with ResultStore(path, SUITE) as writer:
        writer.add(SUITE.cells()[3], RESULT)
        with ResultStore(path) as reader:
            assert len(reader.all()) == 4
        assert path.with_name("results.sqlite-wal").exists()
        writer.add(SUITE.cells()[4], RESULT)
    with ResultStore(path) as reader:
        assert len(reader.all()) == 5


def test_a_run_with_another_source_is_not_continued(path, monkeypatch):
    monkeypatch.setattr(store_file, "hashes", lambda factories: dict.fromkeys(factories, "0" * 64))
    name = SUITE.cells()[0].model
    refused(path, name, suite=SUITE)
    with ResultStore(path) as store:  # reading is still allowed
        assert len(store.all()) == 3


def test_a_folder_is_refused(tmp_path):
    refused(tmp_path, "results.sqlite")


def test_a_cell_counts_once_and_one_that_failed_is_played_again(path):
    first, second, *_ = SUITE.cells()
    with ResultStore(path, SUITE) as store:
        store.add(first, RESULT._replace(rows=(), failed="it broke"))
        assert len(store.all()) == 3
        assert first.key not in store.finished_keys()
        assert second.key in store.finished_keys()
        store.add(first, RESULT)
        assert results(store.all())[first.key].rows == RESULT.rows
        assert len(store.finished_keys()) == 3


def test_a_run_with_another_writer_is_refused(path):
    with ResultStore(path, SUITE):
        refused(path, suite=SUITE)
        with ResultStore(path) as reader:  # reading is always allowed
            assert len(reader.all()) == 3
    with ResultStore(path, SUITE) as store:
        assert len(store.finished_keys()) == 3


def test_a_file_that_another_program_locks_is_unchanged(path):
    with ResultStore(path, SUITE) as store:
        store._file.execute("PRAGMA busy_timeout=50")
        other = sqlite3.connect(path, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        with refuses(ValueError, "results.sqlite"):
            store.add(SUITE.cells()[3], RESULT)
        other.execute("ROLLBACK")
        other.close()
        store.add(SUITE.cells()[3], RESULT)
        assert len(store.all()) == 4


def test_a_run_goes_on_with_a_larger_suite(path):
    settings = {**SUITE.model_dump()["settings"], "coalition": {"roles": ["SR"], "share": 0.2}}
    larger = tiny(
        models=["mean", "block", "median"], methods=["scripts", "search"], settings=settings
    )
    with ResultStore(path, larger) as store:
        assert [one.result for one in store.all()] == [RESULT] * 3
        assert store.finished_keys() < {cell.key for cell in larger.cells()}
    with ResultStore(path) as store:
        assert store.suite == larger


@pytest.mark.parametrize("method", ["scripts", "search"])
def test_a_cell_plays_the_same_in_a_larger_suite(method):
    larger = tiny(models=["mean", "median"], methods=["search", "scripts"])
    smaller = tiny(methods=[method])
    cell = Cell("mean", "common", "raters", method)
    assert larger.rules(cell) == smaller.rules(cell)
    one, other = (play_cell(suite, cell) for suite in (smaller, larger))
    assert repr(one._replace(seconds=0)) == repr(other._replace(seconds=0))


@pytest.mark.parametrize(
    "changes",
    [
        {"games": 4},
        {"selection_games": 1},
        {"models": ["block"]},  # cells of mean were played
        {"attacks": ["bad-mouthing"]},
        {"settings": {"clean": {}, "raters": {"roles": ["SR"], "share": 0.4}}},
        {"worlds": {**SUITE.worlds.model_dump(), "measured": 4}},
        {"reports": 2},
        {"limit_s": 61},
    ],
)
def test_a_suite_that_plays_stored_cells_in_another_way_is_refused(tmp_path, changes):
    path = tmp_path / "results.sqlite"
    with ResultStore(path, SUITE) as store:
        for cell in SUITE.cells():
            store.add(cell, RESULT)
    before = path.read_bytes()
    refused(path, next(iter(changes)), suite=tiny(**changes))
    assert path.read_bytes() == before


def test_another_suite_format_or_software_is_refused(path):
    refused(path, "games", suite=tiny(games=4))
    other = json.dumps({"package": {"name": "roletrust-env", "version": "0.0.1"}})
    execute(path, "UPDATE facts SET value = ? WHERE name = 'software'", other)
    refused(path, "software", suite=SUITE)
    with ResultStore(path) as store:  # reading is still allowed
        assert len(store.all()) == 3
    execute(path, "UPDATE facts SET value = '99' WHERE name = 'format'")
    refused(path, "99")
    refused(path, "99", suite=SUITE)


@pytest.mark.parametrize("writing", [None, SUITE])
def test_other_and_damaged_files_are_refused_and_unchanged(tmp_path, writing):
    other = tmp_path / "other.sqlite"
    execute(other, "CREATE TABLE friends (name TEXT)")
    noise, truncated = tmp_path / "noise.sqlite", tmp_path / "truncated.sqlite"
    noise.write_bytes(bytes(range(256)) * 64)
    with ResultStore(truncated, SUITE) as store:
        for cell in SUITE.cells():
            store.add(
                cell,
                RESULT._replace(
                    rows=tuple(RESULT.rows[0]._replace(attack=f"{k}") for k in range(50))
                ),
            )
    truncated.write_bytes(truncated.read_bytes()[: truncated.stat().st_size // 2])
    for path in (other, noise, truncated):
        before = path.read_bytes()
        refused(path, suite=writing)
        assert path.read_bytes() == before


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE attacks SET measured = '[1, 2]'",
        'UPDATE attacks SET chosen = \'{"skill": ["much"]}\'',
        "UPDATE attacks SET by_round = '[1e999]'",
        "UPDATE cells SET cell = '{\"ghost\": 1}'",
        "UPDATE cells SET cell = '[]'",
        "UPDATE cells SET cell = json_set(cell, '$.method', 'three')",
        "UPDATE cells SET seconds = 'long'",
        "UPDATE cells SET env_steps = 'many'",
        f"UPDATE facts SET value = '{'[' * 100_000}' WHERE name = 'suite'",
        "UPDATE facts SET value = '[1]' WHERE name = 'suite'",
        "UPDATE facts SET value = '[]' WHERE name = 'sources'",
        "UPDATE attacks SET chosen = '{}'",
        "UPDATE attacks SET measured = json_remove(measured, '$.skill')",
        "UPDATE attacks SET measured = json_remove(measured, '$.regret[0]')",
        "UPDATE attacks SET measured = json_set(measured, '$.skill[0]', 1e300)",
        "UPDATE attacks SET measured = json_set(measured, '$.brier[0]', 1.7)",
        "UPDATE attacks SET measured = json_set(measured, '$.regret[0]', -1.1)",
        "UPDATE attacks SET chosen = json_set(chosen, '$.skill[0]', 2e3)",
        "UPDATE attacks SET chosen = json_set(chosen, '$.skill[0]', '0.5')",
        "UPDATE attacks SET by_round = '[true]'",
        "UPDATE attacks SET progress = '[[1.0, 0.5]]'",
        "UPDATE attacks SET rounds = -1",
        "UPDATE cells SET seconds = -1",
        "UPDATE cells SET cell = json_set(cell, '$.setting', 'nowhere')",
        "DELETE FROM cells WHERE key = (SELECT min(key) FROM cells)",
    ],
)
def test_a_file_with_invalid_values_is_refused(path, statement):
    execute(path, statement)
    refused(path)


def test_a_missing_file_is_refused(tmp_path):
    refused(tmp_path / "none.sqlite")
    assert list(tmp_path.iterdir()) == []


def test_a_name_that_is_too_long_is_refused():
    with refuses(ValueError, "path"):
        ResultStore(Path("x" * 300))


def test_a_full_disk_loses_nothing(path):
    with ResultStore(path, SUITE) as store:
        pages = store._file.execute("PRAGMA page_count").fetchone()[0]
        store._file.execute(f"PRAGMA max_page_count={pages}")
        large = RESULT._replace(rows=(RESULT.rows[0]._replace(words="much " * 100_000),))
        with refuses(OSError, "results.sqlite"):
            store.add(SUITE.cells()[0], large)
        assert [one.result for one in store.all()] == [
            RESULT
        ] * 3  # also the cell that was being replaced
        store._file.execute("PRAGMA max_page_count=100000")
        store.add(SUITE.cells()[3], large)
    with ResultStore(path, SUITE) as store:
        assert len(store.finished_keys()) == 4


def test_a_path_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "results.sqlite").mkdir()
    refused(tmp_path / "results.sqlite", suite=SUITE, kind=OSError)
