"""The answers in the documentation are those that the command gives."""

import re
from pathlib import Path

from experiments.findings.questions import QUESTIONS

HOUSE = Path(__file__).parents[3]
PAGE = (HOUSE / "docs/findings.md").read_text(encoding="utf-8")


def test_every_question_is_answered_with_a_picture():
    for name in QUESTIONS:
        assert f"](findings/{name}.png)" in PAGE
        assert (HOUSE / f"docs/findings/{name}.png").exists()


def test_the_page_is_that_of_one_default_run():
    commands = re.findall(r"^    (roletrust .*)$", PAGE, flags=re.MULTILINE)
    assert commands == [f"roletrust findings --question {name} --games 48 --seed 0" for name in QUESTIONS]


def test_the_readme_has_no_number_that_the_page_has_not():
    readme = (HOUSE / "README.md").read_text(encoding="utf-8")
    found = re.search(r"## The paper, answered\n(.*?)\n## ", readme, flags=re.DOTALL)
    assert found is not None
    numbers = re.findall(r"\d+\.\d+|\d+%", found[1])
    assert numbers
    assert [number for number in numbers if number not in PAGE] == []
