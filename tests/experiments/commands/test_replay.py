"""`roletrust replay`: the games of a benchmark again, against the file of the run."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from command_line import printed
from refusals import assert_names, refuses
from small_suites import small

from roletrust_env.benchmarking.cells import find_attack, play_cell
from roletrust_env.benchmarking.leaderboard import Leaderboard
from roletrust_env.benchmarking.store import ResultStore
from roletrust_env.evaluation.measurement import watch
from roletrust_experiments.playing.replay import Replay

SUITE = small(
    models=["mean", "role-trust"],
    attacks=["bad-mouthing", "random-rating", "on-off", "sybil"],
    methods=["scripted", "random search"],
    budget=3000,
    seeds=[3],
)
PROVIDERS = {"providers": {"roles": ["SP"], "shares": [0.3]}}


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("replay") / "results.sqlite"
    with ResultStore(path, SUITE) as store:
        for cell in SUITE.cells():
            store.add(cell, play_cell(SUITE, cell))
    return path


def test_every_attack_has_the_utility_of_the_file_again(file: Path) -> None:
    with ResultStore(file) as store:
        stored = store.all()
    played = 0
    for cell, result in stored:
        for row in result.rows if cell.track != "honest" else ():
            assert bool(row.record) == (cell.method != "scripted")
            for record in {"", row.record}:  # searched again, and as recorded
                found = Replay.of(SUITE, cell, row.attack, record)
                assert found.score == pytest.approx(
                    np.array(row.measured["utility"], float), nan_ok=True
                )
                played += 1
    assert played > 6


def test_the_states_are_those_of_the_game_that_was_measured() -> None:
    cell = next(
        cell
        for cell in SUITE.cells()
        if cell.method == "random search" and cell.model == "role-trust"
    )
    found = Replay.of(SUITE, cell, "random search")
    whole = watch(
        found.attack_found.task, found.attack_found.batch.attacker, cell.seed, (1, 2 * SUITE.games)
    )
    for game in (0, SUITE.games - 1):
        *_, last = found.states(game)
        trust = found.attack_found.task.game.agent_trust(last)
        assert trust == pytest.approx(whole.trust[-1, :, 0, SUITE.games + game])


def test_believed_is_the_share_of_rounds_in_which_an_accomplice_is_on_top() -> None:
    suite = small(models=["constant"], attacks=["on-off"], methods=["scripted"], tracks=PROVIDERS)
    (cell,) = suite.cells()
    found = Replay.of(suite, cell, "on-off")
    roster = found.attack_found.task.game.roster
    mine = sum(name in found.attack_found.task.identities for name in roster.provider_names)
    assert found.believed == pytest.approx(mine / roster.n_providers)  # all are trusted alike
    assert [side.label for side in found.sides] == [
        "honest raters",
        "honest providers",
        "providers of the attacker",
    ]


def test_the_command_plays_the_worst_case_of_the_leaderboard(file: Path, tmp_path: Path) -> None:
    with ResultStore(file) as store:
        board = Leaderboard.of(SUITE, store.all())
    row = next(row for row in board.rows if row.model == "mean")
    made = printed("replay", file, "--model", "mean", "--video", "--out", tmp_path)
    assert f"mean, {row.worst_condition}" in made
    assert row.worst_attack in made
    assert "The file has" not in made
    assert {path.name for path in tmp_path.iterdir()} == {"replay.png", "game.mp4", "game.png"}


def test_names_are_neither_markup_nor_formulas(tmp_path: Path, drawn: None) -> None:
    track = "liars $_$ [red]"
    suite = small(
        models=["mean"],
        attacks=["bad-mouthing"],
        tracks={track: {"roles": ["SR"], "shares": [0.5]}},
    )
    with ResultStore(tmp_path / "results.sqlite", suite) as store:
        for cell in suite.cells():
            store.add(cell, play_cell(suite, cell))
    out = tmp_path / "out [red]"
    made = printed("replay", tmp_path / "results.sqlite", "--out", out)
    assert f"mean, market, {track} 50%" in made
    assert f"Written to {out}: replay.png" in made
    assert (out / "replay.png").stat().st_size > 5000


def test_a_file_with_other_numbers_is_reported(file: Path, tmp_path: Path) -> None:
    other = tmp_path / "results.sqlite"
    other.write_bytes(file.read_bytes())
    with sqlite3.connect(other) as connection:
        connection.execute("UPDATE attacks SET measured = replace(measured, '0.', '0.0')")
    made = printed("replay", other, "--model", "mean", "--out", tmp_path / "out")
    assert "The file has a utility of 0.0" in made


def test_what_cannot_be_played_again_is_refused(file: Path, tmp_path: Path) -> None:
    scripted = next(cell for cell in SUITE.cells() if cell.method == "scripted")
    for arguments, words in (
        (["--model", "means"], ("means",)),
        (["--cell", scripted.key.replace("scripted", "PPO")], ("mean|market|raters|0.25|PPO|3",)),
        (["--cell", scripted.key, "--attack", "bad-mouth"], ("bad-mouthing",)),
        (["--attack", "bad-mouthing"], ("--attack", "--cell")),
        (["--cell", scripted.key, "--model", "mean"], ("--cell", "--model")),
    ):
        made = printed("replay", file, *arguments, "--out", tmp_path, code=2)
        assert_names(made, *words)
    honest = next(cell for cell in SUITE.cells() if cell.track == "honest")
    with refuses(ValueError, "mean|market|honest|0.0|nobody|3"):
        find_attack(SUITE, honest, "nobody")
    with refuses(ValueError, "nothing", "bad-mouthing"):
        find_attack(SUITE, scripted, "nothing")
