"""`roletrust replay`: the games of a benchmark again, against the file of the run."""

import sqlite3
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import printed
from refusals import assert_names, refuses
from report_run import SUITE, random_cells, small_suite, write_run

from roletrust_env.benchmarking.leaderboard import Leaderboard
from roletrust_env.benchmarking.replay import Replay, replay
from roletrust_env.evaluation.agreed import AgreedScripts
from roletrust_env.evaluation.attackers import record_of


def replayed(folder: Path, model: str, rule: str, setting: str, world: int) -> Replay:
    file = folder / "results.sqlite"
    return replay(file, model=model, rule=rule, setting=setting, world=world)


def test_every_worst_case_has_the_scores_of_the_file_again(folder: Path) -> None:
    cases = Leaderboard.read(folder / "results.sqlite").worst_cases
    attacked = {key: case for key, case in cases.items() if SUITE.settings[key[2]].roles}
    assert len(attacked) == 18
    for (model, rule, setting), case in attacked.items():
        for world in range(3):
            found = replayed(folder, model, rule, setting, world)
            assert found.attacked.skill == pytest.approx(case.scores["skill"][world], abs=1e-9)
            # one service for each consumer in each round, so that all rounds count alike
            share = case.scores["attacker_share"][world]
            assert np.nan_to_num(found.attacked.from_attacker.mean()) == pytest.approx(
                np.nan_to_num(share)
            )


def test_honest_games_are_those_of_honest_play(folder: Path) -> None:
    found = replayed(folder, "mean", "common", "raters", 1)
    game, consumers = found.task.game, len(found.task.game.roster.rater_names)
    assert found.attacked.skill < found.honest.skill
    assert found.honest.received.mean() > found.attacked.received.mean()
    assert found.honest.received.shape == (game.scenario.max_cycles, SUITE.games)
    assert consumers > 0


def test_the_states_are_those_of_the_game_that_was_measured(folder: Path) -> None:
    found = replayed(folder, "block", "common", "coalition", 0)
    game, identities = found.task.game, found.task.identities
    honest = [name for name in game.roster.rater_names if name not in identities]
    places = [game.roster.names.index(name) for name in honest]
    (side,) = [side for side in found.attacked.sides if side.label == "honest raters"]
    for number in range(SUITE.games):
        *_, last = found.states(number)
        trust = np.asarray(game.agent_trust(last))[places]
        assert side.trust[-1, number] == pytest.approx(trust.mean())


def test_sides_are_those_of_the_setting_and_the_trust_model(folder: Path) -> None:
    def sides(model: str, setting: str) -> list[tuple[bool, bool]]:
        found = replayed(folder, model, "common", setting, 0)
        return [(side.rates, side.attacks) for side in found.attacked.sides]

    raters, providers = [(True, False), (True, True)], [(False, False), (False, True)]
    assert sides("block", "coalition") == raters + providers
    assert sides("block", "raters") == [*raters, (False, False)]
    assert sides("mean", "raters") == [(False, False)]


@pytest.mark.parametrize("rule", ["common", "own"])
def test_the_command_plays_the_worst_setting_of_the_first_model(
    folder: Path, tmp_path: Path, rule: str
) -> None:
    file = folder / "results.sqlite"
    row = next(row for row in Leaderboard.read(file).rows if row.rule == rule)
    case = Leaderboard.read(file).worst_cases[row.model, row.rule, row.worst_setting]
    made = printed("replay", file, "--rule", rule, "--out", tmp_path)
    for word in (row.model, row.worst_setting, case.attack, f"{case.scores['skill'].min():.3f}"):
        assert word in made
    assert "version" not in made
    assert [path.name for path in tmp_path.iterdir()] == ["replay.png"]


def test_a_video_shows_a_game(folder: Path, tmp_path: Path) -> None:
    options = "--model", "mean", "--setting", "raters", "--video"
    made = printed("replay", folder / "results.sqlite", *options, "--out", tmp_path)
    skill = (
        Leaderboard.read(folder / "results.sqlite").worst_cases["mean", "common", "raters"].scores
    )
    assert f"{skill['skill'].min():.3f}" in made
    assert {path.name for path in tmp_path.iterdir()} == {"replay.png", "game.mp4", "game.png"}


def test_names_are_neither_markup_nor_formulas(tmp_path: Path, drawn: None) -> None:
    setting = "liars $_$ [red]"
    suite = small_suite(settings={setting: {"roles": ["SR"], "share": 0.5}})
    file = write_run(tmp_path / "results.sqlite", suite, random_cells(suite))
    out = tmp_path / "out [red]"
    made = printed("replay", file, "--out", out)
    assert setting in made
    assert str(out) in made
    assert (out / "replay.png").stat().st_size > 5000


def test_a_file_with_other_numbers_is_reported(folder: Path, tmp_path: Path) -> None:
    other = tmp_path / "results.sqlite"
    other.write_bytes((folder / "results.sqlite").read_bytes())
    with sqlite3.connect(other) as connection:
        connection.execute("UPDATE attacks SET measured = replace(measured, '0.', '0.0')")
    options = "--model", "mean", "--setting", "raters", "--out", tmp_path / "out"
    made = printed("replay", other, *options)
    found = replay(other, model="mean", setting="raters")
    assert not found.agrees
    for skill in (found.attacked.skill, found.case.scores["skill"][found.world]):
        assert f"{skill:.6f}" in made


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--model", "means"], ["means", "common"]),
        (["--model", "mean", "--rule", "own"], ["mean", "own"]),
        (["--setting", "clean"], ["clean", "raters-open"]),
    ],
)
def test_what_cannot_be_played_again_is_refused(
    folder: Path, tmp_path: Path, options: list[str], words: list[object]
) -> None:
    made = printed("replay", folder / "results.sqlite", *options, "--out", tmp_path / "out", code=2)
    assert_names(made, *words)
    assert not (tmp_path / "out").exists()


def test_a_world_that_was_not_measured_is_refused(folder: Path) -> None:
    with refuses(ValueError, "world", 3, 2):
        replay(folder / "results.sqlite", world=3)


def test_code_of_a_file_is_imported_on_demand_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether the file names it as a trust model or in the record of an attack."""
    model, attack = "outside_model:Model", "no_such_module:Attack"
    text = "from roletrust_env.trust.models import Mean\nclass Model(Mean): ...\n"
    (tmp_path / "outside_model.py").write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    settings = {"raters": SUITE.settings["raters"].model_dump()}
    named, suite = small_suite(models=[model], own=[], settings=settings), small_suite()
    record = record_of(AgreedScripts((attack,)))
    files = {
        model: write_run(tmp_path / "model.sqlite", named, random_cells(named)),
        attack: write_run(tmp_path / "attack.sqlite", suite, random_cells(suite, record)),
    }
    monkeypatch.delitem(sys.modules, "outside_model")
    for words, file in files.items():
        options = ["--model", model] if words == model else []
        made = printed("replay", file, *options, "--out", tmp_path / "out", code=2)
        assert_names(made, words, "--allow-code")
    assert "outside_model" not in sys.modules
    printed("replay", files[model], "--model", model, "--allow-code", "--out", tmp_path / "out")
    assert "outside_model" in sys.modules
