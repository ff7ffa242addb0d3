"""The answers in the documentation are those that the command gives."""

import re
from pathlib import Path

from experiments.findings.questions import QUESTIONS

HOUSE = Path(__file__).parents[3]
PAGE = (HOUSE / "docs/findings.md").read_text(encoding="utf-8")


def test_the_page_is_that_of_one_default_run():
    asked = re.findall(r"^    roletrust findings --question (\S+) --games 48 --seed 0$", PAGE, flags=re.MULTILINE)
    assert len(asked) == PAGE.count("\n## ")
    assert set(asked) == set(QUESTIONS)


def test_every_answer_has_its_picture():
    pictures = re.findall(r"\]\((findings/.*)\)", PAGE)
    assert len(pictures) == PAGE.count("\n## ")
    assert all((HOUSE / "docs" / picture).exists() for picture in pictures)


def test_the_readme_has_no_number_that_the_page_has_not():
    readme = (HOUSE / "README.md").read_text(encoding="utf-8")
    found = re.search(r"## The paper, answered\n(.*?)\n## ", readme, flags=re.DOTALL)
    assert found is not None
    numbers = re.findall(r"\d+\.\d+|\d+%", found[1])
    assert numbers
    assert [number for number in numbers if number not in PAGE] == []
