"""Known attacks: they play as they were found, in a suite of their own or of others, and bad files
are refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmark_cases import results, tiny
from refusals import refuses

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.deep_set import DeepSet, DeepSetArchitecture, random_weights
from roletrust_agents.training.universal import universal_coalitions
from roletrust_env.benchmarking import Leaderboard, load_suite
from roletrust_env.benchmarking.cells import find_attack, play_cell
from roletrust_env.benchmarking.known_attacks import (
    KnownAttack,
    KnownAttacks,
    check_records,
    merge_attacks,
    read_known_attacks,
)
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.submission import make_entries
from roletrust_env.benchmarking.suite import with_known
from roletrust_env.benchmarking.worst_case import worst_cases
from roletrust_env.evaluation.attackers import record_of

SUITE = tiny(methods=["scripted", "random search"], budget=2000)


def play(suite: Any) -> list[StoredCell]:
    return [StoredCell(cell, play_cell(suite, cell)) for cell in suite.cells()]


@pytest.fixture(scope="module")
def stored() -> list[StoredCell]:
    return play(SUITE)


@pytest.fixture(scope="module")
def found(stored: list[StoredCell]) -> KnownAttacks:
    entries, lost = make_entries(SUITE, stored, finder="A. Author")
    assert lost == []
    return entries


def test_there_is_the_worst_attack_on_each_model_in_each_condition(
    found: KnownAttacks, stored: list[StoredCell]
) -> None:
    cases = worst_cases(Leaderboard.of(SUITE, stored).attacks)
    attacked = {key: case.attack for key, case in cases.items() if key[1].track == "raters"}
    worst = {
        (f"{attack} against {model}", tuple(where)) for (model, where), attack in attacked.items()
    }
    named = {(one.name, one.condition) for one in found.attacks}
    assert named <= worst
    assert (
        len({(one.record, one.condition) for one in found.attacks})
        == len(found.attacks)
        == len(named)
    )
    left_out = [name.rpartition(" against ")[0] for name, _ in worst - named]
    assert all(
        "random search" not in attack for attack in left_out
    )  # scripts only, listed for another model


def test_a_known_attack_scores_as_in_the_run_that_found_it(
    found: KnownAttacks, stored: list[StoredCell]
) -> None:
    again = {
        cell.key: result
        for cell, result in play(with_known(SUITE, found.attacks))
        if cell.method == "known"
    }
    compared = 0
    for cell, result in stored:
        if cell.method != "random search":  # scripts side by side share their random numbers
            continue
        (row,) = result.rows
        for theirs in again[cell._replace(method="known").key].rows:
            assert theirs.words == "known attack, found by A. Author"
            if theirs.attack == f"random search against {cell.model}":
                assert (theirs.chosen, theirs.measured) == (row.chosen, row.measured)
                compared += 1
    assert compared


def test_attacks_on_other_models_count_in_the_worst_case(found: KnownAttacks) -> None:
    suite = with_known(tiny(models=["mean"], methods=["scripted"]), found.attacks)
    board = Leaderboard.of(suite, play(suite))
    names = {one.attack for one in board.attacks if one.method == "known"}
    assert any(name.endswith("against role-trust") for name in names)
    assert any(case.common.method == "known" for case in worst_cases(board.attacks).values())
    assert board.rows[0].worst_attack in {one.attack for one in board.attacks}
    ensemble = Leaderboard.of(suite, [one for one in board.cells if one.cell.method != "known"])
    assert board.rows[0].ensemble.mean == ensemble.rows[0].worst.mean != board.rows[0].worst.mean
    assert "ensemble" in board.columns
    assert "ensemble" in repr(board)
    assert (
        "ensemble"
        not in Leaderboard.of(SUITE, play(tiny(models=["mean"], methods=["scripted"]))).columns
    )


def test_two_runs_may_find_attacks_of_the_same_name(found: KnownAttacks) -> None:
    """Attacks of an earlier run, here those with another seed, count beside those of this one."""
    other = tiny(methods=["random search"], budget=2000, seeds=[7])
    earlier, _ = make_entries(other, play(other))
    suite = with_known(tiny(methods=["random search"], budget=2000), earlier.attacks)
    entries, _ = make_entries(suite, play(suite))
    KnownAttacks(attacks=entries.attacks)  # no two have the same name in a condition


def test_evolution_starts_from_known_coalitions() -> None:
    tracks = {"raters": {"roles": ["SR"], "shares": [0.5]}}
    suite = tiny(models=["median"], methods=["evolution:wide=false"], budget=20_000, tracks=tracks)
    (cell,) = suite.cells()
    (first,) = play_cell(suite, cell).rows
    place = {"scenario": cell.scenario, "track": cell.track, "share": cell.share}
    scripts = tiny(models=["mean"], methods=["scripted"], tracks=tracks)
    (script,) = make_entries(scripts, play(scripts))[0].attacks
    known = [KnownAttack(name="mine", record=first.record, **place), script]
    larger = with_known(suite, known)
    (again,) = play_cell(larger, cell).rows
    assert again.progress[0][1] == pytest.approx(
        first.progress[-1][1]
    )  # the best of the first search
    assert again.progress[-1][1] >= first.progress[-1][1] > first.progress[0][1]
    assert larger.rules(cell) != suite.rules(cell)
    scripted = cell._replace(method="scripted")
    assert larger.rules(scripted) == suite.rules(scripted)


def test_coalitions_play_side_by_side_as_they_do_alone() -> None:
    tracks = {"all": {"roles": ["SR", "SP"], "shares": [0.3], "reserve": 1}}
    place = {"scenario": "market", "track": "all", "share": 0.3}
    networks = list(universal_coalitions(wide=False).values())[:3]
    wide = DeepSetArchitecture(units=5)  # other networks cannot play beside it
    networks.insert(1, DeepSet.unflatten(wide, random_weights(wide, np.random.default_rng(0))))
    known = [
        KnownAttack(name=f"{k}", record=record_of(CoalitionAttacker(w)), **place)
        for k, w in enumerate(networks)
    ]
    suite = with_known(tiny(models=["qor"], methods=["scripted"], tracks=tracks), known)
    cell = next(cell for cell in suite.cells() if cell.method == "known")
    rows = {row.attack: row for row in play_cell(suite, cell).rows}
    assert list(rows) == ["0", "2", "3", "1"]
    assert find_attack(suite, cell, "2").rows == 3
    for one in known:
        (alone,) = play_cell(suite.model_copy(update={"known": (one,)}), cell).rows
        assert alone == rows[one.name]
    attacker = find_attack(suite, cell, "2").batch.split()
    assert [record_of(batch.attacker) for batch in attacker] == [known[k].record for k in (0, 2, 3)]


def test_a_script_with_parameters_is_recorded_with_them() -> None:
    spec = "bad-mouthing:level=0.25,start=2"
    suite = tiny(
        models=["mean"],
        methods=["scripted"],
        attacks=[spec],
        tracks={"raters": {"roles": ["SR"], "shares": [0.3]}},
    )
    entries, _ = make_entries(suite, play(suite))
    (one,) = entries.attacks
    assert one.name == f"{spec} against mean"
    assert '"start":2' in one.record
    assert '"level":0.25' in one.record


def test_replay_finds_a_known_attack(found: KnownAttacks) -> None:
    suite = with_known(SUITE, found.attacks)
    cell = next(cell for cell in suite.cells() if cell.method == "known")
    name = next(one.name for one in found.attacks if one.condition == cell[1:4])
    assert find_attack(suite, cell, name).batch.names == (name,)


def test_a_known_attack_that_cannot_play_harms_no_other(found: KnownAttacks) -> None:
    record = json.dumps({"kind": "scripts", "policies": {"nobody_7": {"name": "bad-mouthing"}}})
    wrong = found.attacks[0].model_copy(update={"name": "wrong", "record": record})
    suite = with_known(tiny(models=["mean"], methods=["scripted"]), [wrong, *found.attacks])
    cell = next(
        cell for cell in suite.cells() if cell.method == "known" and cell[1:4] == wrong.condition
    )
    result = play_cell(suite, cell)
    assert result.rows
    assert result.failed.startswith("attack wrong: ")


def test_the_worst_attacks_of_a_run_with_known_ones_are_these(found: KnownAttacks) -> None:
    suite = with_known(
        tiny(models=["mean"], methods=["scripted"], attacks=["random-rating"]), found.attacks
    )
    again, lost = make_entries(suite, play(suite))
    assert lost == []
    assert set(again.attacks) & set(found.attacks)


def test_names_that_harm_terminals_or_files_are_refused() -> None:
    with refuses(ValueError, "name", "a/b"):
        KnownAttack(**ONE | {"name": "a/b"})
    with refuses(ValueError, "finder"):
        KnownAttack(**ONE, finder="a\x1b[31m")


def test_a_condition_without_known_attacks_is_said(
    found: KnownAttacks, stored: list[StoredCell]
) -> None:
    few = [one for one in found.attacks if one.share == 0.3]
    played = play(with_known(SUITE, few))
    by_share = {cell.share: result for cell, result in played if cell.method == "known"}
    assert by_share[0.3].rows
    assert by_share[0.5].unsuitable == "there is no known attack for this condition"
    assert results(stored).items() <= results(played).items()  # the other cells stay as they are


def test_a_suite_reads_them_from_the_file_beside_it(found: KnownAttacks, tmp_path: Path) -> None:
    (tmp_path / "mine.json").write_text(found.model_dump_json())
    text = """
        methods = ["known"]
        known = "mine.json"
        models = ["mean"]
        [scenarios.market]
        preset = "market"
        [tracks.raters]
        roles = ["SR"]
        shares = [0.3, 0.5]
    """
    (tmp_path / "suite.toml").write_text(text)
    assert load_suite(tmp_path / "suite.toml").known == found.attacks  # type: ignore[union-attr]
    (tmp_path / "mine.json").unlink()
    with refuses(ValueError, "--attacks"):
        load_suite(tmp_path / "suite.toml")
    (tmp_path / "mine.json").mkdir()
    with refuses(ValueError, "mine.json"):
        load_suite(tmp_path / "suite.toml")
    with refuses(ValueError, "path"):
        read_known_attacks(Path("x" * 300))


def test_several_lists_are_one_and_a_suite_reads_several_files(
    found: KnownAttacks, tmp_path: Path
) -> None:
    one = found.attacks[0]
    namesake = one.model_copy(update={"record": "{}", "finder": "B. Author"})
    both = merge_attacks([one], [namesake, one])
    assert both == (one, namesake.model_copy(update={"name": f"{one.name} (2)"}))
    (tmp_path / "mine.json").write_text(found.model_dump_json())
    (tmp_path / "yours.json").write_text(KnownAttacks(attacks=(namesake,)).model_dump_json())
    text = """
        methods = ["known"]
        known = ["mine.json", "yours.json"]
        [scenarios.market]
        preset = "market"
        [tracks.raters]
        roles = ["SR"]
        shares = [0.3, 0.5]
    """
    (tmp_path / "suite.toml").write_text(text)
    assert load_suite(tmp_path / "suite.toml").known == (*found.attacks, both[1])  # type: ignore[union-attr]


ONE = {"name": "mine", "scenario": "market", "track": "raters", "share": 0.3, "record": "{}"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ("attacks.json", "JSON")),
        ("[]", ("attacks.json",)),
        ('{"attacks": []}', ("attacks", "[]")),
        (json.dumps({"attacks": [ONE, ONE]}), ("mine", "market", "30")),
        (json.dumps({"attacks": [ONE | {"share": 1.5}]}), ("share", "1.5")),
        (json.dumps({"attacks": [ONE | {"name": "a|b"}]}), ("attacks.0.name", "a|b")),
        (json.dumps({"attacks": [ONE | {"more": 1}]}), ("attacks.0.more", "1")),
        (json.dumps({"format": "other", "attacks": [ONE]}), ("format", "other")),
        (json.dumps({"format_version": 2, "attacks": [ONE]}), ("format_version", "2")),
        ('{"attacks": NaN}', ("NaN",)),
    ],
)
def test_a_bad_file_is_one_line(tmp_path: Path, text: str, words: tuple[str, ...]) -> None:
    (tmp_path / "attacks.json").write_text(text)
    with refuses(ValueError, *words):
        read_known_attacks(tmp_path / "attacks.json")


def test_attacks_that_no_suite_can_play_are_refused() -> None:
    one = KnownAttack(**ONE)
    with refuses(ValueError, "1", "tiny"):
        with_known(SUITE, [one.model_copy(update={"track": "others"})])
    assert with_known(with_known(SUITE, [one]), [one]).known == (one,)
    with refuses(ValueError, "known"):
        tiny(known=[ONE])
    with refuses(ValueError, "known"):
        tiny(methods=["known"])
    with refuses(ValueError, "on-off"):
        tiny(methods=["known"], known=[ONE | {"name": "on-off"}])
    with refuses(ValueError, "mine"):
        check_records([one])
    with refuses(ValueError, "mine", "market", "0.4"):
        tiny(methods=["known"], known=[ONE | {"share": 0.4}])
    with refuses(ValueError, "men", "mean"):
        make_entries(SUITE, [], ["men"])
    with refuses(ValueError):
        make_entries(SUITE, [])
