"""The study of findings answers all questions in their smallest form, and the documentation has its
answers."""

import json
import re
from pathlib import Path

import pytest
from csv_files import csv_rows
from refusals import assert_names

from studies.findings import QUESTIONS
from studies.study import run

pytestmark = pytest.mark.slow

HOUSE = Path(__file__).parents[2]
PAGE = (HOUSE / "docs/findings.md").read_text(encoding="utf-8")


def test_every_question_has_a_sentence_a_figure_a_table_and_a_command(tmp_path, capsys):
    run("studies.findings", ["--quick", "--games", "3", "--out", str(tmp_path)])
    kept = json.loads((tmp_path / "runs.json").read_text())["runs"]
    text = (tmp_path / "findings.md").read_text()
    assert set(kept) == set(QUESTIONS)
    for name, one in kept.items():
        command = f"python -m studies findings --question {name} --games 3 --seed 0 --quick"
        assert f"](findings/{name}.png)\n\n{one['sentence']}\n\n    {command}\n" in text
        assert (tmp_path / "findings" / f"{name}.png").stat().st_size > 10_000
        rows = csv_rows(tmp_path / "findings" / f"{name}.csv")
        assert rows
        assert all(float(row["low"]) <= float(row["value"]) <= float(row["high"]) for row in rows)
    run(
        "studies.findings",
        ["--quick", "--games", "3", "--question", "noise", "--out", str(tmp_path / "again")],
    )
    again = json.loads((tmp_path / "again" / "runs.json").read_text())["runs"]
    assert again["noise"] == kept["noise"]
    with pytest.raises(SystemExit):
        run("studies.findings", ["--question", "nose", "--out", str(tmp_path / "none")])
    assert_names(capsys.readouterr().err, "noise", "dilution")


def test_the_page_is_that_of_one_default_run():
    asked = re.findall(
        r"^    python -m studies findings --question (\S+) --games 48 --seed 0$",
        PAGE,
        flags=re.MULTILINE,
    )
    assert len(asked) == PAGE.count("\n## ")
    assert set(asked) == set(QUESTIONS)


def test_every_answer_has_its_picture():
    pictures = re.findall(r"\]\((findings/.*)\)", PAGE)
    assert len(pictures) == PAGE.count("\n## ")
    assert all((HOUSE / "docs" / picture).exists() for picture in pictures)
