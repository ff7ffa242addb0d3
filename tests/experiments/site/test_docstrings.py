"""How docstrings become reStructuredText."""

import pytest

from roletrust_env import Game
from roletrust_env.metrics import damage
from roletrust_env.trust.models.personal.travos import Travos
from roletrust_experiments.site.docstrings import as_written, readable


def read(text):
    lines = text.splitlines()
    readable(None, "class", "it", None, None, lines)
    return lines


def test_what_is_indented_after_an_empty_line_is_a_formula():
    text = "A mean:\n\n    x = 1\n\n    y = 2\n\nAnd more\n\n    z = 3"
    found = ["A mean:", "", "::", "", "    x = 1", "", "    y = 2", "", "And more", "", "::", "", "    z = 3"]
    assert read(text) == found


def test_sections_are_left_alone():
    text = "It does.\n\nArgs:\n    one: a number.\n\n    two: another.\n\nReturns:\n    What it is."
    assert read(text) == text.splitlines()


def test_attributes_of_data_are_parameters():
    lines = ["Attributes:", "    error: how far."]
    readable(None, "class", "it", Travos, None, lines)
    assert lines[0] == "Args:"
    readable(None, "class", "it", Game, None, lines := ["Attributes:", "    model: a model."])
    assert lines[0] == "Attributes:"


def test_of_a_page_in_markdown_the_first_paragraph_stays():
    assert read("A game.\n\n## Description\n\nLong.") == ["A game.", ""]


@pytest.mark.parametrize(
    ("what", "thing", "signature"),
    [
        ("function", damage, ("(trust: Floats, paired: Floats, agents: Sequence[int])", "Score")),
        ("class", Travos, ("(error=0.2, threshold=0.95, bins=5)", "")),
        ("method", Game.published, ("(state: State)", "tuple[Array, Array]")),
        ("attribute", 3, None),
    ],
)
def test_signatures_are_short(what, thing, signature):
    assert as_written(None, what, "it", thing, None, "(...)", None) == signature
