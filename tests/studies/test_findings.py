"""`python -m studies.findings` answers, keeps its answers and goes on with them."""

import csv
import json

import pytest

pytest.importorskip("cma")
pytest.importorskip("stable_baselines3")

from study_line import app
from typer.testing import CliRunner

from studies.findings.questions import QUESTIONS

pytestmark = pytest.mark.slow

QUICK = ["--quick", "--games", "3"]


def run(out, *arguments):
    return CliRunner().invoke(app, ["findings", *QUICK, *arguments, "--out", str(out)])


@pytest.fixture(scope="module")
def answered(tmp_path_factory):
    """A folder with an answer to every question."""
    out = tmp_path_factory.mktemp("answers") / "new"
    result = run(out)
    assert result.exit_code == 0, result.output
    return out, result.output


def test_every_question_has_a_sentence_a_figure_a_table_and_a_command(answered):
    out, said = answered
    kept = json.loads((out / "findings.json").read_text())["questions"]
    text = (out / "findings.md").read_text()
    assert list(kept) == list(QUESTIONS)
    for name, one in kept.items():
        assert one["sentence"] in said
        assert f"\n{one['sentence']}\n" in text
        assert (
            f"](findings/{name}.png)\n\n"
            f"    python -m studies.findings --question {name} --games 3 --seed 0 --quick\n" in text
        )
        assert (out / "findings" / f"{name}.png").stat().st_size > 10_000
        with (out / "findings" / f"{name}.csv").open() as file:
            rows = list(csv.DictReader(file))
        assert rows
        assert all(float(row["low"]) <= float(row["value"]) <= float(row["high"]) for row in rows)
        assert one["differences"]
        assert one["made_with"]["packages"]["numpy"]
        assert one["settings"]["scenario" if "scenario" in one["settings"] else "scenarios"]


def test_answers_are_the_same_again_and_are_not_measured_again(answered, tmp_path, monkeypatch):
    out, _ = answered
    again = run(tmp_path, "--question", "noise", "--question", "both-roles")
    assert again.exit_code == 0, again.output
    first, second = (json.loads((folder / "findings.json").read_text())["questions"] for folder in (out, tmp_path))
    assert second == {name: first[name] for name in ("noise", "both-roles")}
    for name in second:
        assert (out / f"findings/{name}.csv").read_bytes() == (tmp_path / f"findings/{name}.csv").read_bytes()
    played = []
    for name, answer in QUESTIONS.items():
        monkeypatch.setitem(
            QUESTIONS, name, lambda asked, name=name, answer=answer: played.append(name) or answer(asked)
        )
    assert run(tmp_path, "--question", "noise").exit_code == 0
    assert played == []
    assert run(tmp_path, "--question", "noise", "--question", "dilution").exit_code == 0
    assert played == ["dilution"]
    assert run(tmp_path, "--question", "noise", "--seed", "1").exit_code == 0
    assert run(tmp_path, "--question", "dilution", "--force").exit_code == 0
    assert played == ["dilution", "noise", "dilution"]
    text = (tmp_path / "findings.md").read_text()
    assert "--question noise --games 3 --seed 1 --quick" in text
    assert "--question dilution --games 3 --seed 0 --quick" in text


def test_an_answer_that_was_finished_outlives_one_that_fails(tmp_path, monkeypatch):
    def fails(asked):
        raise ValueError("no luck")

    monkeypatch.setitem(QUESTIONS, "both-roles", fails)
    result = run(tmp_path, "--question", "noise", "--question", "both-roles")
    assert result.exit_code == 2
    assert list(json.loads((tmp_path / "findings.json").read_text())["questions"]) == ["noise"]


def test_an_unknown_question_is_named_before_anything_is_written(tmp_path):
    result = run(tmp_path / "new", "--question", "nois")
    assert result.exit_code == 2
    assert "unknown question 'nois'; did you mean 'noise'? Known: roles, dilution" in result.output
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("text", ["", "[]", '{"questions": 3}', '{"questions": {"noise": 3}}'])
def test_a_file_of_another_kind_is_left_alone(tmp_path, text):
    (tmp_path / "findings.json").write_text(text)
    result = run(tmp_path, "--question", "noise")
    assert result.exit_code == 2
    assert "holds no findings" in result.output
    assert (tmp_path / "findings.json").read_text() == text
