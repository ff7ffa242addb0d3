"""Tables in Markdown, and names of others in them."""

import pytest
from small_suites import tiny

from roletrust_env.benchmarking.leaderboard import Leaderboard
from roletrust_env.storage.markdown import code, markdown_table, plain


def test_plain_leaves_ordinary_text_alone() -> None:
    text = "bad-mouthing (coalition_open), 0.7 ± 0.1: x/y"
    assert plain(text) == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("<b>x", "&lt;b&gt;x"),
        ("a`b", "a\\`b"),
        ("[x](y)", "\\[x\\](y)"),
        ("*x*", "\\*x\\*"),
        ("two\nlines", "two lines"),
        ("a&b", "a&amp;b"),
    ],
)
def test_plain_makes_markup_text(text: str, shown: str) -> None:
    assert plain(text) == shown


@pytest.mark.parametrize("name", ["<b>x", "mean:lam=0.5", "a*b*"])
def test_code_is_a_span_where_it_can_be(name: str) -> None:
    assert code(name) == f"`{name}`"


def test_code_escapes_what_would_end_a_span_or_a_cell() -> None:
    assert code("a`|<b>") == "<code>a&#96;&#124;&lt;b&gt;</code>"


def test_a_bar_does_not_end_a_cell() -> None:
    table = markdown_table(["name", "x"], [["a|b", "1"]], 1)
    assert table.splitlines()[-1] == "| a&#124;b | 1 |"


def test_names_in_a_leaderboard_are_no_markup() -> None:
    suite = tiny(models=["<b>x"], name="<i>suite")
    text = Leaderboard.of(suite, [])._repr_markdown_()
    assert "<i>" not in text
    assert "<b>" not in text.replace("`<b>x`", "")
    assert "`<b>x`" in text
