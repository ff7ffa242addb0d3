"""The answers in the documentation are those that the command gives."""

import re
from pathlib import Path

import pytest

from studies.findings import QUESTIONS

pytestmark = pytest.mark.slow

HOUSE = Path(__file__).parents[2]
PAGE = (HOUSE / "docs/findings.md").read_text(encoding="utf-8")


def test_the_page_is_that_of_one_default_run():
    asked = re.findall(
        r"^    python -m studies.findings --question (\S+) --games 48 --seed 0$", PAGE, flags=re.MULTILINE
    )
    assert len(asked) == PAGE.count("\n## ")
    assert set(asked) == set(QUESTIONS)


def test_every_answer_has_its_picture():
    pictures = re.findall(r"\]\((findings/.*)\)", PAGE)
    assert len(pictures) == PAGE.count("\n## ")
    assert all((HOUSE / "docs" / picture).exists() for picture in pictures)
