"""The README in particular: its loop, and its links on a package index."""

import ast
import importlib.util
import re

import pytest
from pages import HOUSE, blocks, run

README = HOUSE / "README.md"


@pytest.fixture
def said():
    return run(README)


def test_the_first_loop_prints_what_the_page_shows(said):
    trust = {agent: round(info["trust"], 2) for agent, info in said["infos"].items()}
    (shown,) = blocks(README, "text")
    assert ast.literal_eval(shown) == trust
    assert trust["sr_2"] < trust["sr_0"]


CODE = r"^```.*?^```$|`[^`\n]+`"


@pytest.fixture
def absolute():
    """The function of `hatch_build.py`, which is not installed."""
    pytest.importorskip("hatchling", reason="it is needed to build the package only")
    spec = importlib.util.spec_from_file_location("hatch_build", HOUSE / "hatch_build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.absolute


def test_on_a_package_index_links_are_absolute(absolute):
    text = README.read_text(encoding="utf-8")
    shown = absolute(text, "https://example.org/team/roletrust/")
    assert "(https://example.org/team/roletrust/raw/HEAD/docs/game.gif)" in shown
    assert "(https://example.org/team/roletrust/blob/HEAD/docs/guide/install.md)" in shown
    assert re.findall(r"\]\((?!https://)[^)#]*\)", re.sub(CODE, "", shown, flags=re.M | re.S)) == []
    without = absolute(text, None)
    for shown_text in (shown, without):
        assert re.findall(CODE, shown_text, re.M | re.S) == re.findall(CODE, text, re.M | re.S)
    assert "game.gif" not in without
    assert "Tutorials" in without
    assert (
        re.findall(r"\]\((?!https://)[^)#]*\)", re.sub(CODE, "", without, flags=re.M | re.S)) == []
    )
