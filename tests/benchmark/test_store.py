"""The file of a run: what can happen to it is one line, and nothing that it held is lost."""

import json
import os
import sqlite3
import subprocess
import sys

import pytest
from benchmark_cases import results, tiny

from roletrust_env.benchmark import store as store_file
from roletrust_env.benchmark.cells import cells
from roletrust_env.benchmark.run_cell import AttackResult, CellResult
from roletrust_env.benchmark.store import Store

SUITE = tiny()
SCORES = {"utility": [0.25, None, 1.0]}
DONE = CellResult((AttackResult("bad-mouthing", "at its defaults", 0, SCORES, SCORES, [0.5, None]),), 1.5, env_steps=15)


@pytest.fixture
def path(tmp_path):
    """A file that holds three cells."""
    with Store(tmp_path / "results.sqlite", SUITE) as store:
        for cell in cells(SUITE)[:3]:
            store.add(cell, DONE)
    return tmp_path / "results.sqlite"


def refused(path, suite=None, kind=ValueError):
    """The one line with which a file is refused."""
    with pytest.raises(kind) as error:
        Store(path, suite).all()
    assert "\n" not in str(error.value)
    assert str(path) in str(error.value)
    return str(error.value)


def changed(path, statement, *values):
    file = sqlite3.connect(path)
    with file:
        file.execute(statement, values)
    file.close()


def test_what_was_kept_comes_back(path):
    with Store(path) as store:
        assert [kept.done for kept in store.all()] == [DONE] * 3
        assert {kept.cell for kept in store.all()} == set(cells(SUITE)[:3])
        assert store.suite == SUITE


def test_what_was_played_with_another_source_is_not_gone_on_with(path, monkeypatch):
    monkeypatch.setattr(store_file, "hashes", lambda named: dict.fromkeys(named, "0" * 64))
    name = cells(SUITE)[0].model
    assert f"another source of trust model {name}, " in refused(path, SUITE)
    with Store(path) as store:  # to look at it is no harm
        assert len(store.all()) == 3
    with Store(path, SUITE, anew=True) as store:
        assert not store.all()
    Store(path, SUITE).close()


def test_a_folder_is_said_to_be_one(tmp_path):
    assert "is a folder; name the results.sqlite in it" in refused(tmp_path)


def test_a_cell_counts_once_and_one_that_failed_is_played_again(path):
    first, second, *_ = cells(SUITE)
    with Store(path, SUITE) as store:
        store.add(first, DONE._replace(rows=(), failed="it broke"))
        assert len(store.all()) == 3
        assert first.key not in store.finished()
        assert second.key in store.finished()
        store.add(first, DONE)
        assert results(store.all())[first.key].rows == DONE.rows
        assert len(store.finished()) == 3


def test_a_run_that_another_holds_is_left_alone(path):
    with Store(path, SUITE):
        assert "another run writes" in refused(path, SUITE)
        with Store(path) as reader:  # reading is free
            assert len(reader.all()) == 3
        code = "from benchmark_cases import *\ntry: Store(Path(sys.argv[1]), tiny())\nexcept ValueError as e: print(e)"
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        told = subprocess.run([sys.executable, "-c", code, path], env=environment, capture_output=True, text=True)
        assert "another run writes" in told.stdout, told.stderr
    with Store(path, SUITE) as store:
        assert len(store.finished()) == 3


def test_a_file_that_another_program_holds_is_left_alone(path):
    with Store(path, SUITE) as store:
        store._file.execute("PRAGMA busy_timeout=50")
        other = sqlite3.connect(path, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(ValueError, match="held by another program"):
            store.add(cells(SUITE)[3], DONE)
        other.execute("ROLLBACK")
        other.close()
        store.add(cells(SUITE)[3], DONE)
        assert len(store.all()) == 4


def test_another_suite_format_or_software_is_refused(path):
    assert "another suite (not the same: games)" in refused(path, tiny(games=4))
    held = json.dumps({"package": {"name": "roletrust-env", "version": "0.0.1"}})
    changed(path, "UPDATE facts SET value = ? WHERE name = 'software'", held)
    assert "other versions" in refused(path, SUITE)
    with Store(path) as store:  # to look at it is no harm
        assert len(store.all()) == 3
    changed(path, "UPDATE facts SET value = '99' WHERE name = 'format'")
    assert "format 99" in refused(path)
    assert "format 99" in refused(path, SUITE)


@pytest.mark.parametrize("writing", [None, SUITE])
def test_what_is_no_file_of_a_run_is_refused_and_left_as_it_is(tmp_path, writing):
    other = tmp_path / "other.sqlite"
    changed(other, "CREATE TABLE friends (name TEXT)")
    noise, shorn = tmp_path / "noise.sqlite", tmp_path / "shorn.sqlite"
    noise.write_bytes(bytes(range(256)) * 64)
    with Store(shorn, SUITE) as store:
        for cell in cells(SUITE):
            store.add(cell, DONE._replace(rows=tuple(DONE.rows[0]._replace(attack=f"{k}") for k in range(50))))
    shorn.write_bytes(shorn.read_bytes()[: shorn.stat().st_size // 2])
    for path in (other, noise, shorn):
        before = path.read_bytes()
        assert "no benchmark's file, or it is damaged" in refused(path, writing)
        assert path.read_bytes() == before


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE attacks SET measured = '[1, 2]'",
        'UPDATE attacks SET chosen = \'{"utility": ["much"]}\'',
        "UPDATE attacks SET by_round = '[1e999]'",
        "UPDATE cells SET cell = '{\"ghost\": 1}'",
        "UPDATE cells SET cell = '[]'",
        f"UPDATE facts SET value = '{'[' * 100_000}' WHERE name = 'suite'",
        "UPDATE facts SET value = '[1]' WHERE name = 'suite'",
    ],
)
def test_a_file_that_somebody_made_up_is_refused(path, statement):
    changed(path, statement)
    refused(path)


def test_who_begins_anew_throws_away_what_nobody_else_writes(path):
    with Store(path, SUITE) as store:
        with pytest.raises(ValueError, match="another run writes"):
            Store(path, SUITE, anew=True)
        assert len(store.all()) == 3
    with Store(path, tiny(games=4), anew=True) as store:
        assert store.all() == []


def test_what_is_not_there_is_not_read(tmp_path):
    assert "there is no" in refused(tmp_path / "none.sqlite")
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_loses_nothing(path):
    with Store(path, SUITE) as store:
        pages = store._file.execute("PRAGMA page_count").fetchone()[0]
        store._file.execute(f"PRAGMA max_page_count={pages}")
        large = DONE._replace(rows=(DONE.rows[0]._replace(words="much " * 100_000),))
        with pytest.raises(OSError, match="cannot be written") as error:
            store.add(cells(SUITE)[0], large)
        assert "\n" not in str(error.value)
        assert [kept.done for kept in store.all()] == [DONE] * 3  # also the cell that was to be replaced
        store._file.execute("PRAGMA max_page_count=100000")
        store.add(cells(SUITE)[3], large)
    with Store(path, SUITE) as store:
        assert len(store.finished()) == 4


def test_a_folder_in_which_nothing_can_be_written_is_one_line(tmp_path):
    (tmp_path / "results.sqlite").mkdir()
    assert "cannot be written" in refused(tmp_path / "results.sqlite", SUITE, OSError)
