"""Entries of the leaderboard: what they hold, published ones, and checks that find false ones."""

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from refusals import refuses
from small_suites import tiny

from roletrust_env.benchmarking import entries
from roletrust_env.benchmarking.entries import (
    Entry,
    published_cells,
    read_entry,
    suite_hash,
)
from roletrust_env.benchmarking.entry_check import (
    check_fresh_worlds,
    check_numbers,
    records_of,
    replay_entry,
)
from roletrust_env.benchmarking.leaderboard import Leaderboard
from roletrust_env.benchmarking.pool import LocalPool
from roletrust_env.benchmarking.run import InProcess, play_suite
from roletrust_env.benchmarking.sources import _code
from roletrust_env.benchmarking.store import ResultStore
from roletrust_env.benchmarking.suite import ReplayedAttack
from roletrust_env.evaluation.agreed import AgreedScripts, check_recorded
from roletrust_env.evaluation.attackers import record_of

SEEN = ReplayedAttack(
    name="seen", setting="raters", record=record_of(AgreedScripts(("rank-lies",)))
)
SUITE = tiny(methods=["scripts", "replayed", "search"], replayed=[SEEN], models=["mean"])


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A finished run."""
    folder = tmp_path_factory.mktemp("run")
    play_suite(SUITE, InProcess(), out=folder)
    with ResultStore(folder / "results.sqlite") as opened:
        yield opened


@pytest.fixture
def entry(store: ResultStore) -> Entry:
    return Entry.of(store, "mean")


def changed(entry: Entry, change: Any) -> Entry:
    data = json.loads(entry.model_dump_json())
    change(data)
    return Entry.model_validate_json(json.dumps(data))


def verdicts(entry: Entry) -> dict[str, bool]:
    return {check.subject: check.ok for check in check_numbers(entry, SUITE)}


def test_an_entry_is_a_file_with_all_scores(
    tmp_path: Path, store: ResultStore, entry: Entry
) -> None:
    path = tmp_path / "mean.json"
    path.write_text(entry.model_dump_json())
    assert read_entry(path) == entry
    stored = {cell.key: result for cell, result in store.all() if cell.model == "mean"}
    assert {cell.key for cell, _ in entry.stored()} == stored.keys()
    for cell, result in entry.stored():
        for one, other in zip(result.rows, stored[cell.key].rows, strict=True):
            assert one.attack == other.attack
            assert one.chosen["skill"] == pytest.approx(other.chosen["skill"], abs=1e-6)
            assert one.record == other.record
    assert all(verdicts(entry).values())


def test_an_entry_of_an_incomplete_run_is_refused(tmp_path: Path, store: ResultStore) -> None:
    with ResultStore(tmp_path / "results.sqlite", SUITE) as other:
        for cell, result in store.all()[:-1]:
            other.add(cell, result)
        with refuses(ValueError, "solo-threshold"):
            Entry.of(other, "solo-threshold")
        with refuses(ValueError, "median"):
            Entry.of(other, "median")


def test_published_models_join_a_run_of_the_same_suite(
    monkeypatch: pytest.MonkeyPatch, entry: Entry
) -> None:
    monkeypatch.setattr(entries, "_carried", lambda: (entry,))
    mine = tiny(methods=["scripts"], models=["block"])
    suite, cells = published_cells(mine)
    assert suite.models == ("block", "mean")
    assert {(cell.model, cell.method) for cell, _ in cells} == {
        ("mean", "honest"),
        ("mean", "scripts"),
    }
    board = Leaderboard.of(suite, cells)
    assert {row.model for row in board.rows if not row.missing} == {"mean"}
    for other in (tiny(games=3), tiny(models=["mean"]), tiny(attacks=["rank-lies"])):
        assert published_cells(other) == (other, [])
    flagged = entry.model_copy(update={"unreliable": "it recognises the games"})
    monkeypatch.setattr(entries, "_carried", lambda: (flagged,))
    assert published_cells(mine) == (mine, [])
    monkeypatch.setattr(entries, "_carried", lambda: (entry,))
    # A search with another budget does not compare.
    budget = {"candidates": 30, "games": 1}
    longer = tiny(methods=["scripts", "search"], models=["block"], search=budget)
    assert suite_hash(longer) == entry.suite_sha256
    assert published_cells(longer) == (longer, [])


def test_false_entries_are_found_without_a_game(entry: Entry) -> None:
    def other_suite(data: Any) -> None:
        data["suite_sha256"] = "0" * 64

    def other_source(data: Any) -> None:
        data["source"]["sha256"] = "0" * 64

    def missing_cell(data: Any) -> None:
        data["cells"].pop()

    def missing_world(data: Any) -> None:
        data["cells"][1]["attacks"][0]["chosen"]["skill"].pop()

    def hidden_attack(data: Any) -> None:
        attacks = next(c for c in data["cells"] if c["method"] == "scripts")["attacks"]
        attacks[next(k for k, a in enumerate(attacks) if not a["measured"])]["chosen"]["skill"] = [
            -5.0,
            -5.0,
        ]

    for change, subject in (
        (other_suite, "suite"),
        (other_source, "source"),
        (missing_cell, "completeness"),
        (missing_world, "consistency"),
        (hidden_attack, "consistency"),
    ):
        wrong = [name for name, ok in verdicts(changed(entry, change)).items() if not ok]
        assert wrong == [subject]


def test_replayed_cells_are_equal_and_false_scores_are_found(entry: Entry) -> None:
    cells = [cell for cell, _ in entry.stored()]
    pool = LocalPool(1, records=records_of(entry), keep=True)
    assert {check.message for check in replay_entry(entry, SUITE, cells, pool)} == {"equal"}

    def better(data: Any) -> None:
        for cell in data["cells"]:
            for attack in cell["attacks"]:
                if attack["measured"]:
                    values = attack["measured"]["skill"]
                    attack["measured"]["skill"] = [value + 0.1 for value in values]

    false = changed(entry, better)
    assert not any(check.ok for check in replay_entry(false, SUITE, cells, pool))


def test_an_attack_is_there_once_in_a_cell(entry: Entry) -> None:
    """Else the last row of its name would be compared, and the first one counted."""

    def doubled(data: Any) -> None:
        attacks = data["cells"][-1]["attacks"]
        attacks.append({**attacks[0], "measured": {}})

    assert not verdicts(changed(entry, doubled))["consistency"]


def test_worlds_that_are_left_out_and_other_measured_attacks_are_found(entry: Entry) -> None:
    cells = [cell for cell, _ in entry.stored() if cell.method == "scripts"]
    pool = LocalPool(1, records=records_of(entry), keep=True)

    def without_the_worst(data: Any) -> None:
        for cell in data["cells"]:
            for attack in cell["attacks"]:
                if skill := attack["measured"].get("skill"):
                    skill[skill.index(min(skill))] = None

    def other_attack(data: Any) -> None:
        data["processor"] = "another"
        for cell in data["cells"]:
            worst = next(one for one in cell["attacks"] if one["measured"])
            for other in cell["attacks"]:
                if other is not worst:
                    ones = {name: [1.0] * len(v) for name, v in worst["measured"].items()}
                    other["measured"], worst["measured"] = ones, {}
                    break

    for change in (without_the_worst, other_attack):
        found = replay_entry(changed(entry, change), SUITE, cells, pool)
        assert not any(check.ok for check in found)


@pytest.mark.parametrize(
    ("field", "value", "subject"),
    [
        ("version", "9.9", "suite"),
        ("suite", "another", "suite"),
        ("search", {"candidates": 1, "games": 1, "starts": 1}, "budget of searches"),
    ],
)
def test_what_an_entry_says_of_itself_is_compared(
    entry: Entry, field: str, value: Any, subject: str
) -> None:
    def said(data: Any) -> None:
        data[field] = value

    assert not verdicts(changed(entry, said))[subject]


def test_a_cell_that_the_suite_has_not_is_found(entry: Entry) -> None:
    def further(data: Any) -> None:
        data["cells"].append({**data["cells"][0], "setting": "nowhere"})

    assert not verdicts(changed(entry, further))["completeness"]


def test_a_higher_skill_than_in_other_worlds_is_found(entry: Entry) -> None:
    def memorised(data: Any) -> None:
        for cell in data["cells"]:
            for attack in cell["attacks"]:
                if attack["measured"]:
                    attack["measured"]["skill"] = [0.97, 0.98, 0.99]

    worlds = SUITE.worlds.model_copy(update={"seed": 5, "measured": 12})
    other = SUITE.model_copy(update={"worlds": worlds})
    for claim, true in ((entry, True), (changed(entry, memorised), False)):
        assert check_fresh_worlds(claim, other, LocalPool(1, keep=True)).ok == true


def test_all_replayed_attacks_of_a_suite_must_be_met(entry: Entry) -> None:
    def replaced(data: Any) -> None:
        for cell in data["cells"]:
            for attack in cell["attacks"]:
                attack["attack"] = attack["attack"].replace("seen", "unseen")

    def other_record(data: Any) -> None:
        for cell in data["cells"]:
            for attack in cell["attacks"]:
                attack["record"] = record_of(AgreedScripts())

    assert not verdicts(changed(entry, replaced))["completeness"]
    assert not verdicts(changed(entry, other_record))["completeness"]
    recorded = records_of(changed(entry, other_record))
    assert {cell.method for cell in recorded} == {"search"}


def test_damaged_files_are_refused(tmp_path: Path, entry: Entry) -> None:
    data = json.loads(entry.model_dump_json())
    for name, value in (("format", 5), ("cells", 3), ("model", "a/b"), ("extra", 1)):
        path = tmp_path / "entry.json"
        path.write_text(json.dumps({**data, name: value}))
        with refuses(ValueError, "entry.json", name):
            read_entry(path)


def test_cells_that_are_missing_or_there_twice_and_another_seed_are_found(entry: Entry) -> None:
    def only_honest(data: Any) -> None:
        data["cells"] = [cell for cell in data["cells"] if cell["method"] == "honest"]

    def doubled(data: Any) -> None:
        data["cells"].append(data["cells"][0])

    def other_seed(data: Any) -> None:
        data["seed"] = 77

    for change, subject in (
        (only_honest, "completeness"),
        (doubled, "completeness"),
        (other_seed, "suite"),
    ):
        wrong = [name for name, ok in verdicts(changed(entry, change)).items() if not ok]
        assert wrong == [subject]


@pytest.mark.parametrize("name", ["somewhere.attacks:Evil", "learned:path=/etc/passwd"])
def test_records_name_neither_foreign_modules_nor_files(name: str) -> None:
    with refuses(ValueError, name):
        check_recorded([record_of(AgreedScripts(("rank-lies",))), SEEN.record, _record(name)])
    assert "somewhere" not in sys.modules


def _record(name: str) -> str:
    return json.dumps({"kind": "agreed-scripts", "attacks": [name]})


def test_a_source_is_the_same_under_other_comments_and_docstrings() -> None:
    one = b'"""A."""\nX = 1  # one\n\nclass C:\n    """B."""\n    y = lambda: 2\n'
    same = b"X = 1\nclass C:\n  y = lambda : 2"
    other = b"X = 1\nclass C:\n  y = lambda : 3"
    assert _code(one) == _code(same) != _code(other)
