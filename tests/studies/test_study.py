"""The runner of studies, with a study of squares: its options, what it keeps, refuses and
publishes."""

import json
import sys
from typing import NamedTuple

import pytest
from refusals import assert_names

from roletrust_env.storage.files import write_json
from studies import study as runner
from studies.__main__ import main as command
from studies.study import Recipe, Study, run


class Options(NamedTuple):
    number: tuple[int, ...] = (2, 3)
    power: float = 2.0
    loud: bool = False


RECIPES = {
    "squares": Recipe(Options(), {"page.md": "a/squares.md"}),
    "cubes": Recipe(Options(power=3.0)),
}
PLAYED = []


def raised(number, power):
    PLAYED.append(number)
    if number == 13:
        raise ValueError("thirteen is refused")
    return {"value": number**power}


def main(one):
    jobs = {str(n): (n, one.options.power) for n in one.options.number}
    runs = one.play(raised, jobs, {"power": one.options.power})
    one.csv("numbers.csv", ("number", "value"), [(key, run["value"]) for key, run in runs.items()])
    one.page("page.md", "# Powers", "", f"Made by `{one.command}`.")


def study(tmp_path, *arguments):
    PLAYED.clear()
    words = [*map(str, arguments), "--workers", "1", "--out", str(tmp_path / "out")]
    run(__name__, words)
    return Study(sys.modules[__name__], words)


def test_options_are_those_of_the_recipe_and_of_the_command(tmp_path):
    assert study(tmp_path).options == Options()
    one = study(
        tmp_path,
        "cubes",
        "--number",
        5,
        "--number",
        2,
        "--number",
        5,
        "--loud",
        "--seed",
        4,
        "--force",
    )
    assert one.options == Options((5, 2), 3.0, True)
    assert one.command.endswith("cubes --number 5 --number 2 --loud --seed 4")
    about = json.loads((tmp_path / "out" / "study.json").read_text())
    assert about["options"] == {"number": [5, 2], "power": 3.0, "loud": True}
    assert "numpy" in about["packages"]
    assert (
        tmp_path / "out" / "numbers.csv"
    ).read_text() == "number,value\n5,125.000000\n2,8.000000\n"


def test_a_study_continues_and_a_failed_run_is_played_again(tmp_path, capsys):
    with pytest.raises(SystemExit) as stopped:
        study(tmp_path, "--number", 13, "--number", 2)
    assert stopped.value.code == 1
    assert_names(capsys.readouterr().err, "13", "thirteen")
    before = json.loads((tmp_path / "out" / "runs.json").read_text())
    assert before["runs"] == {"2": {"value": 4.0}}
    study(tmp_path, "--number", 3, "--number", 2)
    assert PLAYED == [3]
    assert list(json.loads((tmp_path / "out" / "runs.json").read_text())["runs"]) == ["2", "3"]
    study(tmp_path, "--force")
    assert PLAYED == [2, 3]


def test_other_settings_and_damaged_files_are_refused_in_one_line(tmp_path, capsys):
    study(tmp_path)
    for arguments, damage, words in (
        (["--power", 4], None, "other settings: power is 2.0 there and 4.0 here"),
        (["--seed", 5], None, "other settings: seed is 0 there and 5 here"),
        *(
            ([], text, "is damaged, or no file of runs")
            for text in ("{", "[]", '{"runs": {}}', '{"made_with": 1, "runs": {}}')
        ),
    ):
        if damage:
            (tmp_path / "out" / "runs.json").write_text(damage)
        with pytest.raises(SystemExit) as stopped:
            study(tmp_path, *arguments)
        assert stopped.value.code == 2
        line = capsys.readouterr().err
        assert words in line
        assert "give --force to begin again" in line
        assert len(line.splitlines()) == 1
        assert PLAYED == []


def test_an_interrupted_study_keeps_what_is_finished(tmp_path, monkeypatch, capsys):
    def write(path, content):
        write_json(path, content)
        raise KeyboardInterrupt

    monkeypatch.setattr(runner, "write_json", write)
    with pytest.raises(SystemExit) as stopped:
        study(tmp_path)
    assert stopped.value.code == 130
    assert "repeat the command to continue" in capsys.readouterr().err
    monkeypatch.undo()
    study(tmp_path)
    assert PLAYED == [3]


def test_published_files_are_copied_when_asked(tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "DOCS", tmp_path / "docs")
    study(tmp_path)
    assert not (tmp_path / "docs").exists()
    study(tmp_path, "--publish")
    assert (
        (tmp_path / "docs/a/squares.md").read_text().startswith("# Powers\n\nMade by `python -m ")
    )


def test_a_study_is_run_by_its_name(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["studies", "sybil"])
    with pytest.raises(SystemExit) as stopped:
        command()
    assert stopped.value.code == 2
    assert_names(capsys.readouterr().err, "sybil", "sybils")
    monkeypatch.setattr(sys, "argv", ["studies", "sybils", "--help"])
    with pytest.raises(SystemExit):
        command()
    assert capsys.readouterr().out.startswith("usage: python -m studies sybils ")
