"""The study of findings answers all questions in their smallest form."""

import csv
import json

import pytest

from studies.findings import QUESTIONS, main

pytestmark = pytest.mark.slow


def test_every_question_has_a_sentence_a_figure_a_table_and_a_command(tmp_path, capsys):
    main(["--quick", "--games", "3", "--out", str(tmp_path)])
    kept = json.loads((tmp_path / "runs.json").read_text())["runs"]
    text = (tmp_path / "findings.md").read_text()
    assert set(kept) == set(QUESTIONS)
    for name, one in kept.items():
        command = f"python -m studies.findings --question {name} --games 3 --seed 0 --quick"
        assert f"](findings/{name}.png)\n\n{one['sentence']}\n\n    {command}\n" in text
        assert (tmp_path / "findings" / f"{name}.png").stat().st_size > 10_000
        with (tmp_path / "findings" / f"{name}.csv").open() as file:
            rows = list(csv.DictReader(file))
        assert rows
        assert all(float(row["low"]) <= float(row["value"]) <= float(row["high"]) for row in rows)
    main(["--quick", "--games", "3", "--question", "noise", "--out", str(tmp_path / "again")])
    again = json.loads((tmp_path / "again" / "runs.json").read_text())["runs"]
    assert again["noise"] == kept["noise"]
    with pytest.raises(SystemExit):
        main(["--question", "nose", "--out", str(tmp_path / "none")])
    assert "questions are roles, dilution" in capsys.readouterr().err
